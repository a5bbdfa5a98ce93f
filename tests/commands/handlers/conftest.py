"""The fake of a daemon that is not there: the configuration is real, on a disk in memory, the line is not."""

from __future__ import annotations

import asyncio
import json
from pathlib import Path
from typing import Any

import pytest

from lfs10d.command import Result
from lfs10d.commands.admission import Admission, Admitted, Answered
from lfs10d.commands.handlers.registry import HANDLERS
from tests.support.context import FILE, Ask, Asked, FakeContext


@pytest.fixture
def fake(tmp_path: Path) -> FakeContext:
    file = tmp_path / "lfs10d.yaml"
    file.write_text(FILE)
    return FakeContext(file)


@pytest.fixture
def ask(fake: FakeContext) -> Ask:
    """Return the door with every class allowed."""

    def ask(name: str, payload: str = "{}") -> Result:
        forms = {name: request.spec for name, request in HANDLERS.items()}
        door = Admission[None](forms, frozenset({"polling", "sensors", "registers"}))
        decision = door.admit(name, payload.encode(), retained=False, reply_to=None, now=0.0)
        if isinstance(decision, Answered):
            return decision.result
        assert isinstance(decision, Admitted)
        return asyncio.run(HANDLERS[name].perform(decision.parameters, fake.context, decision.command))

    return ask


@pytest.fixture
def asked(ask: Ask) -> Asked:
    def asked(name: str, /, **parameters: Any) -> tuple[str, Any]:  # noqa: ANN401 - plain data of any shape
        answer = ask(name, json.dumps(parameters))
        json.dumps(answer.data, allow_nan=False)
        error = answer.error()
        return answer.status, answer.data if error is None else (error["code"], error["param"])

    return asked
