"""The powers of a daemon that is not there: the configuration is real, on a disk in memory, the line is not."""

from __future__ import annotations

import asyncio
import json
from pathlib import Path
from typing import Any

import pytest

from lfs10d.command import Result
from lfs10d.commands.admission import Admission, Admitted, Answered
from lfs10d.commands.handlers.registry import REQUESTS
from tests.support.context import FILE, Ask, Asked, FakePowers


@pytest.fixture
def powers(tmp_path: Path) -> FakePowers:
    file = tmp_path / "lfs10d.yaml"
    file.write_text(FILE)
    return FakePowers(file)


@pytest.fixture
def ask(powers: FakePowers) -> Ask:
    """Return the door with every class allowed."""

    def ask(name: str, payload: str = "{}") -> Result:
        forms = {name: request.form for name, request in REQUESTS.items()}
        door = Admission[None](forms, frozenset({"polling", "sensors", "registers"}))
        verdict = door.admit(name, payload.encode(), retained=False, whence=None, now=0.0)
        if isinstance(verdict, Answered):
            return verdict.answer
        assert isinstance(verdict, Admitted)
        return asyncio.run(REQUESTS[name].perform(verdict.parameters, powers, verdict.call))

    return ask


@pytest.fixture
def asked(ask: Ask) -> Asked:
    def asked(name: str, /, **parameters: Any) -> tuple[str, Any]:  # noqa: ANN401 - plain data of any shape
        answer = ask(name, json.dumps(parameters))
        json.dumps(answer.data, allow_nan=False)
        error = answer.error()
        return answer.status, answer.data if error is None else (error["code"], error["param"])

    return asked
