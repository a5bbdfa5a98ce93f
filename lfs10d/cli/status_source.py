"""The status file of a line's daemon, as `watch` and the page read it."""

from __future__ import annotations

import contextlib
from collections.abc import Iterable
from pathlib import Path
from typing import Any, Final

from lfs10d.cli.client import parsed
from lfs10d.cli.render.foreign import mapping
from lfs10d.system.regular_file import read_regular

LARGEST_STATUS: Final = 2**22
"""Bytes; 255 devices take a tenth of it."""


def read_status(places: Iterable[Path], line: str) -> tuple[Path, dict[str, Any]] | None:
    """Return the first status at one of these places that is of this line, and its place; None where there is none."""
    for place in places:
        with contextlib.suppress(OSError):
            status = parsed(read_regular(place, LARGEST_STATUS))
            if mapping(mapping(status).get("line")).get("name") == line:
                return place, status
    return None
