"""A scheduler on a line whose `dead` slaves are silent, in virtual time: for the tests of what is asked next."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from lfs10d.line.device import DeviceSpec, PollRules
from lfs10d.line.jobs.job import Continue, Done, Hold, Next, Requeue
from lfs10d.line.jobs.poll import Poll
from lfs10d.line.scheduler import Rest, Scheduler
from lfs10d.modbus.ask import Ask
from lfs10d.modbus.frames import Codec, Framing
from lfs10d.modbus.outcome import LateAnswer, Outcome
from lfs10d.modbus.request import ReadRegisters
from lfs10d.modbus.timing import LineTiming
from lfs10d.profiles.library import load_profile
from lfs10d.reading import Fault, FaultCode, Purpose, Reading

RTU = Codec(Framing.RTU)
LFS10 = load_profile("lfs10", relative_to=Path())
T9600 = LineTiming.of(9600)
GONE = Fault(FaultCode.PORT_LOST, "gone")
NONE: frozenset[int] = frozenset()
VALUES = {0x0001: (0x414F, 0xD70A), 0x0005: (1,)}
TAKES = 0.03


def spec(slave: int, interval: float = 1.0, *, name: str = "", enabled: bool = True) -> DeviceSpec:
    return DeviceSpec(name or f"slave-{slave}", slave, LFS10, RTU, interval, enabled)


class Task:
    """A job that says what it is told to say, one word after the other; then it is done."""

    def __init__(self, *words: Ask | Hold | Next, share: float = 1.0, excludes: frozenset[int] = NONE) -> None:
        self.words = list(words)
        self.share = share
        self.excludes = excludes
        self.purpose = Purpose.SCAN
        self.over_at: float | None = None

    def ask(self, now: float) -> Ask | Hold | Done:  # noqa: ARG002 - a job
        word = self.words[0] if self.words else Done()
        assert isinstance(word, Ask | Hold | Done)
        if not isinstance(word, Ask):  # which is asked again where its slave must rest first
            self.words = self.words[1:]
        return word

    def on_outcome(self, outcome: Outcome, now: float) -> Next:  # noqa: ARG002 - a job
        self.words = self.words[1:]
        word = self.words.pop(0) if self.words else Done()
        assert isinstance(word, Requeue | Continue | Done)
        return word

    def cut_off(self, now: float) -> None:
        self.over_at = now


def asking(slave: int) -> Ask:
    return Ask(ReadRegisters(slave, 0x0004, 1), RTU, 0.2)


class Rig:
    """A scheduler and a line whose `dead` slaves are silent; `times` are slave, begin and end of each exchange."""

    def __init__(self, *specs: DeviceSpec, rules: PollRules | None = None) -> None:
        self.now = 0.0
        self.scheduler = Scheduler(T9600, 0.0)
        self.rules = rules or PollRules()
        self.scheduler.replace(specs, self.rules, 0.0)
        self.dead: set[int] = set()
        self.garbage: set[int] = set()
        self.times: list[tuple[int, float, float]] = []
        self.asked: list[int] = []

    def replace(self, *specs: DeviceSpec) -> None:
        self.scheduler.replace(specs, self.rules, self.now)

    def outcome(self, ask: Ask, late: Iterable[LateAnswer] = ()) -> Outcome:
        request = ask.request
        assert isinstance(request, ReadRegisters)
        silent = request.slave in self.dead
        bad = request.slave in self.garbage
        fault = Fault(FaultCode.TIMEOUT, "no answer") if silent else Fault(FaultCode.CRC, "crc") if bad else None
        ended = self.now + (ask.timeout if silent else TAKES)
        return Outcome(
            request=request,
            answer=None if fault else VALUES.get(request.address, (0,)),
            fault=fault,
            asked=self.now,
            began=self.now,
            sent_end=self.now,
            gap=0.004,
            ended=ended,
            turnaround=None if fault else 0.005,
            rtt=None if fault else TAKES,
            answered=not silent,
            late=tuple(late),
            echoed=None,
            sent=b"",
            heard=b"",
            unsolicited=0,
            quiet_since=ended,
        )

    def ask(self) -> Ask | None:
        """Have the scheduler decide; None where nobody wants the line now."""
        decision = self.scheduler.next(self.now)
        if isinstance(decision, Rest):
            assert decision.until > self.now
            return None
        self.asked.append(decision.request.slave)
        return decision

    def settle(self, ask: Ask, late: Iterable[LateAnswer] = ()) -> list[Reading]:
        outcome = self.outcome(ask, late)
        self.now = outcome.ended
        self.times.append((outcome.request.slave, outcome.asked, outcome.ended))
        return self.scheduler.on_outcome(outcome, self.now)

    def run(self, until: float) -> list[Reading]:
        """Carry out what is wanted until then; return the readings."""
        readings: list[Reading] = []
        while self.now < until:
            decision = self.scheduler.next(self.now)
            if isinstance(decision, Ask):
                self.asked.append(decision.request.slave)
                readings += self.settle(decision)
            else:
                assert decision.until > self.now
                self.now = min(decision.until, until)
        return readings

    def poll_of(self, name: str, request: int = 1) -> Poll:
        device = self.scheduler.devices[name]
        return Poll(device, self.scheduler.pending, due=self.now, purpose=Purpose.REQUEST, request=request)
