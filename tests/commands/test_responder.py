"""Each command is answered where it asked to be, its repeats too, in this life of the daemon and the next."""

from __future__ import annotations

import asyncio
import json
import logging
from collections.abc import Callable, Coroutine
from typing import Any, TypeVar

import pytest

from lfs10d.command import Command, Result, failed, ok
from lfs10d.commands.admission import Admission, Admitted, Answered, CommandSpec, Waiting
from lfs10d.commands.responder import ReplyTo, Responder

SPECS = {"health": CommandSpec("always"), "device/read": CommandSpec("polling")}
HERE = ReplyTo("response/here", b"\x01", "device/read")
THERE = ReplyTo("other/place", None, "device/read")
T = TypeVar("T")


class Broker:
    """What is published and cleared."""

    def __init__(self) -> None:
        self.responses: list[tuple[str, dict[str, Any], bytes | None]] = []
        self.cleared: list[str] = []
        self.responder = Responder(Admission(SPECS, frozenset({"polling"})), self)

    def respond(self, topic: str, payload: dict[str, object], correlation: bytes | None = None) -> None:
        self.responses.append((topic, payload, correlation))

    def clear_retained(self, topic: str) -> None:
        self.cleared.append(topic)

    def admit(self, name: str, reply_to: ReplyTo) -> Admitted[ReplyTo] | Waiting | Answered:
        now = asyncio.get_running_loop().time()
        payload = json.dumps({"id": 7}).encode()
        decision = self.responder.admission.admit(name, payload, retained=False, reply_to=reply_to, now=now)
        assert isinstance(decision, Admitted | Waiting | Answered)
        return decision

    def admitted(self, name: str, reply_to: ReplyTo) -> Admitted[ReplyTo]:
        decision = self.admit(name, reply_to)
        assert isinstance(decision, Admitted)
        return decision

    @property
    def answers(self) -> list[tuple[str, object, object, bytes | None]]:
        return [(topic, payload["id"], payload["status"], data) for topic, payload, data in self.responses]


def playing(play: Callable[[Broker], Coroutine[None, None, T]]) -> Broker:
    broker = Broker()
    asyncio.run(play(broker))
    return broker


def levels(caplog: pytest.LogCaptureFixture) -> list[tuple[str, str]]:
    return [(each.levelname, each.getMessage()) for each in caplog.records if each.name.startswith("lfs10d")]


def test_a_response_goes_to_its_place_with_its_correlation_and_how_long_it_took() -> None:
    async def play(broker: Broker) -> None:
        broker.responder.respond(HERE, Command(id="a", transaction="b"), failed("timeout", "no answer"), took=0.0123)
        broker.responder.clear("request/health")

    broker = playing(play)
    assert broker.responses == [
        (
            "response/here",
            {
                "v": 1,
                "id": "a",
                "transaction": "b",
                "request": "device/read",
                "status": "failed",
                "data": None,
                "error": {"code": "timeout", "message": "no answer", "param": None},
                "took_ms": 12.3,
            },
            b"\x01",
        )
    ]
    assert broker.cleared == ["request/health"]


def test_a_command_that_is_done_is_answered_with_the_repeats_that_waited() -> None:
    async def play(broker: Broker) -> None:
        admitted = broker.admitted("device/read", HERE)
        assert isinstance(broker.admit("device/read", THERE), Waiting)
        assert broker.responses == []
        broker.responder.finish(admitted, HERE, ok({"device": "mast"}))
        assert isinstance(broker.admit("device/read", THERE), Answered)

    assert playing(play).answers == [("response/here", 7, "ok", b"\x01"), ("other/place", 7, "ok", None)]


@pytest.mark.parametrize(
    ("name", "result", "level"),
    [
        ("device/read", ok(), "INFO"),
        ("health", ok(), "DEBUG"),
        ("health", failed("internal", "an internal error"), "INFO"),
    ],
)
def test_only_what_is_always_allowed_and_went_well_is_not_logged(
    caplog: pytest.LogCaptureFixture, name: str, result: Result, level: str
) -> None:
    caplog.set_level(logging.DEBUG, "lfs10d")

    async def play(broker: Broker) -> None:
        broker.responder.finish(broker.admitted(name, HERE), HERE, result)

    playing(play)
    ((logged, words),) = levels(caplog)
    assert logged == level
    assert words.startswith(f"request {name} (id 7): {result.status}")


COMMAND = Command(id=7, fingerprint="{}")


def test_a_command_of_an_earlier_life_without_a_result_keeps_its_repeats_waiting(
    caplog: pytest.LogCaptureFixture,
) -> None:
    caplog.set_level(logging.DEBUG, "lfs10d")

    async def play(broker: Broker) -> None:
        broker.responder.recall("device/read", COMMAND, None, forget_in=60)
        assert isinstance(broker.admit("device/read", THERE), Waiting)
        assert broker.responses == []
        broker.responder.recall("device/read", COMMAND, ok(), forget_in=60)

    assert playing(play).answers == [("other/place", 7, "ok", None)]
    assert levels(caplog) == []


@pytest.mark.parametrize(
    ("command", "topic", "correlation"),
    [
        (Command(id=7, fingerprint="{}", topic="my/place", correlation=b"c"), "my/place", b"c"),
        (COMMAND, "response/device/read", None),
    ],
)
def test_a_command_of_an_earlier_life_is_answered_where_it_asked_to_be(
    caplog: pytest.LogCaptureFixture, command: Command, topic: str, correlation: bytes | None
) -> None:
    caplog.set_level(logging.INFO, "lfs10d")

    async def play(broker: Broker) -> None:
        broker.responder.recall("device/read", command, ok(), forget_in=60, respond=True)
        assert isinstance(broker.admit("device/read", HERE), Answered)

    assert playing(play).answers == [(topic, 7, "ok", correlation)]
    assert [level for level, _ in levels(caplog)] == ["INFO"]


def test_a_command_of_an_earlier_life_is_forgotten_after_its_time() -> None:
    async def play(broker: Broker) -> None:
        broker.responder.recall("device/read", COMMAND, ok(), forget_in=0)
        assert isinstance(broker.admit("device/read", HERE), Admitted)

    assert playing(play).responses == []
