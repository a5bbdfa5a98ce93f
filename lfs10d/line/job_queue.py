"""The jobs waiting for the line: those without a share first, then those within their share, in turn.

A poll asked for by a request is a job too; it waits while its slave id is another job's.
"""

from __future__ import annotations

from collections.abc import Callable
from math import inf

from lfs10d.line.jobs.job import Account, Hold, Job
from lfs10d.line.jobs.poll import Poll
from lfs10d.line.quota import Quota

JOB_CREDIT = 0.1
"""Line time in s that a job may take ahead of its share, so that time it could not use is not lost."""


class JobQueue:
    """The jobs of one line. `excluded` are the slave ids that belong to one of them for the moment.

    `release_at` is when the first rest of a job is over, inf where none rests until a time.
    """

    def __init__(self) -> None:
        self.excluded: frozenset[int] = frozenset()
        self.release_at = self._wanted_from = inf
        self._waiting: list[Job] = []
        self._held: list[tuple[float, Job]] = []
        self._shares: dict[Job, Account] = {}
        self._excluding: list[Job] = []
        self._slice: Job | None = None

    def submit(self, job: Job, now: float, account: Account | None = None) -> None:
        """Take a new job; with an account the line time it takes goes there, else to a share of its own."""
        if account is not None:
            self._shares[job] = account
        elif job.share < 1:
            self._shares[job] = Quota(job.share, credit=JOB_CREDIT, now=now)
        if job.excludes:
            self._excluding.append(job)
            self.excluded |= job.excludes
        self._waiting.append(job)

    def resume(self, job: Job) -> None:
        """Let a job wait for its next exchange: a poll before all others, other jobs in turn."""
        if isinstance(job, Poll):
            self._waiting.insert(0, job)
        else:
            self._waiting.append(job)

    def continue_slice(self, job: Job) -> None:
        """Let a job have the line next, before all others and whatever its share: its slice goes on."""
        self._waiting.insert(0, job)
        self._slice = job

    def idle(self, now: float) -> bool:
        """Whether no job waits for the line: one that rests does when its rest is over, a poll that rests is late."""
        return not self._waiting and now < self._wanted_from

    def hold(self, job: Job, hold: Hold) -> None:
        """Keep a job that holds."""
        self._rest([*self._held, (inf if hold.until is None else hold.until, job)])

    def _rest(self, held: list[tuple[float, Job]]) -> None:
        self._held = held
        self.release_at = min((until for until, _ in held), default=inf)
        self._wanted_from = -inf if any(isinstance(job, Poll) for _, job in held) else self.release_at

    def released(self, now: float) -> list[Job]:
        """Take the jobs whose hold is over."""
        if now < self.release_at:
            return []
        over = [job for until, job in self._held if until <= now]
        self._rest([entry for entry in self._held if entry[0] > now])
        return over

    def wake(self, job: Job) -> bool:
        """Take `job` if it holds; return whether it did."""
        before = len(self._held)
        self._rest([entry for entry in self._held if entry[1] is not job])
        return len(self._held) < before

    def choose(self, now: float) -> Job | None:
        """Take the job that may use the line now."""
        if not self._waiting:
            return None
        if self._slice is self._waiting[0]:
            self._slice = None
            return self._waiting.pop(0)
        free = [job for job in self._waiting if not (isinstance(job, Poll) and job.device.slave in self.excluded)]
        ready = (job for job in free if job in self._shares and self._shares[job].allows(now))
        chosen = next((job for job in free if job not in self._shares), None) or next(ready, None)
        if chosen is not None:
            self._waiting.remove(chosen)
        return chosen

    def next_at(self, now: float) -> float:
        """When the next job may use the line by time alone; inf if none."""
        wishes = [self._shares[job].ready_at(now) for job in self._waiting if job in self._shares]
        return min([self.release_at, *wishes])

    def spend(self, job: Job, taken: float, now: float) -> None:
        """Note that `job` used the line for `taken` s."""
        if job in self._shares:
            self._shares[job].spend(taken, now)

    def over(self, job: Job) -> None:
        """Forget a job that is over; its slave ids are free again."""
        if self._shares:
            self._shares.pop(job, None)
        if job in self._excluding:
            self._excluding.remove(job)
            self.excluded = frozenset().union(*(other.excludes for other in self._excluding))

    def drop(self, unwanted: Callable[[Job], bool]) -> list[Job]:
        """Remove the unwanted jobs and return them."""
        dropped = [job for job in (*self._waiting, *(held for _, held in self._held)) if unwanted(job)]
        self._waiting = [job for job in self._waiting if job not in dropped]
        self._rest([entry for entry in self._held if entry[1] not in dropped])
        for job in dropped:
            self.over(job)
        return dropped
