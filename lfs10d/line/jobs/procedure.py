"""A procedure: a job whose requests follow from the answers, written as one generator. Pure.

Its generator yields `Ask` and is sent the outcome; yields `Hold(until)` to rest; yields `Await(...)` to have something
done off the line (an intent put on the disk) and is sent what `resume` brings, while others have the line. What it
returns goes there too: the job is over only when that has been taken care of, so that its slave ids stay its own
until the configuration says who has them. Where the port is lost `LineLostError` is thrown into it.
"""

from __future__ import annotations

from collections.abc import Callable, Generator
from math import inf
from typing import Any, TypeAlias, TypeVar

from lfs10d.line.jobs.job import Continue, Done, Hold, Next, Requeue
from lfs10d.modbus.ask import Ask
from lfs10d.modbus.outcome import Outcome
from lfs10d.reading import Purpose
from lfs10d.system.dataclass import dataclass

SLICE = 0.25
"""The longest stay at another rate than the line's, in s; one question may take longer."""


class LineLostError(Exception):
    """The port is lost in the middle of a procedure."""


@dataclass(frozen=True, slots=True)
class Await:
    """Work to be done off the line; the procedure goes on after it."""

    what: object


@dataclass(frozen=True, slots=True)
class Finished:
    """The procedure is over: `result` is its return value, None if the port was lost before."""

    result: Any


R = TypeVar("R")
Step: TypeAlias = Ask | Hold | Await
Steps: TypeAlias = Generator[Step, Any, R]
"""Steps that return an `R`; each `Ask` is sent its outcome, each `Await` its result."""


class ProcedureClock:
    """The time at which a procedure goes on."""

    def __init__(self) -> None:
        self.now = 0.0


class Procedure:
    """The job. `on_await(procedure, what)` is called with what to do off the line, and in the end with `Finished`.

    It is called once for each, in the line's thread, and is answered with `resume` and a wake. `line_rate` is the
    line's own rate.
    """

    def __init__(
        self,
        steps: Steps[Any],
        clock: ProcedureClock,
        on_await: Callable[[Procedure, object], None],
        *,
        line_rate: int,
        excludes: frozenset[int] = frozenset(),
        share: float = 0.3,
        purpose: Purpose = Purpose.CHANGE,
    ) -> None:
        self.excludes = excludes
        self.share = share
        self.purpose = purpose
        self._steps = steps
        self._clock = clock
        self._on_await = on_await
        self._line_rate = line_rate
        self._following: Step | None = None
        self._begun = self._told = self._over = False
        self._answer: tuple[Any] | None = None
        self._result: Any = None
        self._slice_until = -inf

    def halt(self) -> None:
        """Send no new frame from now on, and report nothing; callable from any thread."""
        self._over = True

    def resume(self, answer: object = None) -> None:
        """Take the result of the work off the line; the scheduler must then wake the job."""
        self._answer = (answer,)

    # -- as a job

    def ask(self, now: float) -> Ask | Hold | Done:
        """Return the next request, or a decision to wait."""
        self._clock.now = now
        if not self._begun:
            self._begun = True
            self._advance(None)
        while not self._over:
            step = self._following
            if isinstance(step, Ask):
                if now >= self._slice_until:
                    self._slice_until = now + SLICE
                return step
            if isinstance(step, Hold):
                if step.until is None or step.until > now:
                    return step
                self._advance(None)
            elif self._answer is None:
                self._announce()
                if self._answer is None:
                    return Hold()
            else:
                (answer,), self._answer = self._answer, None
                self._told = False
                if step is None:
                    self._over = True
                else:
                    self._advance(answer)
        return Done()

    def _announce(self) -> None:
        if not self._told:
            self._told = True
            step = self._following
            if isinstance(step, Await):
                self._on_await(self, step.what)
            else:
                self._on_await(self, Finished(self._result))

    def _advance(self, value: object) -> None:
        try:
            self._following = self._steps.send(value)
        except StopIteration as end:
            self._following, self._result = None, end.value

    def on_outcome(self, outcome: Outcome, now: float) -> Next:
        """Take the outcome of the request."""
        self._clock.now = now
        asked = self._following
        if self._over or not isinstance(asked, Ask):
            return Done()
        self._advance(outcome)
        following = self._following
        if isinstance(following, Ask):
            if following.at_once:
                return Continue()
            stays = following.baudrate == asked.baudrate not in (None, self._line_rate)
            if stays and now + following.timeout <= self._slice_until:
                return Continue()
        self._slice_until = -inf
        return Requeue(now)

    def cut_off(self, now: float) -> None:
        """Note that the port is lost: the procedure says what that makes of it."""
        self._clock.now = now
        if self._over or (self._begun and self._following is None):
            return
        self._over = True
        if not self._begun:
            self._begun = True
            self._advance(None)
        try:
            self._steps.throw(LineLostError())
        except StopIteration as end:
            self._on_await(self, Finished(end.value))
        except LineLostError:
            self._on_await(self, Finished(None))
