"""Responses: one for each command and each of its repeats, on the topic it asked for. Used in the asyncio loop."""

from __future__ import annotations

import asyncio
import logging
from typing import Protocol

from lfs10d.command import Command, Result
from lfs10d.commands.admission import Admission, Admitted
from lfs10d.commands.message import response
from lfs10d.system.dataclass import dataclass
from lfs10d.telemetry import command_log

log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class ReplyTo:
    """The address of the response to one request: a topic under B, with its Correlation Data."""

    topic: str
    correlation: bytes | None
    name: str


class Responses(Protocol):
    """Publishes responses; see `lfs10d.mqtt.uplink.Uplink`."""

    def respond(self, topic: str, payload: dict[str, object], correlation: bytes | None = None) -> None:
        """Publish a response on a topic under B."""

    def clear_retained(self, topic: str) -> None:
        """Clear a retained request, by its topic under B."""


class Responder:
    """Publishes the results of commands, and lets the admission remember them for repeats."""

    def __init__(self, admission: Admission[ReplyTo], uplink: Responses) -> None:
        self.admission = admission
        self._uplink = uplink

    def respond(self, reply_to: ReplyTo, command: Command, result: Result, took: float = 0.0) -> None:
        """Publish the response to a command, which took `took` seconds."""
        payload = response(command, reply_to.name, result, took * 1000)
        self._uplink.respond(reply_to.topic, payload, reply_to.correlation)

    def clear(self, topic: str) -> None:
        """Clear a retained request, by its topic under B."""
        self._uplink.clear_retained(topic)

    def finish(self, admitted: Admitted[ReplyTo], reply_to: ReplyTo, result: Result) -> None:
        """Respond to a command that was carried out, and to its repeats; log it."""
        repeats = self.admission.done(admitted, result, asyncio.get_running_loop().time())
        quiet = self.admission.specs[admitted.name].klass == "always" and result.status == "ok"
        level = logging.DEBUG if quiet else logging.INFO
        log.log(level, "%s", command_log.line(admitted.name, admitted.command, result))
        for command, where in ((admitted.command, reply_to), *repeats):
            self.respond(where, command, result, admitted.memory.took)

    def recall(
        self, name: str, command: Command, result: Result | None, *, forget_in: float, respond: bool = False
    ) -> None:
        """Remember a command of an earlier run of the daemon for its repeats, for `forget_in` s.

        Without a result they wait for it. With `respond` the command itself is answered too, where it asked to be.
        """
        repeats = self.admission.recall(name, command, result, asyncio.get_running_loop().time() + forget_in)
        if result is None:
            return
        if respond:
            log.info("%s", command_log.line(name, command, result))
            topic = command.topic or f"response/{name}"
            self.respond(ReplyTo(topic, command.correlation, name), command, result)
        for again, where in repeats:
            self.respond(where, again, result)
