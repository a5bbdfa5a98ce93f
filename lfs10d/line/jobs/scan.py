"""A scan of the line: every slave id is asked once at every rate, and each that answers is identified. Pure.

Rules
-----
1. It only reads. Each id is asked one read, with a short time-out: an answer that comes later than that is still
   known for what it is (`Outcome.late`), and the last id of a round is waited for until none can come any more.
2. Any right frame of a slave is an answer, an exception too; then it is identified (`lfs10d.line.jobs.identification`).
3. Ids at which other bytes were heard are asked again at the end of the round, patiently, and so are the ids asked
   shortly before them while such noise is rare: a late answer may have run into our next request. Where most ids
   are noisy it is the line, and nobody is asked again.
4. Ids 248 to 255 are asked last, when everybody else has been heard at every rate: 255 may be a wildcard. One that
   answers when any other id answers too is `suspect`.
5. Another rate than the line's is spoken in slices of up to `SLICE`, never for one exchange; at the line's own rate
   others may speak after each.
"""

from __future__ import annotations

from collections.abc import Callable, Generator
from dataclasses import replace
from math import inf

from lfs10d.line.jobs.identification import FoundDevice, Identification, shortest_answer, speaks, spoilt, strangers
from lfs10d.line.jobs.job import Continue, Done, Next, Requeue
from lfs10d.line.jobs.scan_plan import LAST_TIMEOUT, RESERVED_FROM, ScanPlan
from lfs10d.modbus.ask import Ask
from lfs10d.modbus.outcome import Outcome
from lfs10d.reading import Fault, FaultCode, Purpose
from lfs10d.system.dataclass import dataclass

PATIENT_TIMEOUT = 0.4
"""Time-out in s for an id that is identified, or asked once more."""
SLICE = 0.25
"""The longest stay at another rate than the line's, in s."""
BEFORE_NOISE = 5
"""Number of ids before one with noise that are asked again..."""
RARE = 3
"""... if no more ids than this had noise."""
COMMON = 0.25
"""Noise at more than this share of the ids (and more than `RARE`) is the line's."""
SETTLING = 1.0
"""Seconds of scanning after which the measured pace counts as much as the expected one."""


@dataclass(frozen=True, slots=True)
class Progress:
    """The progress of a scan: `asked` of `total` ids, `remaining` s to go, at `slave` and `baudrate` now."""

    asked: int
    total: int
    remaining: float
    slave: int
    baudrate: int

    @property
    def percent(self) -> float:
        """The finished part, 0 to 100."""
        return 100.0 * self.asked / self.total


@dataclass(slots=True)
class Noise:
    """Bytes received that are no answer, in the first round.

    `ids` had bytes that make no right frame, or another's frame; `last` is the last such fault. `echoed`: the
    adapter returns our own bytes. `refused` ids were never asked, for the line did not fall silent.
    """

    ids: int = 0
    refused: int = 0
    echoed: bool = False
    last: Fault | None = None


def _ignore(_: Scan) -> None:
    """Ignore the report."""


class Scan:
    """One scan. `over` when it has ended; `complete` if all was asked, `lost` if the port was lost before.

    `ended` is called once, with this job, when it is over.
    """

    purpose = Purpose.SCAN
    excludes: frozenset[int] = frozenset()

    def __init__(self, plan: ScanPlan, ended: Callable[[Scan], None] = _ignore) -> None:
        self.plan = plan
        self.share = plan.share
        self.over = self.complete = self.lost = False
        self._ended = ended
        self.noise = Noise()
        self._found: dict[tuple[int, int], FoundDevice] = {}
        self._slow: set[int] = set()
        self._asked_at: dict[int, set[int]] = {timing.baudrate: set() for timing in plan.timings}
        self._asked = 0
        self._total = sum(len(ids) for _, ids in plan.rounds)
        self._place = (plan.rounds[0][1][0], plan.rounds[0][0].baudrate)
        self._began: float | None = None
        self._now = 0.0
        self._slice_until = -inf
        self._steps = self._all_rounds()
        self._following: Ask | None = next(self._steps, None)

    @property
    def found(self) -> tuple[FoundDevice, ...]:
        """The devices found so far, by rate and id."""
        answering = {device.slave for device in tuple(self._found.values()) if device.answers}
        devices = (
            replace(device, suspect=device.slave >= RESERVED_FROM and bool(answering - {device.slave}))
            for device in tuple(self._found.values())
        )
        return tuple(sorted(devices, key=lambda device: (device.baudrate, device.slave)))

    @property
    def progress(self) -> Progress:
        """The progress, by the pace so far."""
        expected = self.plan.expected
        done = expected * self._asked / self._total
        elapsed = 0.0 if self._began is None else self._now - self._began
        pace = (SETTLING + elapsed) / (SETTLING + done)
        return Progress(self._asked, self._total, (expected - done) * pace, *self._place)

    def cancel(self) -> None:
        """End it after the exchange under way; what was found stays."""
        self._following = None

    # -- as a job

    def ask(self, now: float) -> Ask | Done:
        """Return the next request, or a decision to wait."""
        if self._began is None:
            self._now = self._began = now  # in this order: `progress` may be read meanwhile
        if self._following is None:
            return self._end()
        if now >= self._slice_until:
            self._slice_until = now + SLICE
        return self._following

    def on_outcome(self, outcome: Outcome, now: float) -> Next:
        """Take the outcome of the request."""
        asked, self._now = self._following, now
        if asked is not None:
            try:
                self._following = self._steps.send(outcome)
            except StopIteration:
                self._following, self.complete = None, True
        following = self._following
        if following is None or asked is None:
            return self._end()
        stays = following.baudrate == asked.baudrate != self.plan.line_rate
        ends = now + following.timeout + self._cost_at(following.baudrate)
        if stays and self.plan.line_rate is not None and ends <= self._slice_until:
            return Continue()
        self._slice_until = -inf
        return Requeue(now)

    def cut_off(self, now: float) -> None:
        """Note that the port is lost."""
        self._now, self._following, self.lost = now, None, True
        self._end()

    def _end(self) -> Done:
        self.over = True
        self._ended(self)
        return Done()

    def _cost_at(self, baudrate: int | None) -> float:
        return next(self.plan.cost(timing) for timing in self.plan.timings if timing.baudrate == baudrate)

    # -- what is asked, one id after the other

    def _all_rounds(self) -> Generator[Ask, Outcome, None]:
        for timing, ids in self.plan.rounds:
            yield from self._round(ids, timing.baudrate)

    def _round(self, ids: tuple[int, ...], baudrate: int) -> Generator[Ask, Outcome, None]:
        noisy: list[int] = []
        for place, slave in enumerate(ids):
            self._place = slave, baudrate
            timeout = self.plan.timeout if place < len(ids) - 1 else max(LAST_TIMEOUT, self.plan.timeout)
            outcome = yield from self._question(slave, baudrate, timeout)
            self._asked += 1
            if self._disturbed(outcome):
                noisy.append(place)
            yield from self._late_ones(baudrate)
        for place in self._worth_another(noisy, len(ids)):
            if (ids[place], baudrate) not in self._found:
                yield from self._question(ids[place], baudrate, PATIENT_TIMEOUT, again=True)
        yield from self._late_ones(baudrate)

    def _worth_another(self, noisy: list[int], asked: int) -> list[int]:
        if len(noisy) > max(RARE, COMMON * asked):
            return []
        before = BEFORE_NOISE if len(noisy) <= RARE else 0
        return sorted({place for noise in noisy for place in range(max(0, noise - before), noise + 1)})

    def _question(
        self, slave: int, baudrate: int, timeout: float, *, again: bool = False
    ) -> Generator[Ask, Outcome, Outcome]:
        """Ask one id and identify what answers; bytes without a frame only the second time."""
        codec = self.plan.codec
        self._asked_at[baudrate].add(slave)
        outcome = yield Ask(self.plan.opening(slave), codec, timeout, None, baudrate)
        self._note_late(outcome, baudrate)
        if speaks(outcome, codec) or (again and spoilt(outcome, codec)):
            yield from self._identify(slave, baudrate, PATIENT_TIMEOUT, outcome)
        return outcome

    def _late_ones(self, baudrate: int) -> Generator[Ask, Outcome, None]:
        """Identify devices that answered after their time-out."""
        while self._slow:
            slave = self._slow.pop()
            if (slave, baudrate) not in self._found:
                yield from self._identify(slave, baudrate, LAST_TIMEOUT, None)

    def _identify(
        self, slave: int, baudrate: int, timeout: float, first: Outcome | None
    ) -> Generator[Ask, Outcome, None]:
        plan = self.plan
        profiles = tuple(plan.read_as(slave, baudrate, profile) for profile in plan.profiles)
        steps = Identification(FoundDevice(slave, baudrate), profiles, plan.codec, first).steps()
        try:
            request = next(steps)
            while True:
                outcome = yield Ask(request, plan.codec, timeout, timeout / 4, baudrate)
                self._note_late(outcome, baudrate)
                request = steps.send(outcome)
        except StopIteration as end:
            if end.value is not None:
                self._found[slave, baudrate] = end.value

    def _note_late(self, outcome: Outcome, baudrate: int) -> None:
        """Note a late answer of an id that was asked before at this rate."""
        late = {late.request.slave for late in outcome.late}
        self._slow.update(self._asked_at[baudrate] & (late | strangers(outcome, self.plan.codec)))

    def _disturbed(self, outcome: Outcome) -> bool:
        """Note other bytes; return whether this id is worth asking again."""
        noise, fault = self.noise, outcome.fault
        noise.echoed = noise.echoed or outcome.echoed is True
        if fault is None or self._slow or speaks(outcome, self.plan.codec):
            return False
        if fault.code in (FaultCode.TIMEOUT, FaultCode.LATE):  # what came before the request counts here only
            return outcome.unsolicited >= shortest_answer(self.plan.codec)
        noise.ids += 1
        noise.refused += outcome.began is None
        noise.last = fault
        return outcome.began is not None
