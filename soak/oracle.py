"""What the sensors sent: every value once in the soak, so each published one names its answer. Pure.

A value is the float32 of a number that counts up, scattered over all float32 that the daemon may publish (from 1e-6 to
100 m/s), so no list of values is needed to find the answer again: the number is computed back.
"""

from __future__ import annotations

import struct
from bisect import bisect_left, insort
from collections import Counter
from dataclasses import dataclass

from soak.ledger import Told

FIRST_BITS = 0x3586_37BD
"""1e-6: what is smaller and not zero is `out_of_range` (docs/profiles.md)."""

LAST_BITS = 0x42C8_0000
"""100.0, the end of the LFS10's range."""

COUNT = LAST_BITS - FIRST_BITS + 1
STRIDE = 618_033_989
"""Prime to COUNT: it scatters the numbers and repeats none."""

_BACK = pow(STRIDE, -1, COUNT)

KEPT_FOR = 3600.0
"""Seconds for which an answer is remembered; the longest absence of a broker and its catching up fit in."""

NEXT_WITHIN = 1.5
"""Seconds from an answer that was not believed to the sample of its poll: what is left of the longest time-out, and
a retry."""

ROUNDING = 0.01
"""Seconds by which `ts`, whole milliseconds of another clock reading, may lie before the answer's end."""

MISSED_MOST = 0.02
"""The part of all answers that a busy machine may make late."""

ENOUGH = 500
"""Answers from which on a part of them says anything."""

EXAMPLES = 20

OFF_BY_MOST = 2.0
"""Seconds between the end of an answer and the `ts` of its sample: what a busy machine may take."""


def value_of(number: int) -> float:
    """Return the value with this number, a float32."""
    bits = FIRST_BITS + number * STRIDE % COUNT
    return float(struct.unpack(">f", bits.to_bytes(4, "big"))[0])


def number_of(value: float) -> int | None:
    """Return the number of a value; None if no sensor sends such a one."""
    try:
        bits = int.from_bytes(struct.pack(">f", value), "big")
    except OverflowError:
        return None
    return (bits - FIRST_BITS) * _BACK % COUNT if FIRST_BITS <= bits <= LAST_BITS else None


class Numbered:
    """Where all sensors of a line take their values from; counts up."""

    def __init__(self) -> None:
        self.drawn = 0

    def __call__(self, now: int) -> float:  # noqa: ARG002  # a Source; the values do not depend on the time
        """Return the next value."""
        self.drawn += 1
        return value_of(self.drawn)


@dataclass(slots=True)
class Sent:
    """One answer with a value; `at` is when its last byte ended, epoch seconds."""

    number: int
    device: str
    at: float
    believable: bool
    """It is whole, and it answers the request that the master had sent last."""
    prompt: bool
    """It came so soon that the master must have waited for it."""
    claimed: tuple[str, int] | None = None
    """Boot and seq of the sample that published it."""


@dataclass(frozen=True, slots=True)
class Excuse:
    """Why answers that ended from `since` to `until` may be told by nobody: what happened `at`. Epoch seconds."""

    why: str
    since: float
    at: float
    until: float

    def covers(self, sent: Sent) -> bool:
        """Tell whether it is one for this answer."""
        return self.since <= sent.at <= self.until


class Oracle:
    """The answers of the last hour, and who published them.

    `told_of` counts answers published once. Of those that a sensor sent well and in time and nobody published, the
    `missed` were polled again or told as a failure at once: on a busy machine bytes may reach the master after its
    time-out. The `excused` fall into an excuse, such as the moment the port was pulled; the `untold` into nothing.
    """

    def __init__(self) -> None:
        self.heard = 0
        self.told_of = 0
        self.missed = 0
        self.untold = 0
        self.excused: Counter[str] = Counter()
        """By the excuse."""
        self.reach: dict[str, float] = {}
        """How long before the moment that is the excuse the earliest of them ended (s)."""
        self.examples: list[Sent] = []
        self._sent: dict[int, Sent] = {}
        self._excuses: list[Excuse] = []
        self._times: dict[str, list[float]] = {}

    def sent(self, answer: Sent) -> None:
        """Note an answer; they come in order of time."""
        self.heard += 1
        self._sent[answer.number] = answer

    def excuse(self, excuse: Excuse) -> None:
        """Expect no sample of the answers it is for."""
        self._excuses.append(excuse)

    def fault_of(self, told: Told) -> str | None:
        """Return what is wrong with a sample, None if nothing; note that its answer was published."""
        insort(self._times.setdefault(told.device, []), told.ts / 1000)
        return None if told.quality == "bad" else self._fault_of_value(told)

    def _fault_of_value(self, told: Told) -> str | None:
        number = None if told.value is None else number_of(told.value)
        if number is None or number not in self._sent:
            return "no sensor sent this value" + (" within the last hour" if number is not None else "")
        sent = self._sent[number]
        key = (told.boot, told.seq)
        if sent.device != told.device:
            return f"it is a value of {sent.device}"
        if not sent.believable:
            return "its answer was damaged, or came after another request had begun"
        if abs(sent.at - told.ts / 1000) > OFF_BY_MOST:
            return f"its answer ended {sent.at - told.ts / 1000:+.1f} s from its ts"
        if sent.claimed not in (None, key):
            return f"its value was published as {sent.claimed} before"
        self.told_of += sent.claimed is None
        sent.claimed = key
        return None

    @property
    def failed(self) -> bool:
        """Whether an answer was passed over in silence, or more of them were missed than a busy machine explains."""
        return self.untold > 0 or self.missed > MISSED_MOST * max(self.heard, ENOUGH)

    def waiting(self, before: float) -> int:
        """Return how many answers that ended before that time nobody has told of, so far."""
        return sum(sent.at < before and self._fate(sent) == "untold" for sent in self._sent.values())

    def fold(self, before: float) -> None:
        """Judge and forget the answers that ended before that time."""
        while self._sent:
            number, sent = next(iter(self._sent.items()))
            if sent.at >= before:
                break
            del self._sent[number]
            fate = self._fate(sent)
            self.missed += fate == "missed"
            if fate == "excused":
                self._excuse(sent)
            if fate == "untold":
                self.untold += 1
                self.examples = [*self.examples, sent][:EXAMPLES]
        self._excuses = [each for each in self._excuses if each.until >= before]
        for times in self._times.values():
            del times[: bisect_left(times, before)]

    def _excuse(self, sent: Sent) -> None:
        excuse = next(each for each in self._excuses if each.covers(sent))
        self.excused[excuse.why] += 1
        self.reach[excuse.why] = max(self.reach.get(excuse.why, 0.0), excuse.at - sent.at)

    def _fate(self, sent: Sent) -> str:
        if sent.claimed is not None or not sent.believable or not sent.prompt:
            return ""
        if any(excuse.covers(sent) for excuse in self._excuses):
            return "excused"
        times = self._times.get(sent.device, [])
        place = bisect_left(times, sent.at - ROUNDING)
        return "missed" if place < len(times) and times[place] <= sent.at + NEXT_WITHIN else "untold"
