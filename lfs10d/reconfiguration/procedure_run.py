"""Runs procedures from the asyncio loop, which does the work that must not be done in the line thread."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator
from typing import Any, Protocol

from lfs10d.line.jobs.job import Job
from lfs10d.line.jobs.procedure import Finished, Procedure, ProcedureClock, Steps
from lfs10d.modbus.pending import PendingRequests


class Wire(Protocol):
    """The methods of the line that changes of sensors use; see `lfs10d.line.line.Line`."""

    @property
    def pending(self) -> PendingRequests:
        """Which requests may still be answered."""

    def echo_known(self) -> bool:
        """Whether it is known how the adapter echoes."""

    def submit(self, job: Job) -> None:
        """Submit a job; its callbacks run in the line's thread."""

    def resume_procedure(self, procedure: Procedure, result: object) -> None:
        """Give a procedure the result that it awaits."""


CHANGE_SHARE = 0.3
"""The share of the line that a change of a sensor takes where it can wait: the others keep 90 % of their polls."""


class ProcedureRun:
    """Runs procedures on the line, one after the other. Used in the thread of the asyncio loop.

    `share` is that of the line which they take, where they do not say; `clock` is theirs.
    """

    def __init__(self, wire: Wire, share: float = CHANGE_SHARE) -> None:
        self.clock = ProcedureClock()
        self.answer: object = None
        """What the procedure gets for what it awaits; None unless it is set in the body of the loop."""
        self.result: Any = None
        """What the last procedure returned, None where the port was lost."""
        self._wire = wire
        self._share = share
        self._loop = asyncio.get_running_loop()
        self._awaited: asyncio.Queue[object] = asyncio.Queue()
        self._procedure: Procedure | None = None

    async def carry_out(self, steps: Steps[Any], **settings: Any) -> AsyncIterator[object]:  # noqa: ANN401 - Procedure's
        """Run a procedure after the one before it; yield each thing that it awaits.

        It goes on when the next is asked for. Its slave ids stay its own after its end, until `resume`.
        """
        self.resume()
        self._procedure = Procedure(steps, self.clock, self._on_await, **{"share": self._share, **settings})
        self._wire.submit(self._procedure)
        while not isinstance(awaited := await self._awaited.get(), Finished):
            self.answer = None
            yield awaited
            self.resume(self.answer)
        self.result = awaited.result

    def _on_await(self, _: Procedure, awaited: object) -> None:
        """Take over an awaited work from the line's thread."""
        with contextlib.suppress(RuntimeError):  # the loop is closed: the daemon is stopping
            self._loop.call_soon_threadsafe(self._awaited.put_nowait, awaited)

    def resume(self, result: object = None) -> None:
        """Give the procedure the result that it awaits; at its end release its slave ids."""
        if self._procedure is not None:
            self._wire.resume_procedure(self._procedure, result)

    def stop(self) -> None:
        """Send no new frame, and release the line."""
        if self._procedure is not None:
            self._procedure.halt()
        self.resume()
