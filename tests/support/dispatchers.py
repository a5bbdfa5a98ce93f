"""A dispatcher with handlers of the test, and a record of its responses."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Coroutine
from dataclasses import dataclass, field
from typing import Any, cast

from lfs10d.command import Command, Result, ok
from lfs10d.commands.admission import Admission, CommandSpec
from lfs10d.commands.context import Context, Handler
from lfs10d.commands.dispatcher import Dispatcher
from lfs10d.commands.message import NoParameters, Parameters
from lfs10d.commands.responder import Responder
from lfs10d.mqtt.topics import InboundRequest


class Text(Parameters):
    """Any text."""

    text: str = ""


CONTEXT = cast("Context", object())


@dataclass
class Bench:
    """A service with a few requests; what it answers and clears."""

    answered: list[tuple[str, dict[str, Any], bytes | None]] = field(default_factory=list)
    cleared: list[str] = field(default_factory=list)
    performed: list[str] = field(default_factory=list)
    gate: asyncio.Event = field(default_factory=asyncio.Event)

    def __post_init__(self) -> None:
        handlers = {
            "echo": Handler(CommandSpec("always", Text), self._echo),
            "device/wait": Handler(CommandSpec("polling", Text), self._wait),
            "device/break": Handler(CommandSpec("polling"), self._break),
            "register/read": Handler(CommandSpec("registers"), self._break),
        }
        specs = {name: handler.spec for name, handler in handlers.items()}
        self.responder = Responder(Admission(specs, frozenset({"polling"})), self)
        self.service = Dispatcher(handlers, CONTEXT, self.responder)

    def respond(self, topic: str, payload: dict[str, object], correlation: bytes | None = None) -> None:
        self.answered.append((topic, payload, correlation))

    def clear_retained(self, topic: str) -> None:
        self.cleared.append(topic)

    async def _echo(self, parameters: Text, context: Context, command: Command) -> Result:
        assert context is CONTEXT
        assert command.parameters.get("text", "") == parameters.text
        self.performed.append("echo")
        return ok({"text": parameters.text})

    async def _wait(self, parameters: Text, _: Context, __: Command) -> Result:
        self.performed.append(f"wait {parameters.text}")
        await self.gate.wait()
        return ok({"text": parameters.text})

    async def _break(self, _: NoParameters, context: Context, __: Command) -> Result:
        raise RuntimeError(f"a mistake with {context}")

    def ask(
        self,
        name: str,
        content: object = None,
        *,
        retained: bool = False,
        response_topic: str | None = None,
        correlation: bytes | None = None,
    ) -> None:
        payload = content if isinstance(content, bytes) else json.dumps({} if content is None else content).encode()
        levels = tuple(name.split("/")) if name else ()
        self.service.on_request(
            InboundRequest(f"request/{name}", levels, payload, retained, response_topic, correlation)
        )  # fmt: skip

    async def settle(self) -> None:
        """Let everything that can end come to its end."""
        for _ in range(10):
            await asyncio.sleep(0)

    @property
    def codes(self) -> list[str | None]:
        return [payload["error"] and payload["error"]["code"] for _, payload, _ in self.answered]

    @property
    def topics(self) -> list[str]:
        return [topic for topic, _, _ in self.answered]


def run(scene: Coroutine[None, None, None]) -> None:
    asyncio.run(scene)
