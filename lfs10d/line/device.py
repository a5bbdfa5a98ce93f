"""One device at run time: its health, its learned time-outs, when it is polled again.

Rules
-----
1. A device is UNHEARD from the opening of the port until its first answer, ONLINE after an answer, OFFLINE after
   `offline_after` consecutive failed polls or while the port is lost.
2. `exception`, `out_of_range`, `not_finite` and `unavailable` prove it alive: a failed poll, but ONLINE.
3. An exception that means busy by its profile (06) proves it alive and counts neither as error nor towards offline.
4. The time-out is fixed, or learned: 2 x p99 of the last 100 answers + 20 ms within 50 ms..1 s. A slave never
   heard is given 200, 400, 1000 ms on its first polls. A late answer counts with the time it took.
5. A probe of an OFFLINE device waits 200 ms or what was learned, every fourth one 1 s.
6. A device that is silent at the start, or when the port is back, is polled `START_POLLS` times at once. Then it is
   doubtful, as an OFFLINE one is: asked within the share of probes, so that absent devices barely slow the others; when
   the first other one answers, at once but for 200 ms only.
7. A device that answers badly (bytes came, but no right frame) is polled as one that answers well, however it is: bad
   answers are cheap. Of one that was never heard it is not known how long it takes: it is given 200 ms.

======== =================== =============================================== =========
from     answer or alive     failed poll                                     port lost
======== =================== =============================================== =========
UNHEARD  ONLINE              UNHEARD, the `offline_after`-th: OFFLINE        OFFLINE
ONLINE   ONLINE              ONLINE, the `offline_after`-th: OFFLINE         OFFLINE
OFFLINE  ONLINE              OFFLINE                                         OFFLINE
======== =================== =============================================== =========

When the port is back every device is UNHEARD.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right, insort
from collections import deque
from dataclasses import field
from enum import StrEnum
from math import ceil

from lfs10d.line.read_plan import ReadPlan
from lfs10d.line.request_gap import RequestGap
from lfs10d.modbus.frames import Codec
from lfs10d.profiles.profile import Profile
from lfs10d.reading import ALIVE_CODES, SILENT_CODES, START_POLLS, Fault
from lfs10d.system.dataclass import dataclass

BAD_ANSWER_PATIENCE = 0.1
"""Seconds to wait, after bytes that begin no answer, for a device that has only answered badly so far."""
FIRST_TIMEOUTS = (0.2, 0.4, 1.0)
"""Time-outs in s of the first polls of a slave that never answered; the last one stays."""
LEARNED_LEAST = 0.05
"""The shortest learned time-out in s."""
LEARNED_MOST = 1.0
"""The longest learned time-out in s."""
LEARNED_MARGIN = 0.02
"""Added to twice the p99, in s."""
LEARNED_FROM = 100
"""Number of answers that are remembered."""
CONFIDENT_FROM = 10
"""With fewer answers than this the learned time-out is at least the first one."""
PROBE_TIMEOUT = 0.2
"""Time-out of a probe in s."""
PATIENT_PROBE_EVERY = 4
"""Every n-th probe has a time-out of 1 s."""
PROBE_INTERVAL_LEAST = 1.0
"""First interval between probes in s; doubled after each."""


class Health(StrEnum):
    """The health of a device; see the rules above."""

    UNHEARD = "unheard"
    ONLINE = "online"
    OFFLINE = "offline"


@dataclass(frozen=True, slots=True)
class DeviceSpec:
    """A slave as configured. Durations in s; `response_timeout` None: learned.

    `request_gap` is the rest it needs between two exchanges.
    """

    name: str
    slave: int
    profile: Profile
    codec: Codec
    interval: float
    enabled: bool = True
    response_timeout: float | None = None
    request_gap: float = 0.0

    def begins_anew(self, before: DeviceSpec) -> bool:
        """Whether what was learned of the device `before` is no longer valid."""
        reborn = self.enabled and not before.enabled
        return reborn or (self.slave, self.profile.plain, self.codec) != (
            before.slave,
            before.profile.plain,
            before.codec,
        )


@dataclass(frozen=True, slots=True)
class PollRules:
    """Rules for the polls of every device (`poll:` in the configuration). Durations in s."""

    retries: int = 1
    offline_after: int = 3
    probe_interval_max: float = 15.0


class ResponseTimes:
    """The response times in s (last bit of the request to first byte of the answer) of the last answers."""

    def __init__(self) -> None:
        self._last: deque[float] = deque(maxlen=LEARNED_FROM)
        self._ordered: list[float] = []
        self.p99: float | None = None
        self.timeout: float | None = None
        """The time-out that is learned from them in s (rule 4); None while there are none."""

    def __len__(self) -> int:
        return len(self._last)

    def learn(self, turnaround: float) -> None:
        """Take one more answer's turnaround in s."""
        ordered = self._ordered
        if len(ordered) == LEARNED_FROM:
            del ordered[bisect_left(ordered, self._last[0])]
        self._last.append(turnaround)
        insort(ordered, turnaround)
        count = len(ordered)
        p99 = ordered[ceil(0.99 * count) - 1]
        if p99 != self.p99 or count == CONFIDENT_FROM:
            self.p99 = p99
            least = LEARNED_LEAST if count >= CONFIDENT_FROM else FIRST_TIMEOUTS[0]
            self.timeout = min(max(2 * p99 + LEARNED_MARGIN, least), LEARNED_MOST)

    def count_near(self, turnaround: float, margin: float) -> int:
        """Return how many of the last answers took as long as `turnaround` s, give or take `margin` s."""
        return bisect_right(self._ordered, turnaround + margin) - bisect_left(self._ordered, turnaround - margin)

    def forget(self) -> None:
        """Forget all response times, as after a change of rate."""
        self._last.clear()
        self._ordered = []
        self.p99 = self.timeout = None


@dataclass(slots=True)
class Device:
    """One configured slave at run time.

    `due` is its next point of the grid, `overruns` counts the points missed since its last reading. `queued`: it
    waits in the scheduler's queue; `polling`: a poll or probe of it is under way. `polled_at` is when its last poll
    was begun, whoever wanted it. `silent`: its last poll failed without an answer, good or bad. `start_polls` are left
    of those that are made at once, the next one at `again_at`; `hurried`: many are silent, none is waited for long.
    """

    spec: DeviceSpec
    rules: PollRules
    slave: int
    health: Health = Health.UNHEARD
    failures: int = 0
    probes: int = 0
    overruns: int = 0
    due: float = 0.0
    last_asked: float = float("-inf")
    next_probe: float = 0.0
    probe_interval: float = PROBE_INTERVAL_LEAST
    probe_exempt: bool = False
    queued: bool = False
    polling: bool = False
    response_times: ResponseTimes = field(default_factory=ResponseTimes)
    gap: RequestGap = field(default_factory=RequestGap)
    polled_at: float = float("-inf")
    silent: bool = False
    start_polls: int = START_POLLS
    again_at: float = 0.0
    hurried: bool = False
    reads: ReadPlan = field(init=False)

    def __post_init__(self) -> None:
        """Plan its reads by its profile."""
        self.reads = ReadPlan(self.spec.profile)

    @property
    def name(self) -> str:
        """The name in the configuration."""
        return self.spec.name

    @property
    def online(self) -> bool:
        """Whether the device is online."""
        return self.health is Health.ONLINE

    @property
    def doubtful(self) -> bool:
        """Whether it is probed, not polled (rules 6 and 7)."""
        return self.silent and not self.online and self.start_polls == 0

    @property
    def starting(self) -> bool:
        """Whether it has been silent since the start, and is polled again at once (rule 6)."""
        return self.silent and self.start_polls > 0

    @property
    def timeout(self) -> float:
        """Time-out in s of its next poll: until the first byte of an answer (rules 4 and 5)."""
        if self.spec.response_timeout is not None:
            return self.spec.response_timeout
        if self.response_times.timeout is not None:
            return self.response_times.timeout
        if self.hurried or (self.failures and not self.silent):
            return FIRST_TIMEOUTS[0]
        return FIRST_TIMEOUTS[min(self.failures, len(FIRST_TIMEOUTS) - 1)]

    @property
    def patience(self) -> float | None:
        """Longest time in s from a request to the first bytes of its answer, if known."""
        p99 = self.response_times.p99
        if p99 is None and self.failures and not self.silent:
            return BAD_ANSWER_PATIENCE
        return p99

    @property
    def probe_timeout(self) -> float:
        """Time-out in s of its next probe (rule 5); a fixed time-out holds for probes too."""
        if self.spec.response_timeout is not None:
            return self.timeout
        if self.health is Health.UNHEARD:
            return PROBE_TIMEOUT if self.probe_exempt else self.timeout
        if self.probes % PATIENT_PROBE_EVERY == PATIENT_PROBE_EVERY - 1:
            return LEARNED_MOST
        return PROBE_TIMEOUT if self.response_times.p99 is None else max(PROBE_TIMEOUT, self.timeout)

    @property
    def retries(self) -> int:
        """Retries of its next poll: none while it is offline or has never answered."""
        return self.rules.retries if self.online else 0

    def answered(self) -> None:
        """Note a poll that gave a value, or a fault that proves the device alive."""
        self.failures = 0
        self.silent = False
        self.start_polls = 0
        self.hurried = False
        self.health = Health.ONLINE
        self.probes = 0
        self.probe_interval = PROBE_INTERVAL_LEAST
        self.probe_exempt = False

    def failed(self, fault: Fault, now: float) -> None:
        """Note a poll or a probe that ended with `fault` (not one of the port)."""
        if fault.code in ALIVE_CODES:
            self.answered()
            return
        self.failures += 1
        self.probe_exempt = False
        self.silent = fault.code in SILENT_CODES
        self.again_at = now
        if self.start_polls > 0:
            self.start_polls -= 1
        elif self.health is Health.OFFLINE:
            self.probes += 1
            self.probe_interval = min(2 * self.probe_interval, self.rules.probe_interval_max)
            self.next_probe = now + self.probe_interval
            return
        if self.failures >= self.rules.offline_after:
            self.health = Health.OFFLINE
            self.gap.offline()
            self.reads.forget()
            self.probe_interval = min(PROBE_INTERVAL_LEAST, self.rules.probe_interval_max)
        self.next_probe = now + self.probe_interval

    def cut_off(self) -> None:
        """Note that the port is lost, and with it any poll under way."""
        self.health = Health.OFFLINE
        self.silent = True
        self.start_polls = 0
        self.polling = False
        self.reads.forget()

    def reconnected(self) -> None:
        """Note that the port is open again: the state of the device is unknown."""
        self.health = Health.UNHEARD
        self.failures = 0
        self.silent = False
        self.start_polls = START_POLLS
        self.probes = 0
        self.probe_exempt = False
