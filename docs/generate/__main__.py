"""`python -m docs.generate`: write the generated pages; with `--check` tell which are stale and exit 1."""

from __future__ import annotations

import sys

from docs.generate.pages import FOLDER, PAGES, stale


def main(arguments: list[str]) -> int:
    """Write the stale pages, or only name them; return the exit code."""
    if arguments not in ([], ["--check"]):
        print("usage: python -m docs.generate [--check]", file=sys.stderr)
        return 2
    old = stale()
    for name in old:
        if arguments:
            print(f"docs/{name} is stale: run `make docs`", file=sys.stderr)
        else:
            (FOLDER / name).write_text(PAGES[name](), encoding="utf-8")
            print(f"docs/{name} written")
    return 1 if old and arguments else 0


sys.exit(main(sys.argv[1:]))
