"""Threads beside the asyncio loop: futures settled from another thread, and calls that block.

All are daemon threads. Unlike an executor of the standard library, nothing waits for them at the end of the process:
a disk that hangs must not hold up the end of the daemon.
"""

from __future__ import annotations

import asyncio
import contextlib
import queue
import threading
from collections.abc import Callable, Generator
from functools import partial
from typing import Generic, ParamSpec, TypeVar

P = ParamSpec("P")
T = TypeVar("T")


class ThreadFuture(Generic[T]):
    """A future of the running loop that any thread settles; `await` it in the loop.

    Settling is ignored once it is done or cancelled, and after the loop was closed.
    """

    def __init__(self) -> None:
        self._loop = asyncio.get_running_loop()
        self._future: asyncio.Future[T] = self._loop.create_future()

    def __await__(self) -> Generator[object, None, T]:
        """Return the result, or raise the exception."""
        return self._future.__await__()

    def set_result(self, result: T) -> None:
        """Settle it with a result."""
        self._settle(partial(self._future.set_result, result))

    def set_exception(self, error: BaseException) -> None:
        """Settle it with an exception."""
        self._settle(partial(self._future.set_exception, error))

    def settle_with(self, call: Callable[[], T]) -> None:
        """Call `call()` in this thread; settle with what it returns or raises."""
        try:
            result = call()
        except BaseException as error:  # noqa: BLE001 - the caller's to judge, whatever it is
            self.set_exception(error)
        else:
            self.set_result(result)

    def _settle(self, settle: Callable[[], None]) -> None:
        with contextlib.suppress(RuntimeError):  # the loop is closed: nobody waits any more
            self._loop.call_soon_threadsafe(self._if_pending, settle)

    def _if_pending(self, settle: Callable[[], None]) -> None:
        if not self._future.done():
            settle()


class WorkerThread:
    """Calls functions one after the other in a thread named `name`, which starts with the first call."""

    def __init__(self, name: str) -> None:
        self._name = name
        self._calls: queue.SimpleQueue[Callable[[], None] | None] = queue.SimpleQueue()
        self._thread: threading.Thread | None = None

    async def call(self, function: Callable[P, T], *args: P.args, **kwargs: P.kwargs) -> T:
        """Return what the function returns, or raise what it raises. Cancelling abandons the result, not the call."""
        future: ThreadFuture[T] = ThreadFuture()
        if self._thread is None:
            self._thread = threading.Thread(target=self._run, name=self._name, daemon=True)
            self._thread.start()
        self._calls.put(partial(future.settle_with, partial(function, *args, **kwargs)))
        return await future

    def end(self) -> None:
        """Let the thread end after the pending calls."""
        self._calls.put(None)

    def _run(self) -> None:
        while (perform := self._calls.get()) is not None:
            perform()


async def run_in_thread(call: Callable[[], T], name: str) -> T:
    """Return what `call()` returns or raise what it raises; it runs in a thread of its own called `name`.

    Cancelling abandons the result, not the call.
    """
    future: ThreadFuture[T] = ThreadFuture()
    threading.Thread(target=future.settle_with, args=(call,), name=name, daemon=True).start()
    return await future
