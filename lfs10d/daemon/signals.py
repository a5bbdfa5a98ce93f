"""Handles signals and notifies the service manager: SIGTERM and SIGINT end, SIGHUP reloads."""

from __future__ import annotations

import asyncio
import logging
import signal
from collections.abc import Awaitable, Callable

from lfs10d.config.reload import ReloadPlan
from lfs10d.errors import ConfigError
from lfs10d.system.systemd import Notifier
from lfs10d.system.tasks import BackgroundTasks

log = logging.getLogger(__name__)

ENDING = (signal.SIGTERM, signal.SIGINT)


class Signals:
    """`end()` and `reload()` are called by signals; `summary()` is one line for `systemctl status`."""

    def __init__(
        self,
        notifier: Notifier,
        *,
        end: Callable[[], None],
        reload: Callable[[], Awaitable[ReloadPlan]],
        summary: Callable[[], str],
    ) -> None:
        self._notifier = notifier
        self._end = end
        self._reload = reload
        self._summary = summary
        self._ready = False
        self._loop = asyncio.get_running_loop()
        self._tasks = BackgroundTasks()

    def obey(self) -> None:
        """Handle signals from now on."""
        for number in ENDING:
            self._loop.add_signal_handler(number, self._end)
        self._loop.add_signal_handler(signal.SIGHUP, self._hang_up)

    def ready(self) -> None:
        """Notify the service manager, once, that the start is over."""
        if not self._ready:
            self._ready = True
            self._notifier.ready(self._summary())

    def _hang_up(self) -> None:
        self._notifier.reloading()
        self._tasks.start("reload", self._reload_and_tell(), self._reloaded)

    def _reloaded(self, _: asyncio.Task[None]) -> None:
        if self._ready:
            self._notifier.ready(self._summary())

    async def _reload_and_tell(self) -> None:
        try:
            plan = await self._reload()
        except ConfigError as error:
            for problem in error.problems:
                log.error("%s", problem)  # noqa: TRY400 - for a person; where in our code says nothing
            log.error("the configuration is not reloaded: the running one stays")  # noqa: TRY400 - as above
        else:
            log.info("reloaded: %s", ", ".join(plan.applied) or "nothing changed")
            if plan.restart_required:
                log.warning("takes effect at the next restart only: %s", ", ".join(plan.restart_required))


def ignore() -> None:
    """Ignore signals from now on: the daemon is ending already."""
    loop = asyncio.get_running_loop()
    for number in (*ENDING, signal.SIGHUP):
        loop.remove_signal_handler(number)
        signal.signal(number, signal.SIG_IGN)
