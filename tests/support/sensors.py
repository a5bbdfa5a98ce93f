"""Sensors that answer a procedure or a job, exchange by exchange."""

from __future__ import annotations

from collections.abc import Callable, Generator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, TypeVar

from lfs10d.line.jobs.job import Hold
from lfs10d.line.jobs.procedure import Await, LineLostError, ProcedureClock, Step
from lfs10d.modbus.ask import Ask
from lfs10d.modbus.frames import Codec, Framing
from lfs10d.modbus.outcome import Outcome
from lfs10d.modbus.pending import PendingRequests
from lfs10d.modbus.request import ReadRegisters, Request, WriteRegister
from lfs10d.profiles.library import load_profile
from lfs10d.profiles.profile import Profile
from lfs10d.reading import Fault, FaultCode
from lfs10d.reconfiguration.procedures.identity_query import IdentityQuery
from tests.support.outcomes import ended

T = TypeVar("T")
CODEC = Codec(Framing.RTU)


LFS10 = load_profile("lfs10", relative_to=Path())


EXCHANGE = 0.03
"""What an answered question takes, in s."""
RATE_CODES = {1: 9600, 2: 19200}
LINE_RATE = 9600


@dataclass
class Mimic:
    """A sensor. `manner` is how it takes a write: see `take`; `wind` are its two value registers."""

    slave: int
    baudrate: int = 9600
    manner: str = "obeys"
    wind: tuple[int, int] = (0x414F, 0xD70A)
    silent: bool = False
    exception: int | None = None
    """With this code it refuses to be read."""
    stored: dict[int, int] = field(default_factory=dict)
    """What its registers say that is not so yet."""
    codes: dict[int, int] = field(default_factory=lambda: dict(RATE_CODES))
    """The rate of each content of its rate register."""

    def read(self, request: ReadRegisters) -> tuple[int, ...] | int:
        """Return the registers, or the exception with which it refuses this read."""
        if request.address == 1:
            return self.wind
        true = {4: {rate: code for code, rate in self.codes.items()}[self.baudrate], 5: self.slave}
        return (self.stored.get(request.address, true[request.address]),)

    def take(self, request: WriteRegister) -> int | None:
        """Take a write; return the code of a refusal."""
        if self.manner in ("obeys", "refuses_and_obeys"):
            self.stored.clear()
            if request.address == 5:
                self.slave = request.value
            else:
                self.baudrate = self.codes[request.value]
        elif self.manner == "vanishes":
            self.silent = True
        elif self.manner in ("stores", "refuses_and_stores"):
            self.stored[request.address] = request.value
        return 3 if self.manner.startswith("refuses") else None


@dataclass
class Pretence:
    """The line. `asked` is every request, `awaited` everything to be done off the line."""

    sensors: list[Mimic] = field(default_factory=list)
    clock: ProcedureClock = field(default_factory=ProcedureClock)
    pending: PendingRequests = field(default_factory=PendingRequests)
    asked: list[Ask] = field(default_factory=list)
    awaited: list[object] = field(default_factory=list)
    answer: object = None
    """The result of what is awaited: None, or why it failed."""
    later: list[tuple[float, Callable[[], object]]] = field(default_factory=list)
    """What happens at its time, or at the first request after that."""
    noise: set[tuple[int, int]] = field(default_factory=set)
    """Slave id and rate of the places where bytes come that make no frame."""
    turnaround: float = 0.005
    lost_at: int | None = None
    """The port is lost at this question."""

    def sensor(self, slave: int, **facts: Any) -> Mimic:  # noqa: ANN401  # passed on to a dataclass
        """Put one more sensor on the line."""
        self.sensors.append(Mimic(slave, **facts))
        return self.sensors[-1]

    def query(self, profile: Profile = LFS10) -> IdentityQuery:
        """Return what asks sensors of this profile."""
        return IdentityQuery(profile, CODEC, self.pending, self.clock)

    @property
    def requests(self) -> list[Request]:
        """Everything that was put on the line."""
        return [ask.request for ask in self.asked]

    @property
    def writes(self) -> list[WriteRegister]:
        """The writes among them."""
        return [request for request in self.requests if isinstance(request, WriteRegister)]

    def carry_out(self, steps: Generator[Step, Any, T], *, within: float = 600.0) -> T:
        """Carry out a procedure to its end and return its result."""
        value: object = None
        until = self.clock.now + within
        try:
            while True:
                self._happen()
                step = steps.send(value)
                assert self.clock.now < until, f"not over within {within} s"
                if isinstance(step, Ask):
                    if len(self.asked) == self.lost_at:
                        steps.throw(LineLostError())
                    value = self.outcome(step)
                elif isinstance(step, Hold):
                    assert step.until is not None
                    self.clock.now, value = max(self.clock.now, step.until), None
                else:
                    assert isinstance(step, Await)
                    self.awaited.append(step.what)
                    value = self.answer
        except StopIteration as end:
            result: T = end.value
            return result

    def _happen(self) -> None:
        due = [each for each in self.later if each[0] <= self.clock.now]
        self.later = [each for each in self.later if each[0] > self.clock.now]
        for _, what in due:
            what()

    def outcome(self, ask: Ask) -> Outcome:
        """Put a question on the line and return what came of it."""
        self.asked.append(ask)
        slave, rate = ask.request.slave, ask.baudrate or LINE_RATE
        there = [each for each in self.sensors if (each.slave, each.baudrate) == (slave, rate) and not each.silent]
        if (slave, rate) in self.noise:
            return self.settle(ask, outcome_of(ask.request, FaultCode.CRC))
        if not there:
            return self.settle(ask, outcome_of(ask.request, FaultCode.TIMEOUT, took=ask.timeout))
        answers = {self._reply(each, ask.request) for each in there}
        if len(answers) > 1:
            return self.settle(ask, outcome_of(ask.request, FaultCode.CRC))
        (answer,) = answers
        if isinstance(answer, int):
            return self.settle(ask, outcome_of(ask.request, exception=answer, turnaround=self.turnaround))
        return self.settle(ask, outcome_of(ask.request, answer=answer, turnaround=self.turnaround))

    def _reply(self, sensor: Mimic, request: Request) -> tuple[int, ...] | int:
        if isinstance(request, WriteRegister):
            code = sensor.take(request)
            return (request.value,) if code is None else code
        return sensor.read(request) if sensor.exception is None else sensor.exception

    def settle(self, ask: Ask, outcome: Outcome) -> Outcome:
        """Let the time of an exchange pass and remember what is unanswered by it."""
        begun = self.clock.now
        self.clock.now = begun + outcome.ended
        moved = replace(outcome, asked=begun, began=begun, sent_end=begun, ended=self.clock.now)
        self.pending.on_outcome(moved, CODEC, ask.timeout, self.clock.now)
        return moved


def outcome_of(
    request: Request,
    code: FaultCode = FaultCode.TIMEOUT,
    *,
    answer: tuple[int, ...] | None = None,
    exception: int | None = None,
    took: float = EXCHANGE,
    **facts: Any,  # noqa: ANN401  # passed on to a dataclass, which checks the names
) -> Outcome:
    """Return how an exchange of `took` s ended: an answer, an exception, or the fault `code`; and other `facts`."""
    fault = None
    if exception is not None:
        fault = Fault(FaultCode.EXCEPTION, "refused", exception)
    elif answer is None:
        fault = Fault(code, "failed")
    begins = fault is None or fault.code in (FaultCode.EXCEPTION, FaultCode.CRC)
    plain = ended(
        request,
        answer=answer,
        fault=fault,
        gap=None,
        ended=took,
        answered=begins,
        sent=CODEC.encode(request),
        quiet_since=took,
    )
    return replace(plain, **facts)
