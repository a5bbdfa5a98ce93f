"""Devices that are not to be written to, and count how often they are."""

from __future__ import annotations

from typing import Any

from lfs10d.simulator.blueprint import Blueprint
from lfs10d.simulator.sensor import Sensor
from lfs10d.simulator.wire import Format

FOREIGN: list[dict[int, int]] = [
    {0: 3, 1: 225, 2: 0, 3: 7, 4: 9, 5: 700},
    {1: 225, 2: 0, 4: 1, 5: 1},
    {1: 0x414F, 2: 0xD70A, 4: 9, 5: 1},
    {1: 0x414F, 2: 0xD70A, 4: 1, 5: 9},
    {0: 87, 2000: 1, 2001: 2},
]
"""The registers of devices that are no LFS10, as they come at the factory's id."""


class Stranger(Sensor):
    """A sensor that is in no configuration; `written` is how many writes came."""

    written = 0

    def _write(self, *args: Any) -> bytes:  # noqa: ANN401 - passed on
        self.written += 1
        return super()._write(*args)


class Foreigner(Stranger):
    """A device of another kind at the factory's id; it takes any write."""

    def __init__(self, words: dict[int, int], baudrate: int) -> None:
        anything = range(1 << 16)
        kind = Blueprint("foreign", (), words, dict.fromkeys(words, anything))
        super().__init__(1, blueprint=kind, format=Format(baudrate))
