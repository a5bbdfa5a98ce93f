"""Admits or rejects a request. Pure: time is an argument.

Rules
-----
1. Checked in this order: empty (ignored), retained, too_large, rate_limited, invalid_json, unknown_request,
   not_allowed, repeated id, parameters. Its handler checks the rest, `busy` among it.
   All but empty ones count towards the rate.
2. The id of a request that passed `not_allowed` is remembered with its result, whatever the result is. Repeated
   with the same parameters it gets that result again and is not executed twice; while the first still runs the
   repeat waits for its end, up to `WAITING` of them; more are `busy`. With other parameters it is a
   `duplicate_conflict`.
3. What was rejected before that is not remembered: sent again later, it is judged again.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field
from math import inf
from typing import Generic, TypeVar

from lfs10d.command import Command, Identifier, RequestClass, Result, rejected
from lfs10d.commands.message import LARGEST, LARGEST_CORRELATION, NoParameters, Parameters, parameters_of, read
from lfs10d.system.dataclass import dataclass

RATE = 20.0
"""Requests a second, in the long run."""
BURST = 64
"""Requests at once."""
REMEMBERED = 256
"""Ids that are remembered, besides those of requests under way."""
REMEMBERED_FOR = 60.0
"""Seconds for which a result is kept for its repeats."""

WAITING = 16
"""Repeats that wait for the end of one request."""

W = TypeVar("W")


@dataclass(frozen=True, slots=True)
class CommandSpec:
    """A kind of request: its class, its parameters, seconds for which its result is remembered."""

    klass: RequestClass
    parameters: type[Parameters] = NoParameters
    remembered_for: float = REMEMBERED_FOR


@dataclass(frozen=True, slots=True)
class Answered:
    """The result is known already, after `took` s; `clear`: the request was retained and must be cleared.

    `flood`: it came beyond the rate.
    """

    command: Command
    result: Result
    took: float = 0.0
    clear: bool = False
    flood: bool = False


@dataclass(slots=True)
class _Memory(Generic[W]):
    """A request remembered by its id; `repeats` wait for its end."""

    fingerprint: str
    result: Result | None = None
    took: float = 0.0
    forget_at: float = inf
    repeats: list[tuple[Command, W]] = field(default_factory=list)

    def settle(self, result: Result | None, forget_at: float) -> list[tuple[Command, W]]:
        """Note the result, and return the repeats that waited for it; while it is None they go on waiting."""
        self.result, self.forget_at = result, forget_at
        if result is None:
            return []
        repeats, self.repeats = self.repeats, []
        return repeats


@dataclass(frozen=True, slots=True)
class Admitted(Generic[W]):
    """A request admitted at monotonic `since`; carry it out, then call `Admission.done` once."""

    name: str
    command: Command
    parameters: Parameters
    since: float
    memory: _Memory[W]


@dataclass(frozen=True, slots=True)
class Waiting:
    """A repeat of a request under way; `Admission.done` of that returns it."""


class Admission(Generic[W]):
    """`specs` are the requests by name; `allowed` the classes admitted besides `always`."""

    def __init__(self, specs: Mapping[str, CommandSpec], allowed: frozenset[str]) -> None:
        self.allowed = allowed
        self.specs = specs
        self._tokens = float(BURST)
        self._filled_at = 0.0
        self._seen: dict[tuple[str, Identifier], _Memory[W]] = {}

    def admit(
        self, name: str, payload: bytes, *, retained: bool, reply_to: W, now: float, correlation: int = 0
    ) -> Answered | Admitted[W] | Waiting | None:
        """Judge a request; None: it is ignored. `reply_to` is kept for `done` if it repeats one that still runs.

        `correlation` is how many bytes its Correlation Data has.
        """
        if not payload:
            return None
        flood = not self._within_rate(now)
        command, problem = read(payload) if len(payload) <= LARGEST else (Command(), None)
        if retained:
            message = "a retained request is never executed; publish it without the retain flag"
            return Answered(command, rejected("retained", message), clear=True, flood=flood)
        if (excess := _too_large(len(payload), correlation)) is not None:
            return Answered(command, rejected("too_large", excess), flood=flood)
        if flood:
            message = f"more than {RATE:g} requests a second; send it again later"
            return Answered(command, rejected("rate_limited", message), flood=True)
        refusal = self._refusal(name, problem)
        if refusal is not None:
            return Answered(command, refusal)
        return self._repeated(name, command, reply_to, now) or self._new(name, command, problem, now)

    def _refusal(self, name: str, problem: Result | None) -> Result | None:
        """Return the rejection that does not depend on the parameters, None if there is none."""
        if problem is not None and problem.code == "invalid_json":
            return problem
        spec = self.specs.get(name)
        if spec is None:
            return rejected("unknown_request", f"no such request; known are: {', '.join(sorted(self.specs))}")
        if spec.klass != "always" and spec.klass not in self.allowed:
            message = f"requests of class {spec.klass} are not accepted; add it to `commands` in the configuration"
            return rejected("not_allowed", message)
        return None

    def _within_rate(self, now: float) -> bool:
        self._tokens = min(BURST, self._tokens + (now - self._filled_at) * RATE)
        self._filled_at = now
        if self._tokens < 1:
            return False
        self._tokens -= 1
        return True

    def _repeated(self, name: str, command: Command, reply_to: W, now: float) -> Answered | Waiting | None:
        if command.key is None:
            return None
        first = self._seen.get((name, command.key))
        if first is None or now >= first.forget_at:
            return None
        if first.fingerprint != command.fingerprint:
            message = "this id was used for another request; give every request an id of its own"
            return Answered(command, rejected("duplicate_conflict", message))
        if first.result is None and len(first.repeats) >= WAITING:
            message = f"{WAITING} repeats of this request are waiting for its end already; its response comes then"
            return Answered(command, rejected("busy", message))
        if first.result is None:
            first.repeats.append((command, reply_to))
            return Waiting()
        return Answered(command, first.result, first.took)

    def _new(self, name: str, command: Command, problem: Result | None, now: float) -> Answered | Admitted[W]:
        spec = self.specs[name]
        memory = _Memory[W](command.fingerprint)
        self._remember(name, command, memory)
        parameters = problem or parameters_of(spec.parameters, command)
        if isinstance(parameters, Result):
            memory.result, memory.forget_at = parameters, now + spec.remembered_for
            return Answered(command, parameters)
        return Admitted(name, command, parameters, now, memory)

    def _remember(self, name: str, command: Command, memory: _Memory[W]) -> None:
        """Remember an id; all with a request under way are kept, of the others the newest."""
        if command.key is None:
            return
        self._seen.pop((name, command.key), None)
        over = [key for key, known in self._seen.items() if known.result is not None]
        over.sort(key=lambda key: self._seen[key].forget_at)
        for key in over[: max(len(over) - REMEMBERED + 1, 0)]:
            del self._seen[key]
        self._seen[name, command.key] = memory

    def recall(self, name: str, command: Command, result: Result | None, forget_at: float) -> list[tuple[Command, W]]:
        """Remember a request of an earlier run of the daemon; its result is None while it is still to come.

        Returns the repeats that waited for the result, with their `reply_to`.
        """
        if command.key is None:
            return []
        memory = self._seen.setdefault((name, command.key), _Memory[W](command.fingerprint))
        return memory.settle(result, forget_at)

    def done(self, admitted: Admitted[W], result: Result, now: float) -> list[tuple[Command, W]]:
        """Note the result; return the repeats that wait for it, with their `reply_to`."""
        admitted.memory.took = now - admitted.since
        return admitted.memory.settle(result, now + self.specs[admitted.name].remembered_for)


def _too_large(payload: int, correlation: int) -> str | None:
    """Return in words what is too large in a request; None if nothing is."""
    if payload > LARGEST:
        return f"the payload has more than the {LARGEST} bytes that are allowed"
    if correlation > LARGEST_CORRELATION:
        return f"the Correlation Data has more than the {LARGEST_CORRELATION} bytes that are allowed"
    return None
