"""Reads the identity at one place, so that a late answer to an older request is never taken for the reply. Pure.

Rules
-----
1. The register of the slave id is read. While an older read of that shape may still be answered, a read of the
   values goes first: its answer, having another length, proves that nothing older is to come. Where that is never so,
   for another master asks the slave all the time, it is given up after `BARRIERS` such reads.
2. A slave that must be left alone for the moment is waited for.
3. Echoes of writes prove nothing and are ignored.
4. A slave whose answers have come late gets a long time-out, whichever request they came during.
5. A slave to which a second answer came is asked anything, writes too, only when there was time for another one since
   its last answer: else that is taken for the next one, or destroys it.
"""

from __future__ import annotations

from dataclasses import field, replace
from math import inf

from lfs10d.line.jobs.identification import shortest_answer, strangers
from lfs10d.line.jobs.job import Hold
from lfs10d.line.jobs.procedure import ProcedureClock, Steps
from lfs10d.modbus.ask import Ask
from lfs10d.modbus.frames import Codec
from lfs10d.modbus.outcome import Outcome
from lfs10d.modbus.pending import PendingRequests
from lfs10d.modbus.request import ReadRegisters
from lfs10d.profiles.blocks import Block
from lfs10d.profiles.profile import Profile
from lfs10d.reading import FaultCode
from lfs10d.reconfiguration.journal import Endpoint
from lfs10d.system.dataclass import dataclass

QUICK = 0.2
"""The usual time-out, in s."""
SLOW_FROM = 0.1
"""A sensor that took longer than this (s) gets the time-out `PATIENT` from then on."""
BARRIERS = 4
"""After this many reads of the values the id is not read once more."""
HEARD_WITHIN = 0.05
"""Seconds after its last byte in which an answer to another master may not be recognised yet."""
PATIENT = 1.0
"""Time-out for one that is slow, or must not be missed, in s."""


@dataclass(frozen=True, slots=True)
class IdentityReply:
    """What one place answered.

    `answers`: a right frame of its own, with `register` as the content of its id register, or `exception`. An exception
    that does not end a request (05, 0A, 0B) is no answer: it may be a gateway's, and says nothing of the sensor.
    `noise`: other bytes came. None of these: silence. `words` are the registers of an answered read of values; replies
    are compared without them.
    """

    answers: bool = False
    noise: bool = False
    register: int | None = None
    exception: int | None = None
    words: tuple[int, ...] | None = field(default=None, compare=False)

    @property
    def silent(self) -> bool:
        """Nothing at all was received."""
        return not (self.answers or self.noise) and self.exception is None


SILENCE = IdentityReply()


class IdentityQuery:
    """Reads devices of one profile. `clock` is that of the procedure this is for."""

    def __init__(self, profile: Profile, codec: Codec, pending: PendingRequests, clock: ProcedureClock) -> None:
        if profile.slave_id is None:
            raise ValueError(f"profile {profile.name} defines no register of the slave id")
        self.profile = profile
        self.codec = codec
        self.clock = clock
        self.timeout = QUICK
        self.id_register = profile.slave_id.register
        self._pending = pending
        self._answered: dict[int, float] = {}
        """When each slave answered last, in s."""

    def read_register(
        self, endpoint: Endpoint, timeout: float | None = None, *, register: int | None = None
    ) -> Steps[IdentityReply]:
        """Read the id register at a place, or another one."""
        identity = ReadRegisters(endpoint.slave, self.id_register if register is None else register, 1)
        allowed = yield from self._allowed(identity, endpoint, timeout)
        if allowed is not None:
            return allowed
        return self._reply((yield from self.put(self._ask(identity, endpoint, timeout))))

    @property
    def patience(self) -> tuple[float | None, ...]:
        """The time-outs of tries that follow each other, each longer than the one before."""
        return None, 2 * self.timeout, PATIENT

    def read_patiently(self, endpoint: Endpoint, *, register: int | None = None) -> Steps[IdentityReply]:
        """Read the id register at a place, or another one, until it answers or was tried with all `patience`."""
        reply = SILENCE
        for timeout in self.patience:
            reply = yield from self.read_register(endpoint, timeout, register=register)
            if reply.answers:
                break
        return reply

    def knowing(self, baudrate: int, code: int | None) -> IdentityQuery:
        """Return the same with the content of the rate's register for a rate that the profile has no code for.

        A sensor that came at such a rate can so be brought back to it.
        """
        register = self.profile.baudrate
        if register is None or code is None or baudrate in register.codes:
            return self
        known = register.model_copy(update={"codes": {**register.codes, baudrate: code}})
        profile = self.profile.model_copy(update={"baudrate": known})
        return IdentityQuery(profile, self.codec, self._pending, self.clock)

    def read_values(
        self, endpoint: Endpoint, timeout: float | None = None, *, block: Block | None = None
    ) -> Steps[IdentityReply]:
        """Read the values at a place, whatever they are (the first `block` of the profile, or this one).

        A late answer to an older such read counts.
        """
        until = self._pending.left_alone_until(endpoint.slave, self.clock.now)
        if until is not None:
            yield Hold(until)
        asked = self._ask(self._values_of(endpoint, block), endpoint, timeout)
        return self._reply((yield from self.put(asked)), values=True)

    def put(self, ask: Ask) -> Steps[Outcome]:
        """Ask a slave; wait before where a second answer may follow its last one."""
        slave, duplicates = ask.request.slave, self._pending.duplicates
        until = self._answered.get(slave, -inf) + duplicates.watched(slave)
        if duplicates.extras(slave) and until > self.clock.now:
            yield Hold(until)
        outcome: Outcome = yield ask
        if outcome.answered:
            self._answered[slave] = outcome.ended
        return outcome

    def answered_twice(self, endpoint: Endpoint) -> bool:
        """Whether a second answer came to requests to this slave id: see `lfs10d.modbus.duplicates`."""
        return self._pending.duplicates.known(endpoint.slave)

    def listen(self, silent: Endpoint, timeout: float, before: int) -> Steps[tuple[IdentityReply, bool]]:
        """Read a place that is expected to be silent right after another read; return what was received.

        The second says that a right frame of slave `before` came which answers no older request to it: another device
        of that id, or a repeater.
        """
        asked = replace(self._ask(self._values_of(silent), silent, timeout), at_once=True)
        outcome: Outcome = yield asked
        late = {late.request.slave for late in outcome.late}
        extra = before in strangers(outcome, self.codec) - late
        return self._reply(outcome, values=True), extra

    def settle(self, endpoint: Endpoint) -> Steps[bool]:
        """Read until no answer to an older request can come from a place; whether that could be reached."""
        for _ in range(8):
            if not self._pending.earlier(endpoint.slave):
                return True
            until = self._pending.left_alone_until(endpoint.slave, self.clock.now)
            if until is None:
                reply = yield from self.read_register(endpoint, PATIENT)
                if not reply.answers:
                    reply = yield from self.read_values(endpoint, PATIENT)
                self._pending.lingering_until(self._values_of(endpoint), self.codec, self.clock.now)
                if not self._pending.earlier(endpoint.slave):
                    return True
                until = self.clock.now + 0.25
            yield Hold(until)
        return not self._pending.earlier(endpoint.slave)

    def _values_of(self, endpoint: Endpoint, block: Block | None = None) -> ReadRegisters:
        block = block or self.profile.reads()[0]
        return ReadRegisters(endpoint.slave, block.address, block.count, block.function)

    def _ask(self, request: ReadRegisters, endpoint: Endpoint, timeout: float | None) -> Ask:
        waits = self.timeout if timeout is None else timeout
        if endpoint.slave in self._pending.tardy:
            waits = max(waits, PATIENT)
        return Ask(request, self.codec, waits, None, endpoint.baudrate, request_gap=self.profile.request_gap)

    def _allowed(
        self, request: ReadRegisters, endpoint: Endpoint, timeout: float | None
    ) -> Steps[IdentityReply | None]:
        """Wait, and read what must go before `request`; return the reply that came in place of an answer, if any."""
        other = self._values_of(endpoint)
        barrier = other if self.codec.shapes(other)[0] != self.codec.shapes(request)[0] else None
        barriers, waited = 0, False
        while barriers < BARRIERS:
            allowed = self._pending.next_request(
                request, self.codec, self.clock.now, barrier=barrier, timeout=self.timeout
            )
            if allowed is request:
                return None
            if isinstance(allowed, float):
                yield Hold(allowed)
                continue
            if barriers and not waited:
                waited = True
                yield Hold(self.clock.now + HEARD_WITHIN)
                continue
            waited = False
            reply = self._reply((yield from self.put(self._ask(other, endpoint, timeout))), values=True)
            if not reply.answers:
                return reply
            barriers += 1
        return IdentityReply(noise=True)

    def _reply(self, outcome: Outcome, *, values: bool = False) -> IdentityReply:
        if outcome.turnaround is not None and outcome.turnaround > SLOW_FROM:
            self.timeout = PATIENT
        if any(late.request.slave == outcome.request.slave for late in outcome.late):
            self.timeout = PATIENT
        fault = outcome.fault
        if fault is None and outcome.answer is not None:
            extra = outcome.unsolicited >= shortest_answer(self.codec)
            if values:
                return IdentityReply(answers=True, noise=extra, words=outcome.answer)
            return IdentityReply(answers=True, noise=extra, register=outcome.answer[0])
        if fault is not None and fault.code is FaultCode.EXCEPTION and not outcome.ambiguous:
            return IdentityReply(answers=not outcome.may_follow, exception=fault.exception_code)
        return IdentityReply(noise=not quiet(outcome))


def quiet(outcome: Outcome) -> bool:
    """Whether nothing was received but our own echo, and late answers of others."""
    fault = outcome.fault
    if fault is None or outcome.unsolicited:
        return False
    if fault.code is FaultCode.LATE:
        return all(late.request.slave != outcome.request.slave for late in outcome.late)
    return fault.code is FaultCode.TIMEOUT
