"""Carries out requests: each is admitted, handled and answered exactly once."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Mapping
from dataclasses import replace
from functools import partial

from lfs10d.command import Result, failed, rejected
from lfs10d.commands.admission import Admitted, Answered, Waiting
from lfs10d.commands.context import Context, Handler
from lfs10d.commands.message import LARGEST_CORRELATION
from lfs10d.commands.responder import ReplyTo, Responder
from lfs10d.mqtt.topics import InboundRequest
from lfs10d.system.logs import escape

log = logging.getLogger(__name__)

LONGEST_NAME = 64
"""Longest name of a request that is returned, in characters."""
FLOOD_LOGGED_EVERY = 60.0
"""Seconds between two log lines about too many requests."""


class Dispatcher:
    """Routes the requests of one line to their handlers. Built and called in the thread of the asyncio loop."""

    def __init__(self, handlers: Mapping[str, Handler], context: Context, responder: Responder) -> None:
        self._handlers = handlers
        self._context = context
        self._responder = responder
        self._running: set[asyncio.Task[Result]] = set()
        self._ending = False
        self._flood_logged_until = 0.0

    def allow(self, classes: frozenset[str]) -> None:
        """Admit these classes of requests from now on."""
        self._responder.admission.allowed = classes

    def on_request(self, request: InboundRequest) -> None:
        """Take a request; it is answered exactly once, now or later."""
        now = asyncio.get_running_loop().time()
        name = "/".join(request.levels)
        own = f"response/{name}" if name in self._handlers else "response/unknown"
        size = len(request.correlation or b"")
        # What is too large is not returned either: a slow broker would have us keep it.
        correlation = request.correlation if size <= LARGEST_CORRELATION else None
        reply_to = ReplyTo(request.response_topic or own, correlation, name[:LONGEST_NAME])
        decision = self._responder.admission.admit(
            name, request.payload, retained=request.retained, reply_to=reply_to, now=now, correlation=size
        )
        match decision:
            case None:
                return
            case Answered(command=command, result=result, took=took):
                if decision.clear:
                    self._responder.clear(request.topic)
                self._log_answered(reply_to.name, decision, now)
                self._responder.respond(reply_to, command, result, took)
            case Waiting():
                log.debug("request %s repeats one under way", escape(reply_to.name))
            case Admitted():
                self._begin(decision, reply_to)

    def _begin(self, admitted: Admitted[ReplyTo], reply_to: ReplyTo) -> None:
        if self._ending:
            self._responder.finish(admitted, reply_to, rejected("cancelled", "the daemon is ending"))
            return
        command = replace(admitted.command, topic=reply_to.topic, correlation=reply_to.correlation)
        work = self._handlers[admitted.name].perform(admitted.parameters, self._context, command)
        task = asyncio.create_task(work, name=f"request {admitted.name}")
        self._running.add(task)
        task.add_done_callback(partial(self._on_end, admitted, reply_to))

    def _on_end(self, admitted: Admitted[ReplyTo], reply_to: ReplyTo, task: asyncio.Task[Result]) -> None:
        """Answer a request whose task is over, also if it failed or never began."""
        self._running.discard(task)
        if task.cancelled():
            result = failed("cancelled", "the daemon is ending")
        elif (error := task.exception()) is not None:
            log.error("request %s failed: an internal error", admitted.name, exc_info=error)
            result = failed("internal", "an internal error of lfs10d; its log has the details")
        else:
            result = task.result()
        self._responder.finish(admitted, reply_to, result)

    def _log_answered(self, name: str, decision: Answered, now: float) -> None:
        """Log a request that was answered at once; of a flood only one line."""
        if not decision.flood:
            result = decision.result
            status = f"{result.status} ({result.code})" if result.code else result.status
            log.info("request %s: %s", escape(name), status)
        elif now >= self._flood_logged_until:
            self._flood_logged_until = now + FLOOD_LOGGED_EVERY
            log.warning("too many requests: those beyond the allowed rate are rejected")

    async def stop(self) -> None:
        """Answer requests under way, and all further ones, with `cancelled`."""
        self._ending = True
        for task in self._running:
            task.cancel()
        await asyncio.gather(*self._running, return_exceptions=True)
