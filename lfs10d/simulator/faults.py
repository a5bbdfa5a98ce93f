"""The faults of a simulated sensor or line: kinds, how often, and when.

A fault without times is always there; `first` and `last` bound it, `every` repeats that window. Times are
integer nanoseconds of the line's clock. Whether it strikes is drawn per request from the sensor's own,
seeded random source, so a run can be repeated exactly.
"""

from __future__ import annotations

from collections.abc import Mapping
from enum import StrEnum
from random import Random
from typing import Literal, TypeAlias

from lfs10d.simulator.wire import nanoseconds
from lfs10d.system.dataclass import dataclass


class FaultKind(StrEnum):
    """The faults a sensor can have; the words are those of the faults file."""

    SILENT = "silent"
    """Answers nothing."""
    SHY = "shy"
    """Ignores the request after one to a neighbour that did not answer."""
    NEEDS_REST = "needs_rest"
    """Ignores a request that ends sooner than `delay` (250 ms) after the end of its last answer."""
    SLEEPS = "sleeps"
    """Loses the request that wakes it, after `delay` (500 ms) without a request."""
    LATE = "late"
    """Answers `delay` later than it would, also into the next requests."""
    SLOW_BYTES = "slow_bytes"
    """Pauses for `delay` between any two bytes."""
    NOISY = "noisy"
    """One bit of the answer is flipped, so its check fails."""
    GARBAGE = "garbage"
    """Random bytes in place of the answer; `length` of them, or as many as the answer has."""
    TRUNCATED = "truncated"
    """Only the first `length` bytes of the answer come, or a random number of them."""
    LEADING_NOISE = "leading_noise"
    """`length` (3) random bytes right before the answer."""
    TRAILING_NOISE = "trailing_noise"
    """`length` (3) random bytes right after the answer."""
    WRONG_ID = "wrong_id"
    """The answer carries id `value` (or the own one + 1), its check is right."""
    WRONG_FUNCTION = "wrong_function"
    """The answer carries another function, its check is right."""
    WRONG_COUNT = "wrong_count"
    """A read is answered with one register more than asked for, its check is right."""
    WRONG_ECHO = "wrong_echo"
    """A write is answered with another value, its check is right."""
    EXCEPTION = "exception"
    """Refuses everything with exception `code` (2); 6 is busy."""
    NAN = "nan"
    """The value is NaN."""
    INFINITE = "infinite"
    """The value is infinite."""
    OUT_OF_RANGE = "out_of_range"
    """The value is far beyond the range of the profile."""
    SUBNORMAL = "subnormal"
    """The value is a float32 close to zero, as integers read as float32 are."""
    STUCK = "stuck"
    """The value never changes."""
    UNAVAILABLE = "unavailable"
    """The registers hold what means that there is no value: the profile's `unavailable`, or all ones."""
    ABSENT = "absent"
    """There are no such registers: a read that touches them is refused with exception 2."""
    TWIN = "twin"
    """A second sensor with this id answers reads too, `delay` (37 ms) after the end of the answer."""
    REPEATED = "repeated"
    """The answer comes once more, bit by bit, `delay` (37 ms) after its end."""
    GATEWAY = "gateway"
    """Refuses with exception `code` (11) at once, as a gateway does, and answers `delay` (100 ms) after that."""
    HANGS = "hangs"
    """After a frame it could not read, or an exception it sent, silent until the next power cycle."""
    WILDCARD = "wildcard"
    """Answers requests to id 255 too."""
    DIP_LOCKED = "dip_locked"
    """A write of the id does not take; see `answer`, `reads` and `code`."""
    STORES_BUT_IGNORES = "stores_but_ignores"
    """A write of id or rate is echoed and stored in the register, and never takes effect."""
    POWER_CYCLE = "power_cycle"
    """A new id or rate takes effect only after a power cycle."""
    AT_ONCE = "at_once"
    """A new id or rate takes effect before the echo, which comes from the new id at the new rate."""
    SLOW_FLASH = "slow_flash"
    """Silent for `delay` (5 s) after a write that changed something; the echo comes before that."""
    ECHO_LOSING = "echo_losing"
    """A write takes effect, its echo never comes."""
    POWER_CUT = "power_cut"
    """Without power during the window; afterwards stored settings take effect."""


STRIKES_ANSWERS = frozenset({FaultKind.WRONG_ID, FaultKind.WRONG_FUNCTION, FaultKind.WRONG_COUNT, FaultKind.WRONG_ECHO})
STRIKES_FRAMES = frozenset(
    {FaultKind.NOISY, FaultKind.GARBAGE, FaultKind.TRUNCATED, FaultKind.LEADING_NOISE, FaultKind.TRAILING_NOISE},
)


@dataclass(frozen=True, slots=True)
class Window:
    """A window of time: from `first` to before `last` (None: for ever), again after each `every`."""

    first: int = 0
    last: int | None = None
    every: int | None = None

    def covers(self, now: int) -> bool:
        """Return whether it holds at `now`."""
        if now < self.first or self.last is None:
            return now >= self.first
        if self.every is not None:
            now = self.first + (now - self.first) % self.every
        return now < self.last

    def ended(self, now: int) -> int:
        """Return how often it has ended by `now`."""
        if self.last is None or now < self.last:
            return 0
        return 1 if self.every is None else 1 + (now - self.last) // self.every


ALWAYS = Window()


def window(first: float = 0.0, last: float | None = None, every: float | None = None) -> Window:
    """Return a window with times in seconds."""
    return Window(
        nanoseconds(first),
        None if last is None else nanoseconds(last),
        None if every is None else nanoseconds(every),
    )


@dataclass(frozen=True, slots=True)
class SensorFault:
    """One fault of one sensor: its kind, the share of answers, its window, and details."""

    kind: FaultKind
    rate: float = 1.0
    window: Window = ALWAYS
    delay: int = 0
    """Nanoseconds; see the kind."""
    code: int | None = None
    value: int | None = None
    length: int | None = None
    answer: Literal["echo", "exception"] = "echo"
    """How a DIP-locked sensor answers a write of its id."""
    reads: Literal["old", "new"] = "old"
    """What its id register holds afterwards."""
    values: tuple[str, ...] = ()
    """The names of the values that have it; none means all."""

    def strikes(self, now: int, random: Random) -> bool:
        """Draw whether it shows in the answer to the request heard at `now`."""
        return self.window.covers(now) and (self.rate >= 1.0 or random.random() < self.rate)


ActiveFaults: TypeAlias = Mapping[FaultKind, SensorFault]
"""The faults that show in the reply to one request."""

DEFAULT_DELAYS = {
    FaultKind.LATE: 0.6,
    FaultKind.SLOW_BYTES: 0.001,
    FaultKind.SLOW_FLASH: 5.0,
    FaultKind.NEEDS_REST: 0.25,
    FaultKind.SLEEPS: 0.5,
    FaultKind.TWIN: 0.037,
    FaultKind.REPEATED: 0.037,
    FaultKind.GATEWAY: 0.1,
}
"""Seconds, where none is given."""
