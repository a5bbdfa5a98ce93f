"""A second master that comes and goes."""

from __future__ import annotations

from collections.abc import Callable

from lfs10d.simulator.line import SimulatedLine
from lfs10d.simulator.line_faults import ask_as_second_master
from lfs10d.simulator.wire import nanoseconds, seal


def passing_master(line: SimulatedLine, body: bytes, first: float, every: float) -> Callable[[], None]:
    """Let another master send this request every `every` seconds, until the returned function is called."""
    frame = seal(body, line.framing)
    gone = False

    def leave() -> None:
        nonlocal gone
        gone = True

    def ask(now: int) -> None:
        if not gone:
            ask_as_second_master(line, frame, now)
            line.at_nanosecond(now + nanoseconds(every), ask)

    line.at(first, ask)
    return leave
