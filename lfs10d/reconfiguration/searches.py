"""Searches on the line that go on beside the commands, until they have found something or are ended."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Coroutine, Hashable, Iterable
from functools import partial
from typing import Generic, TypeVar

from lfs10d.reconfiguration.procedure_run import ProcedureRun
from lfs10d.system.tasks import BackgroundTasks

K = TypeVar("K", bound=Hashable)


class Searches(Generic[K]):
    """One search for each key, in a task of its own. Used in the thread of the asyncio loop."""

    def __init__(self, new_run: Callable[[], ProcedureRun]) -> None:
        self._new_run = new_run
        self._tasks = BackgroundTasks()
        self._under_way: dict[K, tuple[ProcedureRun, asyncio.Task[None]]] = {}

    def __contains__(self, key: object) -> bool:
        """Whether this search is under way."""
        return key in self._under_way and not self._under_way[key][1].done()

    def begin(self, key: K, name: str, search: Callable[[ProcedureRun], Coroutine[object, object, None]]) -> None:
        """Begin a search; `name` is its task's."""
        run = self._new_run()
        self._under_way[key] = run, self._tasks.start(name, search(run), partial(self._over, key))

    def _over(self, key: K, task: asyncio.Task[None]) -> None:
        if key in self._under_way and self._under_way[key][1] is task:
            del self._under_way[key]

    def let_end(self, key: K) -> None:
        """Let a search end by itself: it has found what it looked for."""
        self._under_way.pop(key, None)

    def end(self, keys: Iterable[K]) -> None:
        """End these searches: they send no new frame."""
        for key in self._under_way.keys() & set(keys):
            run, task = self._under_way.pop(key)
            run.stop()
            task.cancel()

    def end_all(self, but: Iterable[K] = ()) -> None:
        """End all searches `but` these."""
        self.end(self._under_way.keys() - set(but))
