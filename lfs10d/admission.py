"""Whether a request is obeyed. Pure: time is an argument.

Checked in this order: empty (ignored), retained, too_large, rate_limited, invalid_json, unknown_request,
not_allowed, repeated id, parameters. Whoever performs the request checks `busy`.

A repeated `id` of the same request with the same content gets the first response again and is not executed twice;
while the first runs the repeat waits for its end. With other content it is a `duplicate_conflict`.
"""

from __future__ import annotations

from collections import OrderedDict
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, TypeAlias

from lfs10d import commands
from lfs10d.commands import LARGEST, Answer, Call, Identifier, NoParameters, Parameters, RequestClass, rejected

if TYPE_CHECKING:
    from collections.abc import Mapping

RATE = 20.0
"""Requests a second, in the long run."""
BURST = 64
"""Requests at once."""
REMEMBERED = 256
"""Ids whose responses are kept."""
REMEMBERED_FOR = 60.0
"""How long a response is kept for its repeats, in s."""


@dataclass(frozen=True, slots=True)
class Form:
    """What is known of a request before it is performed: its class, its parameters, how long repeats are told."""

    klass: RequestClass
    parameters: type[Parameters] = NoParameters
    remembered_for: float = REMEMBERED_FOR


@dataclass(frozen=True, slots=True)
class Ignored:
    """Nothing is done and nothing answered."""


@dataclass(frozen=True, slots=True)
class Answered:
    """The answer is known already; `clear`: the request was retained and must be cleared."""

    call: Call
    answer: Answer
    clear: bool = False


@dataclass(slots=True)
class Ticket:
    """An admitted request: perform it and tell `Admission.done`. `repeats` are told the same in the end."""

    name: str
    call: Call
    parameters: Parameters
    repeats: list[object] = field(default_factory=list)
    answer: Answer | None = None
    forget_at: float = 0.0


@dataclass(frozen=True, slots=True)
class Waiting:
    """A repeat of a request that is still running: it joined `ticket.repeats`."""

    ticket: Ticket


Verdict: TypeAlias = Ignored | Answered | Ticket | Waiting


class Admission:
    """`forms` are the requests known, by name; `allowed` the classes obeyed besides `always`."""

    def __init__(self, forms: Mapping[str, Form], allowed: frozenset[str]) -> None:
        self.allowed = allowed
        self._forms = forms
        self._tokens = float(BURST)
        self._filled_at = 0.0
        self._seen: OrderedDict[tuple[str, Identifier], Ticket] = OrderedDict()

    def admit(self, name: str, payload: bytes, *, retained: bool, whence: object, now: float) -> Verdict:
        """Judge a request; `whence` is kept in the ticket of the one it repeats."""
        if not payload:
            return Ignored()
        if retained:
            call = commands.read(payload)[0] if len(payload) <= LARGEST else Call()
            message = "a retained request is never executed; publish it without the retain flag"
            return Answered(call, rejected("retained", message), clear=True)
        if len(payload) > LARGEST:
            message = f"the payload has {len(payload)} bytes; {LARGEST} are allowed"
            return Answered(Call(), rejected("too_large", message))
        call, unreadable = commands.read(payload)
        if not self._within_rate(now):
            message = f"more than {RATE:g} requests a second; send it again later"
            return Answered(call, rejected("rate_limited", message))
        refusal = self._refusal(name, unreadable)
        if refusal is not None:
            return Answered(call, refusal)
        return self._repeat(name, call, whence, now) or self._new(name, self._forms[name], call)

    def _refusal(self, name: str, unreadable: Answer | None) -> Answer | None:
        """Return why the request is not obeyed, whatever its parameters."""
        if unreadable is not None and unreadable.code == "invalid_json":
            return unreadable
        form = self._forms.get(name)
        if form is None:
            return rejected("unknown_request", f"known are: {', '.join(sorted(self._forms))}")
        if form.klass != "always" and form.klass not in self.allowed:
            message = f"requests of class {form.klass} are not obeyed; add it to `commands` in the configuration"
            return rejected("not_allowed", message)
        return unreadable

    def _within_rate(self, now: float) -> bool:
        self._tokens = min(BURST, self._tokens + (now - self._filled_at) * RATE)
        self._filled_at = now
        if self._tokens < 1:
            return False
        self._tokens -= 1
        return True

    def _repeat(self, name: str, call: Call, whence: object, now: float) -> Answered | Waiting | None:
        if call.key is None:
            return None
        first = self._seen.get((name, call.key))
        if first is None or (first.answer is not None and now >= first.forget_at):
            return None
        if not _same(first.call.parameters, call.parameters):
            message = "this id was used for another request; give every request an id of its own"
            return Answered(call, rejected("duplicate_conflict", message))
        if first.answer is None:
            first.repeats.append(whence)
            return Waiting(first)
        return Answered(call, first.answer)

    def _new(self, name: str, form: Form, call: Call) -> Answered | Ticket:
        parameters = commands.parameters_of(form.parameters, call)
        if isinstance(parameters, Answer):
            return Answered(call, parameters)
        ticket = Ticket(name, call, parameters)
        if call.key is not None:
            self._seen[name, call.key] = ticket
            self._seen.move_to_end((name, call.key))
            self._forget_oldest()
        return ticket

    def _forget_oldest(self) -> None:
        """Keep the last ids; one that still runs is never forgotten."""
        excess = len(self._seen) - REMEMBERED
        for key in [key for key, ticket in self._seen.items() if ticket.answer is not None][: max(excess, 0)]:
            del self._seen[key]

    def done(self, ticket: Ticket, answer: Answer, now: float) -> list[object]:
        """Note how it ended; return whence repeats came that wait for it."""
        ticket.answer = answer
        ticket.forget_at = now + self._forms[ticket.name].remembered_for
        repeats, ticket.repeats = ticket.repeats, []
        return repeats


def _same(one: Mapping[str, Any], other: Mapping[str, Any]) -> bool:
    """Compare as JSON does: 1 is not true, though Python says so."""
    return repr(sorted(one.items())) == repr(sorted(other.items()))
