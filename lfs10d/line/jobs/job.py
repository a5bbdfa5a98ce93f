"""The interface of a job: work on the line, one exchange after the other.

A job never touches the line. The scheduler calls `ask` when the line could be the job's, and `on_outcome` with the
outcome of what it asked; between the two and after them others may have had the line. Time is an argument.
"""

from __future__ import annotations

from typing import Protocol, TypeAlias

from lfs10d.modbus.ask import Ask
from lfs10d.modbus.outcome import Outcome
from lfs10d.reading import Purpose
from lfs10d.system.dataclass import dataclass


@dataclass(frozen=True, slots=True)
class Hold:
    """Nothing to ask before `until` (None: before the scheduler is told to `wake` the job)."""

    until: float | None = None


@dataclass(frozen=True, slots=True)
class Done:
    """The job is over."""


@dataclass(frozen=True, slots=True)
class Requeue:
    """More to ask, after all that was due by `key`."""

    key: float


@dataclass(frozen=True, slots=True)
class Continue:
    """More to ask at once, regardless of the share: the slice at another rate goes on.

    A job says so for a quarter of a second at most; the rate is changed per slice, never per exchange.
    """


Next: TypeAlias = Requeue | Continue | Done


class Account(Protocol):
    """Limits a job to its share of the line's time; see `lfs10d.line.quota.Quota`."""

    def allows(self, now: float) -> bool:
        """Whether the line may be used now."""

    def ready_at(self, now: float) -> float:
        """When the line may be used next; not before `now`."""

    def spend(self, taken: float, now: float) -> None:
        """Note that `taken` s of the line were used."""


class Job(Protocol):
    """One piece of work on the line.

    `share` is the greatest part of the line's time it may take, 0 < share <= 1; with 1 it goes before everybody.
    `excludes` are slave ids that nobody else may ask while it runs.
    """

    @property
    def purpose(self) -> Purpose:
        """The purpose of its exchanges."""

    @property
    def share(self) -> float:
        """The greatest share of the line."""

    @property
    def excludes(self) -> frozenset[int]:
        """Slave ids that are its own while it runs."""

    def ask(self, now: float) -> Ask | Hold | Done:
        """Return the next request, or a decision to wait.

        What was decided is not sent yet where the slave must rest first: then the job is asked again after that.
        """

    def on_outcome(self, outcome: Outcome, now: float) -> Next:
        """Take the outcome of the request."""

    def cut_off(self, now: float) -> None:
        """Note that the job ends early: the port is lost, or its device is no longer configured."""
