"""`make integrations [ONLY="telegraf weewx"]`: run the recipes of docs/integrations on a simulated line.

Each recipe needs a program; where it is missing that is said, and the others run. Exit code 1 if one that ran failed.
"""

from __future__ import annotations

import shutil
import sys
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path

from integrations import databases, recipes
from integrations.rig import Missing, Rig

RECIPES: Mapping[str, Callable[[Rig], str]] = {
    "python": recipes.python,
    "prometheus": recipes.prometheus,
    "grafana": recipes.grafana,
    "victoriametrics": recipes.victoriametrics,
    "postgresql": databases.postgresql,
    "timescaledb": databases.timescaledb,
    "telegraf": databases.telegraf,
    "weewx": recipes.weewx,
    "node-red": recipes.node_red,
}


def main(names: list[str]) -> int:
    """Run the recipes named, or all; return the exit code."""
    unknown = set(names) - RECIPES.keys()
    if unknown:
        print(f"no recipe {', '.join(sorted(unknown))}; there are {', '.join(RECIPES)}", file=sys.stderr)
        return 2
    if shutil.which("mosquitto", path=recipes.PLACES) is None:
        print("needs mosquitto (Debian: apt install mosquitto)", file=sys.stderr)
        return 1
    failed = 0
    with tempfile.TemporaryDirectory(prefix="lfs10d-integrations-") as name, Rig(Path(name)) as rig:
        for recipe in names or RECIPES:
            try:
                print(f"{recipe:16} ok       {RECIPES[recipe](rig)}", flush=True)
            except Missing as missing:
                print(f"{recipe:16} not run  {missing}", flush=True)
            except (AssertionError, OSError, RuntimeError) as error:
                failed += 1
                print(f"{recipe:16} FAILED   {error}", flush=True)
    return 1 if failed else 0


sys.exit(main(sys.argv[1:]))
