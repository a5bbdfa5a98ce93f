"""Which registers of a device the next poll reads: not those it lacks, and slow values less often. Pure.

Rules
-----
1. A poll reads every value, neighbours together. A value with an `interval` of its own is read when that has passed;
   in between the samples carry the newest one, with its age where that is greater than the device's interval. Where
   every value has an interval, those with the shortest are read in each poll.
2. Where a read of several registers is refused with exception 02 and some of them are optional, the rest is read
   without them in the same poll, and each optional register alone: those that are refused again are absent.
3. What is absent is null in every sample, with the error `exception`, and read again after `ABSENT_AGAIN`.
4. After an outage nothing is known of the device: everything is read.

Times are monotonic s, durations s.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from math import ceil

from lfs10d.profiles.blocks import Block
from lfs10d.profiles.profile import Profile
from lfs10d.profiles.values import Value
from lfs10d.reading import Fault, FaultCode
from lfs10d.reading import Value as Published
from lfs10d.system.dataclass import dataclass

ABSENT_AGAIN = 600.0
"""Seconds after which an absent value is read again."""
EARLY = 0.1
"""Tolerance for slow values, as a part of the device's interval: polls are not made to the millisecond."""
ILLEGAL_ADDRESS = 2
"""The exception of a register that there is not (Modbus Application Protocol V1.1b3, section 7)."""


@dataclass(frozen=True, slots=True)
class Newest:
    """The last value that was read, at the time `at`; `fault` says why it is None."""

    at: float
    value: Published | None
    fault: Fault | None


def part_of_polls(profile: Profile, block: Block, interval: float) -> float:
    """Return the part of the polls (every `interval`) in which a read of the profile is made.

    1.0: in each. With an interval of 0 (as often as the line allows) a slow value's part is not known: 0.0.
    """
    own = block.values[0].interval
    if own is None or own <= _shortest(profile.values):
        return 1.0
    return 1 / max(1, ceil(own / interval - EARLY)) if interval else 0.0


def _shortest(values: Iterable[Value]) -> float:
    """Return the shortest interval of slow values: 0 where one has none of its own."""
    return min((value.interval or 0.0 for value in values), default=0.0)


class ReadPlan:
    """The reads of one device."""

    def __init__(self, profile: Profile) -> None:
        self.forget()
        self.follow(profile)

    def follow(self, profile: Profile) -> None:
        """Read by another profile of the same registers from now on."""
        self._profile = profile
        self._everything = profile.reads()
        self.value_names = profile.value_names
        self.simple = not any(value.optional or value.interval is not None for value in profile.values)
        """Every poll reads the same."""
        self._slow = tuple(value for value in profile.values if value.interval is not None)
        self._batched: dict[tuple[frozenset[str], frozenset[str]], tuple[Block, ...]] = {}

    def forget(self) -> None:
        """Forget everything about the device: it was offline (rule 4)."""
        self._absent: dict[str, tuple[Fault, float]] = {}
        self._newest: dict[str, Newest] = {}
        self._alone: set[str] = set()
        self._found_absent = False

    def reads(self, now: float, interval: float, *, everything: bool = False) -> tuple[Block, ...]:
        """Return the reads of a poll that begins `now` of a device polled every `interval`, at least one.

        `everything`: slow values too.
        """
        if self.simple:
            return self._everything
        resting = set() if everything else {each.name for each in self._slow if not self._due(each, now, interval)}
        absent = {name for name, (_, again_at) in self._absent.items() if now < again_at}
        if len(resting | absent) == len(self._profile.values):
            resting = self._slower({name for name in resting if name not in absent})
        if len(absent) == len(self._profile.values):
            absent = set()
        return self._reads_but(frozenset(resting | absent), frozenset((self._alone | self._absent.keys()) - absent))

    def _slower(self, names: set[str]) -> set[str]:
        """Return the names of slow values without those that have the shortest interval among them."""
        values = [value for value in self._slow if value.name in names]
        shortest = _shortest(values)
        return {value.name for value in values if (value.interval or 0.0) > shortest}

    def _due(self, value: Value, now: float, interval: float) -> bool:
        newest = self._newest.get(value.name)
        return newest is None or now >= newest.at + (value.interval or 0.0) - EARLY * interval

    def _reads_but(self, left_out: frozenset[str], alone: frozenset[str]) -> tuple[Block, ...]:
        """Return the reads of all but some values, others `alone`; the same objects for the same question."""
        known = self._batched.get((left_out, alone))
        if known is None:
            read = [value for value in self._profile.values if value.name not in left_out]
            together = self._profile.batched(value for value in read if value.name not in alone)
            known = together + self._profile.alone(value for value in read if value.name in alone)
            self._batched[left_out, alone] = known
        return known

    def refused(self, block: Block, fault: Fault, now: float) -> tuple[Block, ...] | None:
        """Take the refusal of a read; return the reads in its place, None if the poll fails."""
        optional = tuple(value for value in block.values if value.optional)
        if fault.exception_code != ILLEGAL_ADDRESS or not optional:
            return None
        if all((value.register, value.optional) == (block.address, True) for value in block.values):
            self._absent |= {value.name: (fault, now + ABSENT_AGAIN) for value in block.values}
            self._found_absent = True
            return ()
        self._alone |= {value.name for value in optional}
        rest = self._profile.batched(value for value in block.values if not value.optional)
        return rest + self._profile.alone(optional)

    def complete(
        self, values: dict[str, Published | None], faults: dict[str, Fault], at: float, interval: float
    ) -> Mapping[str, float]:
        """Take the values of a poll that ended at `at`, and add those not read; return the ages of old values."""
        for value in self._slow:
            if value.name in values:
                self._newest[value.name] = Newest(at, values[value.name], faults.get(value.name))
        for name in values:
            self._absent.pop(name, None)
        if self._found_absent:
            self._alone.clear()
            self._found_absent = False
        ages: dict[str, float] = {}
        for name in self.value_names:
            if name in values:
                continue
            newest = self._kept(name, at)
            values[name] = newest.value
            if newest.fault is not None:
                faults[name] = newest.fault
            elif at - newest.at > interval:
                ages[name] = at - newest.at
        return ages

    def _kept(self, name: str, at: float) -> Newest:
        """Return the last value of one that was not read."""
        if name in self._absent:
            return Newest(at, None, self._absent[name][0])
        unknown = Fault(FaultCode.UNAVAILABLE, f"{name} was not read yet")  # forgotten while the poll was under way
        return self._newest.get(name) or Newest(at, None, unknown)
