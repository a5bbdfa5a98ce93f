"""The powers of a daemon that is not there."""

from __future__ import annotations

import asyncio
from typing import TYPE_CHECKING, Protocol

import pytest

from lfs10d.admission import Admission, Answered, Ticket
from lfs10d.requests.table import REQUESTS

if TYPE_CHECKING:
    from lfs10d.commands import Answer
    from lfs10d.inquiries import Inquiry


class FakePowers:
    """Answers as told beforehand and notes what was done."""

    def __init__(self) -> None:
        self.done: list[object] = []
        self.inquiry: Inquiry | None = None
        self.running: tuple[str, ...] = ()
        self.broken: Exception | None = None

    def health(self) -> dict[str, object]:
        return {"v": 1}

    def republish(self) -> int:
        self.done.append("republish")
        return 17

    def configuration(self) -> dict[str, object]:
        return {"config": {}, "origins": {}}

    async def reload(self) -> dict[str, list[str]]:
        self.done.append("reload")
        if self.broken is not None:
            raise self.broken
        return {"applied": ["poll.interval"], "restart_required": []}

    def devices(self) -> tuple[str, ...]:
        return ("mast-top", "slave-3")

    async def read(self, device: str) -> Inquiry | None:
        self.done.append(f"read {device}")
        return self.inquiry

    def trace(self, duration: float) -> None:
        self.done.append(duration)

    def cancel(self) -> tuple[str, ...]:
        running, self.running = self.running, ()
        return running


class Ask(Protocol):
    """Asks a request by its name with the payload as JSON text, and returns its answer."""

    def __call__(self, name: str, payload: str = "{}") -> Answer:
        """Return the answer of admission, or of the request itself."""


@pytest.fixture
def powers() -> FakePowers:
    return FakePowers()


@pytest.fixture
def ask(powers: FakePowers) -> Ask:
    """Return the door with every class allowed."""

    def ask(name: str, payload: str = "{}") -> Answer:
        forms = {name: request.form for name, request in REQUESTS.items()}
        door = Admission[None](forms, frozenset({"polling", "sensors", "registers"}))
        verdict = door.admit(name, payload.encode(), retained=False, whence=None, now=0.0)
        if isinstance(verdict, Answered):
            return verdict.answer
        assert isinstance(verdict, Ticket)
        return asyncio.run(REQUESTS[name].perform(verdict.parameters, powers, verdict.call))

    return ask
