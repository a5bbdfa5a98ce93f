"""One request and its answer as a pure state machine. Time is an argument; the shell around it obeys `step`.

::

    state      what happened                                       next state
    ---------  --------------------------------------------------  ----------
    SILENCE    SILENT: the gap has passed without a byte           READY
    SILENCE    BABBLED: the time-out, still no silence            SETTLED
    READY      HEARD: a byte came before the request was written   SILENCE
    READY      SENT: the request was written                       LISTENING
    LISTENING  ANSWERED: a right frame is whole                    SETTLED
    LISTENING  DISPLACED: one is, another master asked for it      SETTLED
    LISTENING  EXPIRED: nothing more is to be expected             SETTLED

Rules
-----
1. A request is preceded by `gap` of silence since the last byte heard or sent, wanted or not. If there is none
   within the time-out, nothing is sent: `collision`.
2. A right frame (check, slave id, function and count, of a write the whole content) settles the exchange the
   moment its last byte is there, whatever noise lies before or behind it.
3. Bytes that equal our request from its first byte on are echo, unless the adapter is known to have none. A write
   then needs echo and answer, for they look the same; an echo that is expected and changed is `collision`.
4. What comes on a paced port before our request can have left the wire is noise, unless echo. On a port without
   pace such a right frame counts if nothing better comes in the usual time.
5. The answer of an `earlier` request is dropped and told as late, and listening goes on. An answer that could be
   that of another earlier request is marked as ambiguous: an exception looks the same for every shape. The late
   answers of other slaves are looked for at the end, in what belongs to nothing.
6. Silence ends the exchange: before the first byte after `timeout`; in a begun answer after t3.5 and the adapter's
   latency (ASCII: 1 s); after other bytes likewise, but not before the slave's usual turnaround; after a right
   frame that is no answer to us not before `timeout`. Pauses in what is received are never judged: adapters make
   them.
7. It always ends: a line that never falls silent is given up after the time-out and the longest answer.
8. The fault names the nearest thing to an answer that came, in this order: a frame with a right check (of the wrong
   count, function, slave), only a late answer, too few bytes, a wrong check; nothing but echo is `timeout`.
9. A right frame is no answer to us if another master was heard asking the same slave after our request, or right
   before it and not answered yet: `collision`; our request counts as not answered. No frame says whom it answers.
10. A broadcast is answered by nobody and is over after `broadcast_delay`.
"""

from __future__ import annotations

from collections.abc import Mapping
from enum import StrEnum
from math import inf
from typing import TypeAlias

from lfs10d.modbus import diagnosis
from lfs10d.modbus.ask import Ask, LineContext
from lfs10d.modbus.diagnosis import Diagnosis
from lfs10d.modbus.frame_search import FoundFrame
from lfs10d.modbus.frames import EXCEPTION_FLAG, Framing
from lfs10d.modbus.outcome import Outcome
from lfs10d.modbus.pending import Pending
from lfs10d.modbus.reception import HEARD_KEPT, Reception
from lfs10d.modbus.request import BROADCAST
from lfs10d.reading import Fault
from lfs10d.system.dataclass import dataclass

ASCII_PAUSE = 1.0
"""Longest pause between two characters of an ASCII frame, s (Modbus over Serial Line V1.02, section 2.5.2.1)."""

FAULT_HEARD = 32
"""Bytes of `Fault.heard`: the last ones received."""


class State(StrEnum):
    """The states of an exchange."""

    SILENCE = "silence"
    READY = "ready"
    LISTENING = "listening"
    SETTLED = "settled"


class Happening(StrEnum):
    """The events of an exchange."""

    SILENT = "silent"
    BABBLED = "babbled"
    HEARD = "heard"
    SENT = "sent"
    ANSWERED = "answered"
    DISPLACED = "displaced"
    EXPIRED = "expired"


TRANSITIONS: Mapping[tuple[State, Happening], State] = {
    (State.SILENCE, Happening.SILENT): State.READY,
    (State.SILENCE, Happening.BABBLED): State.SETTLED,
    (State.READY, Happening.HEARD): State.SILENCE,
    (State.READY, Happening.SENT): State.LISTENING,
    (State.LISTENING, Happening.ANSWERED): State.SETTLED,
    (State.LISTENING, Happening.DISPLACED): State.SETTLED,
    (State.LISTENING, Happening.EXPIRED): State.SETTLED,
}
"""The whole machine; the picture in `docs/` is drawn from it."""


@dataclass(frozen=True, slots=True)
class Quiet:
    """Keep silent: call `step` again at `until`, or after bytes were given to `received`."""

    until: float


@dataclass(frozen=True, slots=True)
class Send:
    """Check once more for bytes; if there are none, write `frame` at once and call `sent`."""

    frame: bytes


@dataclass(frozen=True, slots=True)
class Listen:
    """Give received bytes to `received`; call `step` after that, or at `until`.

    Nothing can be decided on new bytes before `not_before`, so the caller may sleep to it. At `until` what is
    there must be read before `step` is called.
    """

    until: float
    not_before: float


@dataclass(frozen=True, slots=True)
class Settled:
    """The exchange is over."""

    outcome: Outcome


Decision: TypeAlias = Quiet | Send | Listen | Settled


class MisuseError(RuntimeError):
    """The caller reported what cannot have happened; nothing was changed. An internal error."""


class Exchange:
    """One request and its answer. Call `step`, carry out what it returns, report the events, call `step` again.

    `pending` are the requests whose answers may still come, by slave id, each slave's oldest first. `asked` is when the
    line was given to it, `quiet_since` the last byte heard or sent before, wanted or not.
    """

    def __init__(
        self,
        ask: Ask,
        line: LineContext,
        pending: Mapping[int, tuple[Pending, ...]],
        *,
        asked: float,
        quiet_since: float,
    ) -> None:
        timing = line.timing
        self._ask = ask
        self._line = line
        self._asked = asked
        self._quiet_since = quiet_since
        self._state = State.SILENCE
        forms = ask.codec.forms(ask.request)
        self._frame = forms.frame
        self._reception = Reception(ask, line, pending, forms.frame, forms.answers)
        self._answer_size = forms.answers[0].size
        self._answer_takes = timing.transmission(self._answer_size)
        self._gap = timing.gap if line.gap is None else max(timing.gap, line.gap)
        # Silence that was still running when the line was given to us is no babble.
        self._give_up = max(asked + ask.timeout, quiet_since + self._gap)
        self._hush = ASCII_PAUSE if ask.codec.framing is Framing.ASCII else timing.t35 + line.adapter_latency
        self._patience = ask.timeout if ask.patience is None else min(ask.patience, ask.timeout)
        self._began = self._sent_end = quiet_since
        self._measured_gap: float | None = None
        self._outcome: Outcome | None = None

    @property
    def quiet_since(self) -> float:
        """The end of the last byte on the line, received or sent."""
        return self._quiet_since

    def step(self, now: float) -> Decision:
        """Return what to do now. May be called at any time, any number of times."""
        if self._outcome is not None:
            return Settled(self._outcome)
        if self._state is State.LISTENING:
            return self._listen(now)
        silent_at = self._quiet_since + self._gap
        if now >= silent_at:
            if self._state is State.SILENCE:
                self._pass(Happening.SILENT)
            return Send(self._frame)
        if now >= self._give_up:
            self._pass(Happening.BABBLED)
            self._reception.look_elsewhere()
            return self._settle(now, None, diagnosis.babble(self._ask.timeout))
        return Quiet(min(silent_at, self._give_up))

    def sent(self, begun: float, ended: float) -> None:
        """Note that the frame was written: the times just before and just after the one `write`."""
        if ended < begun:
            raise MisuseError("a request cannot have been written before it was begun")
        self._pass(Happening.SENT)
        gap = begun - self._quiet_since
        self._measured_gap = gap if gap < inf else None
        self._began = begun
        # The latest its last bit can leave an adapter that holds nothing back: counted from after the write.
        self._sent_end = ended + self._line.timing.transmission(len(self._frame))
        self._quiet_since = self._sent_end
        self._reception.sent(begun)

    def foreseen(self, data: bytes, now: float) -> Listen | None:
        """Return how to listen on if `data` is plainly the beginning of the answer: it may be kept; else None."""
        if self._state is not State.LISTENING or not self._reception.foreseen(data, now):
            return None
        until = now + self._hush
        return Listen(until, min(self._reception.whole_at, until))

    def received(self, data: bytes, now: float, after: tuple[bytes, float] | None = None) -> None:
        """Take what was read at `now`, in any state, in any pieces; `after` is what was kept before, and when."""
        if not data:
            return
        self._quiet_since = max(self._quiet_since, now)
        if self._state is State.SETTLED:
            return
        if self._state is State.READY:
            self._pass(Happening.HEARD)
        self._reception.take(data, now, after)

    def _pass(self, happening: Happening) -> None:
        try:
            self._state = TRANSITIONS[self._state, happening]
        except KeyError:
            raise MisuseError(f"an exchange in state {self._state} cannot be told {happening}") from None

    # -- listening

    def _listen(self, now: float) -> Decision:
        reception = self._reception
        if reception.answer is not None:
            self._pass(Happening.ANSWERED)
            reception.look_elsewhere()
            return self._settle(reception.answer.last_at, reception.answer, None)
        if reception.displaced is not None:
            self._pass(Happening.DISPLACED)
            reception.look_elsewhere()
            return self._settle(reception.displaced.last_at, None, diagnosis.displaced(self._ask.request.slave))
        first, bound = self._limits()
        until = min(self._until(first), bound)
        if until <= now < first and diagnosis.stranger_spoke(self._ask, reception):
            until = min(first, bound)
        if now >= until:
            self._pass(Happening.EXPIRED)
            reception.look_elsewhere()
            return self._settle(now, reception.spare, diagnosis.judge(self._ask, reception))
        return Listen(until, min(max(now, reception.whole_at), until))

    def _limits(self) -> tuple[float, float]:
        """Return until when the answer may begin, and when even a babbling line is given up.

        A slave answers in order: after its late answer to an earlier request it gets its usual time again.
        """
        ask, line = self._ask, self._line
        if ask.request.slave == BROADCAST:
            over = self._sent_end + line.broadcast_delay
            return over, over
        first = max(self._sent_end + ask.timeout, self._reception.late_at + self._patience)
        if ask.codec.framing is Framing.ASCII and self._reception.begun:
            return first, first + self._answer_size * ASCII_PAUSE
        return first, first + self._answer_takes + self._hush

    def _until(self, first: float) -> float:
        """Return when silence ends the exchange (rule 6)."""
        reception = self._reception
        if self._ask.request.slave == BROADCAST or not reception.heard:
            return first
        hushed = self._quiet_since + self._hush
        if reception.spare is None:
            if not reception.rest:
                return first
            if reception.begun:
                return hushed
        return max(hushed, max(self._sent_end, reception.late_at) + self._patience)

    # -- the end

    def _settle(self, ended: float, frame: FoundFrame | None, found: Diagnosis | None) -> Settled:
        ask, reception = self._ask, self._reception
        sent, unsolicited = reception.sent_yet, reception.unsolicited
        answer: tuple[int, ...] | None = ()
        exception: int | None = None
        if frame is not None:
            answer, found = ask.codec.decode(frame.body), None
            if frame.body[1] & EXCEPTION_FLAG:
                (exception,) = answer
                found = diagnosis.refusal(exception, ask.request)
        fault = None
        if found is not None:
            answer = None
            fault = Fault(found.code, found.message, exception, bytes(reception.heard[-FAULT_HEARD:]))
        self._outcome = Outcome(
            request=ask.request,
            answer=answer,
            fault=fault,
            asked=self._asked,
            began=self._began if sent else None,
            sent_end=self._sent_end if sent else None,
            gap=self._measured_gap,
            ended=ended,
            turnaround=None if frame is None else max(0.0, frame.first_at - self._sent_end),
            rtt=None if frame is None else max(0.0, frame.last_at - self._began),
            answered=sent and reception.displaced is None and (frame is not None or reception.begun),
            late=tuple(reception.late),
            echoed=reception.echoed if sent else None,
            sent=self._frame if sent else b"",
            heard=bytes(reception.heard[-HEARD_KEPT:]),
            unsolicited=unsolicited,
            strays=reception.strays if unsolicited else (),
            quiet_since=self._quiet_since,
            ambiguous=reception.ambiguous,
        )
        return Settled(self._outcome)
