"""The lowest version of each dependency that `pyproject.toml` allows, as requirements: `python -m tests.oldest`.

`make test-oldest` installs these and runs the tests that touch them, so that each lower bound is one that works.
The versions stand in `pyproject.toml` alone.
"""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

ROOT = Path(__file__).parent.parent

NEEDED_TO_TEST = frozenset({"pytest", "pytest-xdist", "hypothesis"})
"""What the tests need of the extra `dev`; the rest only looks at the code."""

_RANGE = re.compile(r"(?P<name>[A-Za-z0-9._-]+)(\[[^]]*\])?>=(?P<lowest>[0-9][0-9.]*)(,<[0-9.]+)?")


def lowest(requirement: str) -> str:
    """Return the requirement of the lowest version that one of the form `name>=1.2,<3` allows; raise ValueError."""
    found = _RANGE.fullmatch(requirement)
    if found is None:
        raise ValueError(f"{requirement!r} does not begin with the lowest version that works (name>=1.2,<3)")
    return f"{found['name']}=={found['lowest']}"


def requirements(pyproject: str) -> list[str]:
    """Return what is to be installed; `pyproject` is the text of the file."""
    project = tomllib.loads(pyproject)["project"]
    tools = [
        each for each in project["optional-dependencies"]["dev"] if re.split(r"[\[<>=]", each)[0] in NEEDED_TO_TEST
    ]
    return [lowest(each) for each in (*project["dependencies"], *tools)]


if __name__ == "__main__":
    print("\n".join(requirements((ROOT / "pyproject.toml").read_text())))  # noqa: T201 - what it is asked for
