"""One course as seen from the asyncio loop: what it wants done off the line, in turn."""

from __future__ import annotations

import asyncio
import contextlib
from typing import Any, Protocol

from lfs10d.line.jobs.job import Job
from lfs10d.line.jobs.procedure import Procedure, ProcedureClock, Steps
from lfs10d.modbus.pending import PendingRequests


class Wire(Protocol):
    """What physical changes need of the line; see `lfs10d.line.line.Line`."""

    @property
    def unanswered(self) -> PendingRequests:
        """Which requests may still be answered."""
        ...

    def echo_known(self) -> bool:
        """Whether it is known how the adapter echoes."""
        ...

    def submit(self, job: Job) -> None:
        """Have a job done; what it calls, it calls in the line's thread."""
        ...

    def go_on(self, course: Procedure, answer: object) -> None:
        """Tell a course what came of what it had done aside."""
        ...


class ProcedureRun:
    """One course as seen from the asyncio loop: what it wants done aside, in turn."""

    def __init__(self, wire: Wire) -> None:
        self.wire = wire
        self._loop = asyncio.get_running_loop()
        self._wanted: asyncio.Queue[object] = asyncio.Queue()
        self._course: Procedure | None = None

    def begin(self, steps: Steps, clock: ProcedureClock, **sides: Any) -> None:  # noqa: ANN401 - the sides of a course
        """Have a course done on the line."""
        self._course = Procedure(steps, clock, self._aside, **sides)
        self.wire.submit(self._course)

    def _aside(self, _: Procedure, what: object) -> None:
        """Take over what is wanted, from the line's thread."""
        with contextlib.suppress(RuntimeError):  # the loop is closed: we are ending
            self._loop.call_soon_threadsafe(self._wanted.put_nowait, what)

    async def wanted(self) -> object:
        """Wait for what is wanted next, `Over` in the end."""
        return await self._wanted.get()

    def go_on(self, answer: object = None) -> None:
        """Answer what was wanted."""
        if self._course is not None:
            self.wire.go_on(self._course, answer)

    def halt(self) -> None:
        """Send no new frame."""
        if self._course is not None:
            self._course.halt()
