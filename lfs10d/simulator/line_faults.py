"""Faults of a whole line: babble, stray bytes, a second master. Times are seconds of the line's clock."""

from __future__ import annotations

from typing import Final

from lfs10d.simulator.burst import NOISE, SECOND_MASTER
from lfs10d.simulator.faults import ALWAYS, Window
from lfs10d.simulator.judge import HeardRequest, JudgeReport
from lfs10d.simulator.line import SimulatedLine
from lfs10d.simulator.wire import SECOND, nanoseconds, seal

BABBLE_PIECE: Final = SECOND // 10
"""Babble is put on the line in pieces of this length, one right behind the other."""


def babble(line: SimulatedLine, first: float, last: float | None = None, every: float | None = None) -> None:
    """Send random bytes without a pause from `first` to `last`, or for ever; again after each `every`."""
    end = None if last is None else nanoseconds(last)
    again = None if every is None else nanoseconds(every)

    def piece(now: int, end: int | None) -> None:
        length = BABBLE_PIECE if end is None else min(BABBLE_PIECE, end - now)
        count = length // line.format.character
        if count > 0:
            line.speak(NOISE, line.random.randbytes(count), now)
            line.at_nanosecond(now + line.format.span(count), lambda when: piece(when, end))

    def begin(now: int) -> None:
        piece(now, None if end is None else now + end - nanoseconds(first))
        if again is not None:
            line.at_nanosecond(now + again, begin)

    line.at(first, begin)


def stray(
    line: SimulatedLine, rate: float = 1.0, *, length: int = 3, delay: float = 0.001, window: Window = ALWAYS
) -> None:
    """Put `length` random bytes on the line `delay` after that share of the requests, in addition to their answers."""

    def after(request: HeardRequest) -> None:
        if window.covers(request.ended) and line.random.random() < rate:
            line.speak(NOISE, line.random.randbytes(length), request.ended + nanoseconds(delay))

    line.after_each_request(after)


def second_master(line: SimulatedLine, body: bytes, first: float, every: float) -> None:
    """Let another master send this request from `first` on, every `every` seconds, without listening."""
    frame = seal(body, line.framing)

    def ask(now: int) -> None:
        ask_as_second_master(line, frame, now)
        line.at_nanosecond(now + nanoseconds(every), ask)

    line.at(first, ask)


def ask_as_second_master(line: SimulatedLine, frame: bytes, now: int) -> None:
    """Let another master send a frame at `now` (ns), whatever else is on the line."""
    ended = now + line.format.span(len(frame))
    burst = line.speak(SECOND_MASTER, frame, now)
    request = HeardRequest(line.format, now, ended, frame, None, JudgeReport.HEARD, SECOND_MASTER)
    line.at_nanosecond(ended, lambda when: line.carry(request, burst, when))
