"""An event loop for a verb; SIGINT and SIGTERM cancel its work."""

from __future__ import annotations

import asyncio
import signal
from collections.abc import Coroutine
from typing import Any, Final, TypeVar

ENDING: Final = (signal.SIGINT, signal.SIGTERM)

T = TypeVar("T")


def run(work: Coroutine[Any, Any, T]) -> T:
    """Run `work` to its end and return what it returns.

    SIGINT and SIGTERM cancel it, once; if it ends by that, KeyboardInterrupt is raised. A handler that raised it at
    once would do so between any two steps of the loop, too, and a step lost there is waited for without an end.
    """
    before = {number: signal.getsignal(number) for number in ENDING}
    with asyncio.Runner() as runner:
        loop = runner.get_loop()
        task = loop.create_task(work)

        def interrupted() -> None:
            for number in ENDING:
                loop.remove_signal_handler(number)
                before[number] = signal.SIG_IGN
                signal.signal(number, signal.SIG_IGN)
            task.cancel()

        for number in ENDING:
            loop.add_signal_handler(number, interrupted)
        try:
            return loop.run_until_complete(task)
        except asyncio.CancelledError:
            raise KeyboardInterrupt from None
        finally:
            for number in ENDING:
                loop.remove_signal_handler(number)
                signal.signal(number, before[number])
