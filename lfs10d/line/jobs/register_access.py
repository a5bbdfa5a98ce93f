"""Raw access to one slave's registers: read some, or write one and read it back. Pure.

Rules
-----
1. While a late answer could pass for the one that is waited for, the slave is asked another shape first, or left
   alone until nothing can be pending; see `lfs10d.modbus.pending`.
2. A read is tried as often as there are time-outs, each longer than the one before; a busy slave is asked later.
3. A write goes out only after the slave answered a read of the same register, be it with an exception, and when it is
   known whether the adapter echoes: reads tell. Else nothing was written.
4. A write is sent once. Whatever came of it, but for an exception, the register is read back until the slave
   answers: an echo proves nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Generator
from typing import TypeAlias

from lfs10d.line.device import FIRST_TIMEOUTS
from lfs10d.line.jobs.access_end import End
from lfs10d.line.jobs.job import Done, Hold, Next, Requeue
from lfs10d.line.jobs.poll import marked_busy
from lfs10d.modbus.ask import Ask
from lfs10d.modbus.frames import Codec
from lfs10d.modbus.outcome import Outcome
from lfs10d.modbus.pending import PendingRequests
from lfs10d.modbus.request import ReadRegisters, Request, WriteRegister
from lfs10d.profiles.profile import BUSY_EXCEPTIONS, Profile
from lfs10d.reading import Fault, FaultCode, Purpose
from lfs10d.system.dataclass import dataclass

BUSY_PAUSE = 0.3
"""Pause in s before a busy slave, or one without the written content yet, is asked again."""
ECHO_READS = 8
"""Most reads to learn whether the adapter echoes; three that agree are enough."""
VERIFY_WITHIN = 5.0
"""Seconds after a write in which the register of a silent slave is read."""
DIFFERING = 3
"""Reads with another content after which the write has failed."""

Steps: TypeAlias = "Generator[Request, Outcome, End]"


@dataclass(frozen=True, slots=True)
class Target:
    """The slave to ask; `profile` is None for one that is not configured, `response_timeout` (s) is None if learned."""

    slave: int
    codec: Codec
    profile: Profile | None = None
    response_timeout: float | None = None

    @property
    def busy_exceptions(self) -> tuple[int, ...]:
        """Exceptions that mean: ask again later."""
        return BUSY_EXCEPTIONS if self.profile is None else self.profile.busy_exceptions

    @property
    def timeouts(self) -> tuple[float, ...]:
        """Time-outs of the tries in s."""
        fixed = self.response_timeout
        return FIRST_TIMEOUTS if fixed is None else (fixed,) * len(FIRST_TIMEOUTS)


class Access:
    """Reads registers or writes one; `what` is the request. `over` is called once, in the line's thread, at its end.

    `end` says how it ended, `registers` what was read last, `fault` what went wrong, `sent` whether a write may have
    left. `before` is what the register held before a write, where it can be read.
    """

    purpose = Purpose.REQUEST
    share = 1.0

    def __init__(
        self,
        target: Target,
        what: Request,
        *,
        pending: PendingRequests,
        echo_known: Callable[[], bool],
        over: Callable[[Access], None],
    ) -> None:
        self.excludes = frozenset({target.slave})
        self.end: End | None = None
        self.registers: tuple[int, ...] | None = None
        self.before: int | None = None
        self.fault: Fault | None = None
        self.sent = False
        self._target = target
        self._pending = pending
        self._echo_known = echo_known
        self._over = over
        self._now = 0.0
        self._timeout = target.timeouts[0]
        self._rest_until = 0.0
        self._shaping = False
        self._steps = self._read(what) if isinstance(what, ReadRegisters) else self._write(what)
        self._following: Request = next(self._steps)

    # -- as a job

    def ask(self, now: float) -> Ask | Hold:
        """Return the next request, or a decision to wait."""
        self._shaping = False
        codec, wanted = self._target.codec, self._following
        if now < self._rest_until:
            return Hold(self._rest_until)
        request = self._pending.next_request(wanted, codec, now, barrier=self._other_shape(), timeout=self._timeout)
        if isinstance(request, float):
            return Hold(request)
        self._shaping = request is not wanted
        self.sent = self.sent or isinstance(request, WriteRegister)
        return Ask(request, codec, self._timeout)

    def on_outcome(self, outcome: Outcome, now: float) -> Next:
        """Take the outcome of the request."""
        self._now = now
        if self._shaping and (outcome.fault is None or _refused(outcome)):
            return Requeue(now)
        try:
            self._following = self._steps.send(outcome)
        except StopIteration as over:
            self._finish(over.value)
            return Done()
        return Requeue(now)

    def cut_off(self, now: float) -> None:
        """Note that the port is lost."""
        del now
        self.fault = None
        self._finish(End.CUT_OFF)

    def _finish(self, end: End) -> None:
        self._steps.close()
        self.end = end
        self._over(self)

    def _other_shape(self) -> ReadRegisters | None:
        """Return a read whose answer cannot be mistaken for a pending one, if the profile has one."""
        profile, slave = self._target.profile, self._target.slave
        if profile is None:
            return None
        places = [(block.address, block.count, block.function) for block in profile.reads()]
        if profile.barrier is not None:
            places.insert(0, (profile.barrier.register, profile.barrier.count, profile.barrier.function))
        reads = (ReadRegisters(slave, *place) for place in places)
        return next((read for read in reads if not self._pending.confusable(read, self._target.codec)), None)

    # -- what is asked, one after the other

    def _read(self, what: ReadRegisters) -> Steps:
        outcome = yield from self._ask_patiently(what)
        return End.DONE if outcome.fault is None else self._failed(outcome)

    def _write(self, what: WriteRegister) -> Steps:
        look = ReadRegisters(what.slave, what.address, 1)
        outcome = yield from self._ask_patiently(look)
        if outcome.fault is None and outcome.answer is not None:
            (self.before,) = outcome.answer
        elif not self._refuses(outcome):
            return self._failed(outcome)
        for _ in range(ECHO_READS):
            if self._echo_known():
                break
            outcome = yield from self._ask_patiently(look)
            if outcome.fault is not None and not self._refuses(outcome):
                return self._failed(outcome)
        else:
            return End.ECHO_UNKNOWN
        outcome = yield from self._ask_once(what, self._target.timeouts[-1])
        if _refused(outcome):
            return self._failed(outcome)
        return (yield from self._read_back(look, what.value))

    def _read_back(self, look: ReadRegisters, value: int) -> Steps:
        deadline = self._now + VERIFY_WITHIN
        differing = 0
        while True:
            outcome = yield from self._ask_patiently(look)
            if outcome.answer == (value,):
                return End.DONE
            differing += outcome.answer is not None
            if differing >= DIFFERING or self._refuses(outcome):
                return End.NOT_VERIFIED
            if self._now >= deadline:
                return self._failed(outcome)
            self._rest_until = self._now + BUSY_PAUSE

    def _ask_patiently(self, what: ReadRegisters) -> Generator[Request, Outcome, Outcome]:
        """Ask until there is an answer, an exception other than busy, or no try is left."""
        *tries, last = self._target.timeouts
        for timeout in tries:
            outcome = yield from self._ask_once(what, timeout)
            if outcome.fault is None or self._refuses(outcome):
                return outcome
        return (yield from self._ask_once(what, last))

    def _ask_once(self, what: Request, timeout: float) -> Generator[Request, Outcome, Outcome]:
        self._timeout = timeout
        outcome = yield what
        fault = outcome.fault
        self.fault = None if fault is None else marked_busy(fault, self._target.busy_exceptions)
        if isinstance(what, ReadRegisters):
            self.registers = outcome.answer
        if _refused(outcome) and not self._refuses(outcome):
            self._rest_until = self._now + BUSY_PAUSE
        return outcome

    def _refuses(self, outcome: Outcome) -> bool:
        """Whether it is an exception that asking again will not change."""
        return _refused(outcome) and self.fault is not None and not self.fault.busy

    def _failed(self, outcome: Outcome) -> End:
        if not _refused(outcome):
            return End.UNANSWERED
        return End.REFUSED if self._refuses(outcome) else End.BUSY


def _refused(outcome: Outcome) -> bool:
    """Whether the slave answered what was asked, and nothing older, with an exception."""
    fault = outcome.fault
    return fault is not None and fault.code is FaultCode.EXCEPTION and not outcome.ambiguous
