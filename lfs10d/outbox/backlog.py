"""The backlog: samples that are no longer live, in the store and in memory, and their losses. Pure.

The rules (contract, section 3):

1. The backlog is opened 10 s after a connect: subscribers come back later than we do. First what was lost is declared;
   then it goes oldest first, by boot and seq: what lies in the store, then what waits in memory. One device and one
   boot per batch, at most 1000 samples a second, and as many batches under way at a time as `drain` says: one, as long
   as the backlog shrinks. One more goes whenever none has gone for 2 s.
2. What was acknowledged to no purpose (`recent_acks`) goes once more, in its place by seq.
3. What waits in memory is handed to the store while the broker is away or too slow (`spill`).
4. Devices whose history the broker refuses are passed over: their samples wait where they are, the others go on.
   So are samples while `telemetry` is False: then only records go.

So everything in the store is older than everything in memory.
"""

from __future__ import annotations

from collections.abc import Container, Iterator
from collections.abc import Set as AbstractSet

from lfs10d.outbox.drain import Drain
from lfs10d.outbox.history import History, QueuedSample
from lfs10d.outbox.items import HistoryBatch, LiveSample, LossNotice, OutboxItem, samples_of
from lfs10d.outbox.losses import Loss, Losses
from lfs10d.outbox.recent_acks import RecentAcks
from lfs10d.outbox.spill import Spill
from lfs10d.outbox.spool import Spool
from lfs10d.system.clock_step import ClockState
from lfs10d.telemetry import publication
from lfs10d.telemetry.wind.record import is_record, source_of

BATCH_MOST = 100
"""Samples in one history batch (contract, section 3)."""

BATCH_BYTES = 8000
"""Bytes of one history batch at most (contract, section 3)."""

SAMPLE_EVERY = 0.001
"""Seconds from one history batch to the next, per sample of the first: the bounded rate, 1000 samples a second."""

AT_ONCE = 1.0
"""Seconds of that rate which may go at once where several batches may be under way: there is room for them at once."""

TURN_EVERY = 2.0
"""Seconds after which one more batch goes though others are under way (contract, section 3)."""

HISTORY_AFTER = 10.0
"""Seconds after a connect at which the backlog is opened (contract, section 3)."""


class Backlog:
    """The rules above. `detection`: seconds in which a dead connection is noticed at the latest.

    `history_wait`: seconds from a connect to the first history.
    """

    def __init__(self, *, capacity: int, detection: float, history_wait: float = HISTORY_AFTER) -> None:
        self.telemetry = True
        """Whether samples of polls are sent; otherwise they stay, and only records are sent."""
        self._history_wait = history_wait
        self._open_from = 0.0
        self._batch_at = 0.0
        self._batch_most = BATCH_MOST
        self._limit, self._limit_until = BATCH_MOST, float("-inf")
        self._window = 1
        self._turn_at = 0.0
        self._under_way: dict[HistoryBatch | LossNotice, None] = {}
        self.recent = RecentAcks(capacity=capacity, detection=detection)
        """What was acknowledged lately."""
        self.history = History()
        """The samples in memory."""
        self.spill = Spill(self.history, self.recent, capacity)
        """Decides what is written to the store."""
        self.spool = Spool()
        """The samples in the store."""
        self.losses = Losses()
        """The lost samples."""
        self.drain = Drain()
        """The part of the window for the backlog."""

    # The connection

    def connected(self, now: float, window: int) -> None:
        """Note that the broker is there, and takes `window` messages at once."""
        self.spill.away = False
        self._open_from = self._batch_at = now + self._history_wait
        self._turn_at = self._open_from + TURN_EVERY
        self._window = window
        self.drain.begin(self._open_from)
        self._batch_most = self._limit if now < self._limit_until else BATCH_MOST
        self.losses.connected()

    def lost(self, now: float) -> None:
        """Note that it is gone; what was under way is put back by the outbox."""
        self.spill.lost(now)
        self.recent.lost(now)
        self._under_way.clear()
        self.spool.rewind()

    def on_clean_exit(self) -> None:
        """Note a clean exit from a broker that has acknowledged everything: nothing is sent to it a second time."""
        self.recent.on_clean_exit()
        self.spool.release_all()

    # What goes

    @property
    def waits(self) -> bool:
        """`next` may have something, now or later; False: nothing of it is in memory."""
        recent = self.recent
        waiting = self.history.count or self.spool.page.count or self.losses.waiting
        return bool(waiting or recent.repeat or recent.without_listener)

    def next(self, now: float, refused: AbstractSet[str]) -> HistoryBatch | LossNotice | None:
        """Take what goes next, after `repeat`; None: nothing. Topics that are `refused` are passed over."""
        if now < self._open_from:
            return None
        if publication.EVENT not in refused and not self._notifying:
            loss = self.losses.take(now)
            if loss is not None:
                notice = LossNotice(loss)
                self._under_way[notice] = None
                return notice
        if now < max(self._batch_at, self._free_at):
            return None
        samples = self._take(self._passed_over(refused))
        if not samples:
            return None
        at_once = AT_ONCE if self.drain.level > 1 else 0.0
        self._batch_at = max(self._batch_at, now - at_once) + SAMPLE_EVERY * len(samples)
        self._turn_at = now + TURN_EVERY
        batch = HistoryBatch(samples)
        self._under_way[batch] = None
        waiting = self.history if samples[0].row is None else self.spool.page
        self.drain.taken(full=self.spool.more or batch.samples[0].key in waiting)
        return batch

    @property
    def _notifying(self) -> bool:
        return any(isinstance(each, LossNotice) for each in self._under_way)

    @property
    def _free_at(self) -> float:
        """When the next batch may go for what is under way."""
        return float("-inf") if len(self._under_way) < self.drain.batches(self._window) else self._turn_at

    def _take(self, passed_over: Container[str]) -> tuple[QueuedSample, ...]:
        if self.spool.page:
            samples = self.spool.page.take(self._batch_most, passed_over)
            if samples:
                return samples
            self.spool.leave()
        return () if self.spool.more else self.history.take(self._batch_most, passed_over)

    def _passed_over(self, refused: AbstractSet[str]) -> Container[str]:
        """Return the sources of which nothing is sent now."""
        sources = _sources(refused) if refused else refused
        return sources if self.telemetry else _Refused(sources)

    def lifted(self) -> None:
        """Try again what was passed over: topics are refused no longer."""
        under_way = (queued.row for each in self._under_way for queued in samples_of(each))
        self.spool.read_again(row for row in under_way if row is not None)

    def repeat(self, now: float) -> bool:
        """Once the backlog is open, let what is `recent` by rule 2 wait once more; return True if it does."""
        if now < self._open_from:
            return False
        self.history.extend(self.recent.again())
        return True

    def due(self, refused: AbstractSet[str]) -> float | None:
        """Return when `next` may have something though nothing happens before; None: not by time alone."""
        declared = self.losses.due() if publication.EVENT not in refused and not self._notifying else None
        times = [] if declared is None else [declared]
        in_memory = not self.spool.more and (self.recent.waiting or self.history.waits(self._passed_over(refused)))
        if self.spool.page or in_memory:
            times.append(max(self._batch_at, self._free_at))
        return max(self._open_from, min(times)) if times else None

    # What became of it

    def over(self, item: HistoryBatch | LossNotice) -> None:
        """Note that an item is no longer under way."""
        self._under_way.pop(item, None)

    def on_ack(self, item: OutboxItem, now: float, *, nobody_listens: bool = False) -> None:
        """Note that the broker has it; `nobody_listens`: it said that no subscription matches."""
        without_listener = nobody_listens and now < self._open_from
        if isinstance(item, LiveSample):
            self.recent.add((item.queued,), now, without_listener=without_listener)
        elif isinstance(item, HistoryBatch):
            if self.drain.on_ack(now):
                self.drain.look(now, len(self) + self.spool.depth)
            rows = [queued.row for queued in item.samples if queued.row is not None]
            if rows:
                self.spool.on_ack(rows, now)
            else:
                self.recent.add(item.samples, now, without_listener=without_listener)

    def dead(self, item: OutboxItem) -> None:
        """Note that it will never be delivered."""
        if isinstance(item, LossNotice):
            self.losses.restore(item.loss)
        for queued in samples_of(item):
            if not queued.repeated:
                self.losses.add(queued.sample)
            if queued.row is not None:
                self.spool.release([queued.row])

    def cut(self, batch: HistoryBatch) -> None:
        """Let a batch that is too large wait again, to go in halves, and so those after it on this connection."""
        self._batch_most = len(batch.samples) // 2
        self._batch_at = 0.0
        self.refused(batch)

    def cut_for(self, batch: HistoryBatch, until: float) -> None:
        """Let the batches after this one, which ended its connection, have half as many samples `until` then."""
        self._limit, self._limit_until = len(batch.samples) // 2, until

    def reload(self) -> None:
        """Try batches of any length again."""
        self._limit_until = float("-inf")

    def shorten(self, batch: HistoryBatch, count: int) -> HistoryBatch:
        """Return a batch of its first samples to be under way in its place; the others wait again."""
        self._wait(batch.samples[count:])
        shorter = HistoryBatch(batch.samples[:count])
        self._under_way = {shorter if each is batch else each: None for each in self._under_way}
        self._batch_at -= SAMPLE_EVERY * (len(batch.samples) - count)
        self.drain.taken(full=True)
        return shorter

    def refused(self, item: HistoryBatch | LossNotice) -> None:
        """Let what the broker refused wait again."""
        if isinstance(item, LossNotice):
            self.losses.restore(item.loss)
        else:
            self._wait(item.samples)

    def _wait(self, samples: tuple[QueuedSample, ...]) -> None:
        (self.history if samples[0].row is None else self.spool.page).put_back(samples)

    def put_back(self, item: HistoryBatch | LossNotice) -> None:
        """Let what was under way wait again; what is in the store does so anyway."""
        if isinstance(item, LossNotice):
            self.losses.restore(item.loss)
        else:
            self.history.extend(queued for queued in item.samples if queued.row is None)

    # The store

    def spilled(self, evicted: tuple[Loss, ...], now: float) -> None:
        """Note that the store has what `spill` took, and what it had to evict."""
        self.spill.done(now)
        self.spool.more = True
        self.losses.evicted(evicted)

    @property
    def beyond(self) -> int:
        """The id of the last row that the store may not evict: it is in the page or under way, or one before it is."""
        under_way = any(isinstance(each, HistoryBatch) and each.samples[0].row is not None for each in self._under_way)
        return 0 if self.spool.left and not (self.spool.page or under_way) else self.spool.after

    def page_due(self) -> float | None:
        """Return when the next page of the store is wanted; None: none is."""
        wanted = not self.spill.away and self.spool.more and not self.spool.page
        return self._open_from if wanted else None

    def undeclared(self) -> list[Loss]:
        """Return the losses that are not declared, one under way included."""
        under_way = [each.loss for each in self._under_way if isinstance(each, LossNotice)]
        return under_way + self.losses.undeclared()

    def correct(self, shift: int, clock: ClockState = "synced") -> None:
        """Give what waits the time that the clock tells now, as `QueuedSample.at` does."""
        self.history.correct(shift, clock)
        self.spool.page.correct(shift, clock)
        self.spill.correct(shift, clock)

    # How much

    def __len__(self) -> int:
        """Count the samples that wait in memory alone."""
        return len(self.history) + len(self.spill.samples)

    def waiting(self) -> Iterator[QueuedSample]:
        """Return the oldest of what waits in memory."""
        yield from self.spill.samples[:1]
        oldest = self.history.oldest()
        if oldest is not None:
            yield oldest


class _Refused(frozenset[str]):
    """The sources whose samples are refused, and those of all polls."""

    __slots__ = ()

    def __contains__(self, source: object) -> bool:
        return not is_record(str(source)) or super().__contains__(source)


def _sources(refused: AbstractSet[str]) -> AbstractSet[str]:
    """Return the sources whose history is refused."""
    return {source for topic in refused if (source := source_of(topic)) is not None}
