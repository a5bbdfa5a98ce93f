"""Admission at a time that is an argument, and requests for it."""

from __future__ import annotations

import json
from typing import Annotated

from lfs10d.command import Result, ok
from lfs10d.commands.admission import (
    BURST,
    Admission,
    Admitted,
    Answered,
    CommandSpec,
    Waiting,
)
from lfs10d.commands.message import Parameters
from lfs10d.schema.fields import Whole

NOW = 1000.0
DAY = 86_400.0


class To(Parameters):
    """The parameters of the one request that has any."""

    to: Annotated[int, Whole(1, 255)]


FORMS = {
    "health": CommandSpec("always"),
    "device/read": CommandSpec("polling", To),
    "device/readdress": CommandSpec("sensors", To, remembered_for=DAY),
    "register/read": CommandSpec("registers"),
}


class Door:
    """An admission with a clock: `tell` is one request at the present `now`."""

    def __init__(self, *allowed: str) -> None:
        self.admission = Admission[str](FORMS, frozenset(allowed or ("polling", "sensors")))
        self.now = NOW

    def tell(
        self, name: str, content: object = None, *, retained: bool = False, reply_to: str = "here"
    ) -> Answered | Admitted[str] | Waiting | None:
        payload = content if isinstance(content, bytes) else json.dumps({} if content is None else content).encode()
        return self.admission.admit(name, payload, retained=retained, reply_to=reply_to, now=self.now)

    def admitted(self, name: str, content: object = None) -> Admitted[str]:
        decision = self.tell(name, content)
        assert isinstance(decision, Admitted)
        return decision

    def answered(self, name: str, content: object = None, *, retained: bool = False) -> Answered:
        decision = self.tell(name, content, retained=retained)
        assert isinstance(decision, Answered)
        return decision

    def code(self, name: str, content: object = None, *, retained: bool = False) -> str | None:
        decision = self.answered(name, content, retained=retained)
        assert decision.result.status == "rejected"
        return decision.result.code

    def done(self, admitted: Admitted[str], answer: Result | None = None) -> list[tuple[object, str]]:
        return [(call.id, reply_to) for call, reply_to in self.admission.done(admitted, answer or ok(), self.now)]

    def flood(self) -> None:
        """Use up the burst."""
        for _ in range(BURST):
            self.tell("health", {})
