"""The boot id of one run of the daemon: 8 characters, sortable by start."""

from __future__ import annotations

import re
import string
from dataclasses import replace
from pathlib import Path

from lfs10d.system.dataclass import dataclass
from lfs10d.system.disk import Disk

LENGTH = 8
FILE_NAME = "boot"
_DIGITS = string.digits + string.ascii_lowercase
_FORM = re.compile(rb"[0-9a-z]{8}\n?")

TICKS_PER_SECOND = 100
"""36**8 hundredths of a second last until the year 2863."""


@dataclass(frozen=True, slots=True)
class Boot:
    """`id` of this run, that of the `previous` one (None: unknown), and whether `id` is on the disk."""

    id: str
    previous: str | None
    kept: bool


def begin(directory: Path, disk: Disk, wall: float) -> Boot:
    """Return the boot id of a new run at `wall` (epoch seconds): one more than the last, at least the clock.

    The counter in the state directory makes ids sort though a clock without battery begins in the past; the clock
    makes them sort though the state directory is gone. Never fails: without the directory the clock must do.
    """
    path = directory / FILE_NAME
    previous = _last(path, disk)
    clock = int(wall * TICKS_PER_SECOND)
    number = clock if previous is None else max(clock, int(previous, 36) + 1)
    return keep(Boot(_text(number), previous, kept=False), directory, disk)


def keep(boot: Boot, directory: Path, disk: Disk) -> Boot:
    """Save the id of this run; return it as `kept` if that was possible."""
    try:
        disk.replace(directory / FILE_NAME, f"{boot.id}\n".encode())
    except OSError:
        return boot
    return replace(boot, kept=True)


def _last(path: Path, disk: Disk) -> str | None:
    try:
        content = disk.read(path)
    except OSError:
        return None
    return content.decode().strip() if _FORM.fullmatch(content) else None


def _text(number: int) -> str:
    number = max(0, number) % len(_DIGITS) ** LENGTH
    text = ""
    for _ in range(LENGTH):
        number, digit = divmod(number, len(_DIGITS))
        text = _DIGITS[digit] + text
    return text
