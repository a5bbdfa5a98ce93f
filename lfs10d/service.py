"""Obeys requests: admits, performs, and answers each exactly once."""

from __future__ import annotations

import asyncio
import logging
from dataclasses import dataclass
from typing import TYPE_CHECKING

from lfs10d.admission import Admission, Answered, Ignored, Ticket, Waiting
from lfs10d.commands import Answer, Call, failed
from lfs10d.logs import escape

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from lfs10d.mqtt.inbound import InboundRequest
    from lfs10d.requests.request import Powers, Request

log = logging.getLogger(__name__)

DEEPEST = 2
"""Levels of the longest name of a request."""
LONGEST_NAME = 64
"""Characters of a request's name that are told back."""


@dataclass(frozen=True, slots=True)
class _Whence:
    """Where the answer to one request goes."""

    topic: str
    correlation: bytes | None
    name: str
    call: Call
    since: float


class Service:
    """The requests of one line.

    `respond(topic under B, payload, correlation)` publishes a response, `clear(topic under B)` a retained request's
    end. Built and called in the thread of the asyncio loop.
    """

    def __init__(
        self,
        requests: Mapping[str, Request],
        powers: Powers,
        *,
        allowed: frozenset[str],
        respond: Callable[[str, dict[str, object], bytes | None], None],
        clear: Callable[[str], None],
    ) -> None:
        self._requests = requests
        self._powers = powers
        self._respond = respond
        self._clear = clear
        self._admission = Admission({name: request.form for name, request in requests.items()}, allowed)
        self._running: set[asyncio.Task[None]] = set()

    def allow(self, classes: frozenset[str]) -> None:
        """Obey these classes of requests from now on."""
        self._admission.allowed = classes

    def requested(self, request: InboundRequest) -> None:
        """Take a request; its answer comes now or later, once."""
        now = asyncio.get_running_loop().time()
        name = "/".join(request.levels)
        known = name in self._requests
        own = f"response/{name}" if known else "response/unknown"
        shown = name[:LONGEST_NAME]
        whence = _Whence(request.response_topic or own, request.correlation, shown, Call(), now)
        verdict = self._admission.admit(name, request.payload, retained=request.retained, whence=whence, now=now)
        match verdict:
            case Ignored():
                return
            case Answered(call=call, answer=answer):
                if verdict.clear:
                    self._clear(request.topic)
                self._tell(whence, call, answer)
            case Waiting(ticket=ticket):
                log.debug("request %s is a repeat of one that still runs", escape(ticket.name))
            case Ticket():
                task = asyncio.create_task(self._perform(verdict, whence), name=f"request {name}")
                self._running.add(task)
                task.add_done_callback(self._running.discard)

    async def _perform(self, ticket: Ticket, whence: _Whence) -> None:
        try:
            answer = await self._requests[ticket.name].perform(ticket.parameters, self._powers)
        except asyncio.CancelledError:
            answer = failed("cancelled", "the daemon is ending")
        except Exception:  # every request is answered, whatever we did wrong
            log.exception("request %s failed by a mistake of ours", ticket.name)
            answer = failed("internal", "a fault of lfs10d itself; its log says more")
        repeats = self._admission.done(ticket, answer, asyncio.get_running_loop().time())
        for each in (whence, *repeats):
            if isinstance(each, _Whence):
                self._tell(each, ticket.call, answer)

    def _tell(self, whence: _Whence, call: Call, answer: Answer) -> None:
        took = asyncio.get_running_loop().time() - whence.since
        log.info("request %s: %s%s", escape(whence.name), answer.status, f" ({answer.code})" if answer.code else "")
        self._respond(whence.topic, call.response(whence.name, answer, took * 1000), whence.correlation)

    async def stop(self) -> None:
        """Answer what still runs as cancelled."""
        for task in self._running:
            task.cancel()
        await asyncio.gather(*self._running, return_exceptions=True)
