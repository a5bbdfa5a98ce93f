"""Finds the files that are shipped with the program: units, sample configuration, documentation."""

from __future__ import annotations

import sys
from pathlib import Path

_REPOSITORY = Path(__file__).parents[2]


def shipped(name: str, prefix: Path | None = None) -> Path:
    """Return the path of a file named as in the repository, such as `systemd/lfs10d.service`.

    An installation has it below `share/lfs10d` of its prefix (default this Python's), a working copy in place.
    Raises FileNotFoundError where the installation is incomplete.
    """
    places = [(sys.prefix if prefix is None else prefix) / Path("share/lfs10d", name), _REPOSITORY / name]
    for place in places:
        if place.is_file():
            return place
    raise FileNotFoundError(f"{name} did not come with this installation: {places[0]} is missing")
