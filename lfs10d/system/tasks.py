"""Background tasks of the asyncio loop; no failure goes unnoticed.

`asyncio.create_task` keeps an exception until somebody asks for it, and a task that nobody holds may be collected.
Every task that is not awaited where it begins is started here.
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable, Coroutine

log = logging.getLogger(__name__)


class BackgroundTasks:
    """Holds the tasks of one owner. A task that raises is logged with its name, then `on_failure()` is called."""

    def __init__(self, on_failure: Callable[[], None] | None = None) -> None:
        self._on_failure = on_failure
        self._tasks: set[asyncio.Task[None]] = set()

    def start(
        self,
        name: str,
        work: Coroutine[object, object, None],
        ended: Callable[[asyncio.Task[None]], None] | None = None,
    ) -> asyncio.Task[None]:
        """Run `work` beside the caller; `ended(task)` is called once it is over, however it ended.

        Call it in the loop's thread.
        """
        task = asyncio.get_running_loop().create_task(work, name=name)
        self._tasks.add(task)
        task.add_done_callback(self._over)
        if ended is not None:
            task.add_done_callback(ended)
        return task

    def cancel_all(self) -> None:
        """Cancel all running tasks without waiting for them."""
        for task in tuple(self._tasks):
            task.cancel()

    def _over(self, task: asyncio.Task[None]) -> None:
        self._tasks.discard(task)
        if task.cancelled() or (error := task.exception()) is None:
            return
        log.error("background task %s failed: an internal error", task.get_name(), exc_info=error)
        if self._on_failure is not None:
            self._on_failure()
