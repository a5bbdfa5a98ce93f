"""Whether a request is obeyed. Pure: time is an argument.

Rules
-----
1. Checked in this order: empty (ignored), retained, too_large, rate_limited, invalid_json, unknown_request,
   not_allowed, repeated id, parameters. Whoever performs the request checks the rest, `busy` among it.
   All but empty ones count towards the rate.
2. The id of a request that passed `not_allowed` is remembered with its answer, whatever the answer is. Repeated
   with the same parameters it gets that answer again and is not executed twice; while the first still runs the
   repeat waits for its end, up to `WAITING` of them; more are `busy`. With other parameters it is a
   `duplicate_conflict`.
3. What was rejected before that is not remembered: sent again later, it is judged again.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import inf
from typing import Generic, TypeVar

from lfs10d.command import Command, Identifier, RequestClass, Result, rejected
from lfs10d.commands.message import LARGEST, LARGEST_CORRELATION, NoParameters, Parameters, parameters_of, read

RATE = 20.0
"""Requests a second, in the long run."""
BURST = 64
"""Requests at once."""
REMEMBERED = 256
"""Ids that are remembered, those of requests that still run besides."""
REMEMBERED_FOR = 60.0
"""How long an answer is kept for its repeats, in s."""

WAITING = 16
"""Repeats that wait for the end of one request."""

W = TypeVar("W")


@dataclass(frozen=True, slots=True)
class CommandSpec:
    """What is known of a request before it is performed: its class, its parameters, how long repeats are told."""

    klass: RequestClass
    parameters: type[Parameters] = NoParameters
    remembered_for: float = REMEMBERED_FOR


@dataclass(frozen=True, slots=True)
class Ignored:
    """Nothing is done and nothing answered."""


@dataclass(frozen=True, slots=True)
class Answered:
    """The answer is known already, after `took` s; `clear`: the request was retained and must be cleared.

    `flood`: it came beyond the rate.
    """

    call: Command
    answer: Result
    took: float = 0.0
    clear: bool = False
    flood: bool = False


@dataclass(slots=True)
class _Memory(Generic[W]):
    """What is remembered of a request by its id; `repeats` wait for its end."""

    fingerprint: str
    answer: Result | None = None
    took: float = 0.0
    forget_at: float = inf
    repeats: list[tuple[Command, W]] = field(default_factory=list)


@dataclass(frozen=True, slots=True)
class Admitted(Generic[W]):
    """An admitted request, since monotonic `since`: perform it and tell `Admission.done`, once."""

    name: str
    call: Command
    parameters: Parameters
    since: float
    memory: _Memory[W]


@dataclass(frozen=True, slots=True)
class Waiting:
    """A repeat of a request that still runs: `Admission.done` will give it back."""


class Admission(Generic[W]):
    """`forms` are the requests known, by name; `allowed` the classes obeyed besides `always`."""

    def __init__(self, forms: Mapping[str, CommandSpec], allowed: frozenset[str]) -> None:
        self.allowed = allowed
        self._forms = forms
        self._tokens = float(BURST)
        self._filled_at = 0.0
        self._seen: dict[tuple[str, Identifier], _Memory[W]] = {}

    def admit(
        self, name: str, payload: bytes, *, retained: bool, whence: W, now: float, correlation: int = 0
    ) -> Ignored | Answered | Admitted[W] | Waiting:
        """Judge a request; `whence` is kept for `done` if it repeats one that still runs.

        `correlation` is how many bytes its Correlation Data has.
        """
        if not payload:
            return Ignored()
        flood = not self._within_rate(now)
        if retained:
            call = read(payload)[0] if len(payload) <= LARGEST else Command()
            message = "a retained request is never executed; publish it without the retain flag"
            return Answered(call, rejected("retained", message), clear=True, flood=flood)
        call, problem = read(payload) if len(payload) <= LARGEST else (Command(), None)
        if (excess := _too_large(len(payload), correlation)) is not None:
            return Answered(call, rejected("too_large", excess), flood=flood)
        if flood:
            message = f"more than {RATE:g} requests a second; send it again later"
            return Answered(call, rejected("rate_limited", message), flood=True)
        refusal = self._refusal(name, problem)
        if refusal is not None:
            return Answered(call, refusal)
        return self._repeated(name, call, whence, now) or self._new(name, call, problem, now)

    def _refusal(self, name: str, problem: Result | None) -> Result | None:
        """Return why the request is not obeyed, whoever asks it with whatever parameters."""
        if problem is not None and problem.code == "invalid_json":
            return problem
        form = self._forms.get(name)
        if form is None:
            return rejected("unknown_request", f"no such request; known are: {', '.join(sorted(self._forms))}")
        if form.klass != "always" and form.klass not in self.allowed:
            message = f"requests of class {form.klass} are not obeyed; add it to `commands` in the configuration"
            return rejected("not_allowed", message)
        return None

    def _within_rate(self, now: float) -> bool:
        self._tokens = min(BURST, self._tokens + (now - self._filled_at) * RATE)
        self._filled_at = now
        if self._tokens < 1:
            return False
        self._tokens -= 1
        return True

    def _repeated(self, name: str, call: Command, whence: W, now: float) -> Answered | Waiting | None:
        if call.key is None:
            return None
        first = self._seen.get((name, call.key))
        if first is None or now >= first.forget_at:
            return None
        if first.fingerprint != call.fingerprint:
            message = "this id was used for another request; give every request an id of its own"
            return Answered(call, rejected("duplicate_conflict", message))
        if first.answer is None and len(first.repeats) >= WAITING:
            message = f"{WAITING} repeats of this request wait for its end already; its response comes once it is over"
            return Answered(call, rejected("busy", message))
        if first.answer is None:
            first.repeats.append((call, whence))
            return Waiting()
        return Answered(call, first.answer, first.took)

    def _new(self, name: str, call: Command, problem: Result | None, now: float) -> Answered | Admitted[W]:
        form = self._forms[name]
        memory = _Memory[W](call.fingerprint)
        self._remember(name, call, memory)
        parameters = problem or parameters_of(form.parameters, call)
        if isinstance(parameters, Result):
            memory.answer, memory.forget_at = parameters, now + form.remembered_for
            return Answered(call, parameters)
        return Admitted(name, call, parameters, now, memory)

    def _remember(self, name: str, call: Command, memory: _Memory[W]) -> None:
        """Keep the ids that are to be kept longest; one whose request still runs is never forgotten."""
        if call.key is None:
            return
        self._seen.pop((name, call.key), None)
        over = [key for key, known in self._seen.items() if known.answer is not None]
        over.sort(key=lambda key: self._seen[key].forget_at)
        for key in over[: max(len(over) - REMEMBERED + 1, 0)]:
            del self._seen[key]
        self._seen[name, call.key] = memory

    def recall(self, name: str, call: Command, answer: Result | None, forget_at: float) -> list[tuple[Command, W]]:
        """Remember a request of an earlier life of the daemon, None while its answer is still to come.

        Returns the repeats that waited for the answer, with their `whence`.
        """
        key = call.key
        if key is None:
            return []
        memory = self._seen.setdefault((name, key), _Memory[W](call.fingerprint))
        memory.answer, memory.forget_at = answer, forget_at
        if answer is None:
            return []
        repeats, memory.repeats = memory.repeats, []
        return repeats

    def done(self, ticket: Admitted[W], answer: Result, now: float) -> list[tuple[Command, W]]:
        """Note how it ended; return the repeats that wait for it, with their `whence`."""
        memory = ticket.memory
        memory.answer, memory.took = answer, now - ticket.since
        memory.forget_at = now + self._forms[ticket.name].remembered_for
        repeats, memory.repeats = memory.repeats, []
        return repeats


def _too_large(payload: int, correlation: int) -> str | None:
    """Return what of a request has more bytes than are allowed, in words; None if nothing has."""
    if payload > LARGEST:
        return f"the payload has more than the {LARGEST} bytes that are allowed"
    if correlation > LARGEST_CORRELATION:
        return f"the Correlation Data has more than the {LARGEST_CORRELATION} bytes that are allowed"
    return None
