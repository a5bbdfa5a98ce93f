"""Carries samples between the outbox and the store, one operation at a time: the shell around `Backlog`'s decisions.

The store works in a thread of its own; nothing here blocks. What the store cannot do is tried again every 5 s.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
from collections.abc import Awaitable, Callable
from functools import partial

from lfs10d.outbox.backlog import Backlog
from lfs10d.outbox.outbox import Outbox
from lfs10d.outbox.spill import SPILL_EVERY
from lfs10d.outbox.spool import PAGE_ROWS
from lfs10d.outbox.store.database import Limits
from lfs10d.outbox.store.sample_file import StoreBatch
from lfs10d.outbox.store.store import Store, StoreError
from lfs10d.system.clock_step import ClockState
from lfs10d.system.tasks import BackgroundTasks
from lfs10d.system.threads import WorkerThread
from lfs10d.telemetry import publication
from lfs10d.telemetry.publication import Publication

log = logging.getLogger(__name__)

NOTICED = 0.02
"""Seconds after a sample has become old at which it is looked for."""

FULL_DISK = "samples wait in memory, which has room for 10 000"


class Spooler:
    """`epoch_ms()` is the wall clock; `wake()` is called when there is more to send.

    `on_trouble` is given the reason why the store keeps nothing, and None when it does again; `publish` takes events.
    """

    def __init__(
        self,
        outbox: Outbox,
        store: Store,
        *,
        epoch_ms: Callable[[], int],
        wake: Callable[[], None],
        on_trouble: Callable[[str | None], None],
        publish: Callable[[Publication], None],
    ) -> None:
        self._outbox = outbox
        self._store = store
        self._epoch_ms = epoch_ms
        self._wake = wake
        self._on_trouble = on_trouble
        self._publish = publish
        self._thread = WorkerThread("store")
        self._poked = asyncio.Event()
        self._tasks = BackgroundTasks(self._failed)
        self._task: asyncio.Task[None]  # begun at the start
        self._ending = False
        self._opened = False
        self._open_at = float("-inf")
        self._trouble: str | None = None
        self._right: tuple[int, ClockState] | None = None
        self._limits: Limits | None = None
        self._changed_at: float | None = None
        self._first_opening = True

    @property
    def _backlog(self) -> Backlog:
        return self._outbox.backlog

    def start(self) -> None:
        """Open the store, and begin."""
        self._task = self._tasks.start("keeping samples on disk", self._run())

    def _failed(self) -> None:
        self._report_trouble(f"nothing is kept on disk until a restart; {FULL_DISK}")

    async def stop(self, within: float) -> None:
        """Keep what waits on disk, in at most `within` seconds; after `start`."""
        self._ending = True
        self.poke()
        try:
            async with asyncio.timeout(within):
                await asyncio.wait([self._task])
                await self._keep_everything()
        except TimeoutError:
            log.warning(
                "the disk is too slow: %d samples that wait for the broker are not kept on disk", self._in_memory
            )
        finally:
            self._thread.end()
            self._task.cancel()

    def poke(self) -> None:
        """Look again what is to be done: something has happened."""
        self._poked.set()

    def correct(self, shift: int, clock: ClockState = "synced") -> None:
        """Give the samples of this boot the time that the clock tells now, as `QueuedSample.at` does."""
        self._right = (shift, clock)
        self.poke()

    def limit(self, limits: Limits) -> None:
        """Take other limits."""
        self._limits = limits
        self.poke()

    @property
    def _in_memory(self) -> int:
        return self._outbox.depth - self._backlog.spool.depth

    def _now(self) -> float:
        return asyncio.get_running_loop().time()

    # What is to be done

    async def _run(self) -> None:
        while not self._ending:
            self._poked.clear()
            self._outbox.age(self._now())
            due, act = self._next()
            if due <= self._now():
                await self._attempt(act)
            else:
                await self._rest(due)

    async def _rest(self, until: float) -> None:
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout_at(until if until < float("inf") else None):
                await self._poked.wait()

    def _next(self) -> tuple[float, Callable[[], Awaitable[None]]]:
        """Return what is to be done next, and when; inf: nothing, unless something happens."""
        never = float("inf")
        if not self._opened:
            return self._open_at, self._open
        if self._limits is not None:
            return float("-inf"), partial(self._take_limits, self._limits)
        if self._right is not None:
            return float("-inf"), partial(self._correct, self._right)
        spill, page, release = self._backlog.spill.due(), self._backlog.page_due(), self._backlog.spool.release_due()
        choices: list[tuple[float, Callable[[], Awaitable[None]]]] = [
            (never if page is None else page, self._take_page),
            (never if release is None else release, self._release),
        ]
        if self._store.open_for_more:
            choices.append((never if spill is None else spill, self._spill))
            old = self._outbox.next_old() if self._backlog.spill.away else None
            choices.append((self._losses_due, self._release))
            if spill is None and old is not None:
                choices.append((max(old + NOTICED, self._now() + NOTICED), self._nothing))
        return min(choices, key=lambda choice: choice[0])

    @property
    def _losses_changed(self) -> bool:
        return tuple(self._backlog.undeclared()) != self._store.losses

    @property
    def _losses_due(self) -> float:
        """When the losses that are not declared yet are to be kept: they have changed for 5 s; inf: they have not."""
        if not self._losses_changed:
            self._changed_at = None
        elif self._changed_at is None:
            self._changed_at = self._now() + SPILL_EVERY
        return float("inf") if self._changed_at is None else self._changed_at

    async def _nothing(self) -> None:
        """Do nothing: to look again is all."""

    async def _attempt(self, act: Callable[[], Awaitable[None]]) -> None:
        try:
            await act()
        except StoreError as error:
            self._opened = False
            self._open_at = self._now() + SPILL_EVERY
            self._report_trouble(f"{error}; {FULL_DISK}")
        self._backlog.spool.update(self._store.rows, self._store.oldest_ts)
        while self._store.reports:
            report = self._store.reports.popleft()
            log.warning("the backlog %s %s; it is put aside as %s", self._store.path, report.reason, report.path.name)
            self._publish(
                publication.event("store_put_aside", self._epoch_ms(), file=report.path.name, reason=report.reason)
            )

    def _report_trouble(self, trouble: str | None) -> None:
        if trouble == self._trouble:
            return
        self._trouble = trouble
        self._on_trouble(trouble)

    def _works(self) -> None:
        """Note that something could be written."""
        if self._trouble is not None:
            log.info("the backlog %s can be written again", self._store.path)
        self._report_trouble(None)

    # How it is done

    async def _open(self) -> None:
        losses = await self._thread.call(self._store.open)
        self._opened = True
        spool = self._backlog.spool
        spool.update(self._store.rows, self._store.oldest_ts)
        if self._first_opening:
            self._first_opening = False
            for loss in losses:
                self._backlog.losses.restore(loss)
            if spool.rows:
                log.info(
                    "%d samples from before the restart are waiting for the broker in %s", spool.rows, self._store.path
                )
        spool.more = spool.rows > 0
        if self._backlog.spill.due() is None:
            self._works()

    async def _take_limits(self, limits: Limits) -> None:
        self._limits = None
        await self._thread.call(self._store.limit, limits)

    async def _correct(self, right: tuple[int, ClockState]) -> None:
        await self._thread.call(self._store.correct, *right)
        if right == self._right:
            self._right = None

    async def _spill(self) -> None:
        spool = self._backlog.spool
        batch = StoreBatch(
            tuple(self._backlog.spill.take()),
            losses=self._backlog.undeclared(),
            now=self._epoch_ms(),
            mono=round(self._now() * 1000),
            beyond=self._backlog.beyond,
            delivered=spool.delivered,
        )
        try:
            evicted = await self._thread.call(self._store.append, batch)
        except StoreError:
            self._outbox.not_spilled(self._now())
            raise
        spool.update(self._store.rows, self._store.oldest_ts)
        self._backlog.spilled(evicted, self._now())
        self._works()
        if evicted:
            log.warning(
                "the backlog on disk has reached store.max_size or store.max_age: the oldest samples are dropped"
            )
        self._wake()

    async def _take_page(self) -> None:
        spool = self._backlog.spool
        turn = spool.turn
        rows = await self._thread.call(self._store.read, spool.after, PAGE_ROWS)
        if turn == spool.turn:
            spool.take_page(rows, PAGE_ROWS)
            if self._right is not None:
                spool.page.correct(*self._right)
            self._wake()

    async def _release(self) -> None:
        rows = self._backlog.spool.releasing(self._now())
        await self._thread.call(self._store.delete, rows, losses=self._backlog.undeclared())
        self._backlog.spool.deleted(rows)
        self._works()

    # The end

    async def _keep_everything(self) -> None:
        """Keep what waits, let go what was acknowledged, close."""
        self._outbox.age(float("inf"))
        try:
            if not self._opened:
                await self._open()
            while self._store.open_for_more and self._backlog.spill.at_last:
                await self._spill()
            while self._backlog.spool.letting_go or self._losses_changed:
                await self._release()
            await self._thread.call(self._store.close)
        except StoreError as error:
            log.warning("%s; %d samples that wait for the broker are not kept on disk", error, self._in_memory)
