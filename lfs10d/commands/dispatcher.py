"""Obeys requests: admits, performs, and answers each exactly once."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial

from lfs10d.command import Command, Result, failed, rejected
from lfs10d.commands.admission import Admission, Admitted, Answered, Ignored, Waiting
from lfs10d.commands.context import Context, Handler
from lfs10d.commands.message import LARGEST_CORRELATION, response
from lfs10d.mqtt.topics import InboundRequest
from lfs10d.system.logs import escape
from lfs10d.telemetry import command_log

log = logging.getLogger(__name__)

LONGEST_NAME = 64
"""Characters of a request's name that are told back."""
FLOOD_TOLD_EVERY = 60.0
"""How often the log says that there are too many requests, in s."""


@dataclass(frozen=True, slots=True)
class ReplyTo:
    """Where the answer to one request goes: a topic under B, with the request's Correlation Data."""

    topic: str
    correlation: bytes | None
    name: str


class Dispatcher:
    """The requests of one line.

    `respond(topic under B, payload, correlation)` publishes a response, `clear(topic under B)` a retained request's
    end. Built and called in the thread of the asyncio loop.
    """

    def __init__(
        self,
        requests: Mapping[str, Handler],
        powers: Context,
        *,
        allowed: frozenset[str],
        respond: Callable[[str, dict[str, object], bytes | None], None],
        clear: Callable[[str], None],
    ) -> None:
        self._requests = requests
        self._powers = powers
        self._respond = respond
        self._clear = clear
        self._admission = Admission[ReplyTo]({name: request.form for name, request in requests.items()}, allowed)
        self._running: set[asyncio.Task[Result]] = set()
        self._ending = False
        self._flood_told_until = 0.0

    def allow(self, classes: frozenset[str]) -> None:
        """Obey these classes of requests from now on."""
        self._admission.allowed = classes

    def requested(self, request: InboundRequest) -> None:
        """Take a request; its answer comes now or later, once."""
        now = asyncio.get_running_loop().time()
        name = "/".join(request.levels)
        own = f"response/{name}" if name in self._requests else "response/unknown"
        size = len(request.correlation or b"")
        # What is too large is not returned either: a slow broker would have us keep it.
        correlation = request.correlation if size <= LARGEST_CORRELATION else None
        whence = ReplyTo(request.response_topic or own, correlation, name[:LONGEST_NAME])
        verdict = self._admission.admit(
            name, request.payload, retained=request.retained, whence=whence, now=now, correlation=size
        )
        match verdict:
            case Ignored():
                return
            case Answered(call=call, answer=answer, took=took):
                if verdict.clear:
                    self._clear(request.topic)
                self._log_answered(whence.name, verdict, now)
                self._tell(whence, call, answer, took)
            case Waiting():
                log.debug("request %s repeats one that still runs", escape(whence.name))
            case Admitted():
                self._begin(verdict, whence)

    def _begin(self, ticket: Admitted[ReplyTo], whence: ReplyTo) -> None:
        if self._ending:
            self._end(ticket, whence, rejected("cancelled", "the daemon is ending"))
            return
        call = replace(ticket.call, topic=whence.topic, correlation=whence.correlation)
        perform = self._requests[ticket.name].perform(ticket.parameters, self._powers, call)
        task = asyncio.create_task(perform, name=f"request {ticket.name}")
        self._running.add(task)
        task.add_done_callback(partial(self._performed, ticket, whence))

    def _performed(self, ticket: Admitted[ReplyTo], whence: ReplyTo, task: asyncio.Task[Result]) -> None:
        """Answer a request whose task is over, however it ended, begun or not."""
        self._running.discard(task)
        if task.cancelled():
            answer = failed("cancelled", "the daemon is ending")
        elif (mistake := task.exception()) is not None:
            log.error("request %s failed by a mistake of ours", ticket.name, exc_info=mistake)
            answer = failed("internal", "a fault of lfs10d itself; its log says more")
        else:
            answer = task.result()
        self._end(ticket, whence, answer)

    def _end(self, ticket: Admitted[ReplyTo], whence: ReplyTo, answer: Result) -> None:
        repeats = self._admission.done(ticket, answer, asyncio.get_running_loop().time())
        quiet = self._requests[ticket.name].form.klass == "always" and answer.status == "ok"
        level = logging.DEBUG if quiet else logging.INFO
        log.log(level, "%s", command_log.line(ticket.name, ticket.call, answer))
        for call, where in ((ticket.call, whence), *repeats):
            self._tell(where, call, answer, ticket.memory.took)

    def recall(self, name: str, call: Command, answer: Result | None, *, forget_in: float, tell: bool = False) -> None:
        """Remember a request of an earlier life of the daemon for its repeats, for `forget_in` s.

        Without an answer they wait for it. `tell`: the request itself is answered too, where `call` says.
        """
        repeats = self._admission.recall(name, call, answer, asyncio.get_running_loop().time() + forget_in)
        if answer is None:
            return
        if tell:
            log.info("%s", command_log.line(name, call, answer))
            topic = call.topic or f"response/{name}"
            self._tell(ReplyTo(topic, call.correlation, name), call, answer, 0.0)
        for again, where in repeats:
            self._tell(where, again, answer, 0.0)

    def _log_answered(self, name: str, verdict: Answered, now: float) -> None:
        """Log a request that was answered at once; of a flood only that there is one."""
        if not verdict.flood:
            log.info("request %s: %s", escape(name), _in_short(verdict.answer))
        elif now >= self._flood_told_until:
            self._flood_told_until = now + FLOOD_TOLD_EVERY
            log.warning("more requests come in than are obeyed; those beyond are rejected")

    def _tell(self, whence: ReplyTo, call: Command, answer: Result, took: float) -> None:
        self._respond(whence.topic, response(call, whence.name, answer, took * 1000), whence.correlation)

    async def stop(self) -> None:
        """Answer what still runs as cancelled, and what comes from now on."""
        self._ending = True
        for task in self._running:
            task.cancel()
        await asyncio.gather(*self._running, return_exceptions=True)


def _in_short(answer: Result) -> str:
    return f"{answer.status} ({answer.code})" if answer.code else answer.status
