"""The past: samples that are no longer live, in the store and in memory, and what was lost of them. Pure.

The rules (contract, section 3):

1. The past is opened 10 s after a connect: subscribers come back later than we do. First what was lost is declared;
   then it goes oldest first, by boot and seq: what lies in the store, then what waits in memory. One device and one
   boot per array, at most 1000 samples a second, and as many arrays under way at a time as `drain` says: one, as long
   as the backlog shrinks. One more goes whenever none has gone for 2 s.
2. What was acknowledged from 10 s before a loss until the past is opened goes once more, in its place by seq, because
   an acknowledgement of a broker that dies is not durable. After the first connect of a life so does what
   was acknowledged until then with the word that nobody listens: after a power cut subscribers are late there too.
3. While the broker has been away for more than 3 s, what waits here is handed to the store, at first at once, then
   every 5 s; and whenever half of the memory is taken, which happens where the broker is too slow.
   What the store cannot take waits in memory.
4. Devices whose history the broker refuses are passed over: their samples wait where they are, the others go on.

So everything in the store is older than everything in memory.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from collections.abc import Set as AbstractSet
from dataclasses import replace

from lfs10d.outbox.drain import Drain
from lfs10d.outbox.history import History, QueuedSample
from lfs10d.outbox.items import HistoryBatch, LossNotice, OutboxItem, samples_of
from lfs10d.outbox.losses import Loss, Losses
from lfs10d.outbox.spool import AGAIN_WITHIN, Spool
from lfs10d.system.clock_step import ClockState
from lfs10d.telemetry import publication

ARRAY_MOST = 100
"""Samples in one history array (contract, section 3)."""

ARRAY_BYTES = 8000
"""Bytes of one history array at most (contract, section 3)."""

SAMPLE_EVERY = 0.001
"""Seconds from one history array to the next, per sample of the first: the bounded rate, 1000 samples a second."""

AT_ONCE = 1.0
"""Seconds of that rate which may go at once where several arrays may be under way: there is room for them at once."""

TURN_EVERY = 2.0
"""Seconds after which one more array goes though others are under way (contract, section 3)."""

PAST_AFTER = 10.0
"""Seconds after a connect at which the past is opened (contract, section 3)."""

AWAY_AFTER = 3.0
"""Seconds without the broker after which samples are kept on disk."""

SPILL_EVERY = 5.0
"""Seconds from one commit to the next; and to the next attempt where the store cannot take anything."""

SPILL_MOST = 1000
"""Samples in one commit: about 30 ms of the store's thread."""


class Backlog:
    """The rules above. `detection`: seconds in which a dead connection is noticed at the latest."""

    def __init__(self, *, capacity: int, detection: float) -> None:
        self._capacity = capacity
        self._detection = detection
        self._connected = False
        self._away_since = float("-inf")
        self._open_from = 0.0
        self._array_at = 0.0
        self._array_most = ARRAY_MOST
        self._limit, self._limit_until = ARRAY_MOST, float("-inf")
        self._window = 1
        self._turn_at = 0.0
        self._under_way: dict[HistoryBatch | LossNotice, None] = {}
        self._acknowledged: deque[tuple[float, QueuedSample]] = deque(maxlen=capacity)
        self._unheard: deque[tuple[float, QueuedSample]] = deque(maxlen=capacity)
        self._repeat = False
        self._spilling: list[QueuedSample] = []
        self._spill_at = float("-inf")
        self.history = History()
        """What waits in memory."""
        self.stored = Spool()
        """What waits in the store."""
        self.losses = Losses()
        """What will never come."""
        self.drain = Drain()
        """How much of the window the past takes."""

    # The connection

    def connected(self, now: float, window: int) -> None:
        """Note that the broker is there, and takes `window` messages at once."""
        self._connected = True
        self._open_from = self._array_at = now + PAST_AFTER
        self._turn_at = self._open_from + TURN_EVERY
        self._window = window
        self.drain.begin(self._open_from)
        self._array_most = self._limit if now < self._limit_until else ARRAY_MOST
        self.losses.connected()

    def lost(self, now: float) -> None:
        """Note that it is gone; what was under way is put back by the outbox."""
        if self._connected:
            self._away_since = now
        self._connected = False
        if not self._repeat:
            self._forget(now - AGAIN_WITHIN - self._detection)
        self._acknowledged.extend(self._unheard)
        self._unheard.clear()
        self._repeat = True
        self._under_way.clear()
        self.stored.rewind()

    def part(self) -> None:
        """Note that we part from a broker that has answered everything: what it has needs no second sending."""
        if not self._repeat:
            self._acknowledged.clear()
        self._unheard.clear()
        self.stored.release_all()

    # What goes

    def next(self, now: float, refused: AbstractSet[str]) -> HistoryBatch | LossNotice | None:
        """Take what goes next, after `repeat`; None: nothing. Topics that are `refused` are passed over."""
        if now < self._open_from:
            return None
        if publication.EVENT not in refused and not self._declaring:
            loss = self.losses.take(now)
            if loss is not None:
                declaration = LossNotice(loss)
                self._under_way[declaration] = None
                return declaration
        if now < max(self._array_at, self._free_at):
            return None
        samples = self._take(_devices(refused))
        if not samples:
            return None
        at_once = AT_ONCE if self.drain.level > 1 else 0.0
        self._array_at = max(self._array_at, now - at_once) + SAMPLE_EVERY * len(samples)
        self._turn_at = now + TURN_EVERY
        array = HistoryBatch(samples)
        self._under_way[array] = None
        waiting = self.history if samples[0].row is None else self.stored.page
        self.drain.taken(full=self.stored.more or array.samples[0].key in waiting)
        return array

    @property
    def _declaring(self) -> bool:
        return any(isinstance(each, LossNotice) for each in self._under_way)

    @property
    def _free_at(self) -> float:
        """When the next array may go for what is under way."""
        return float("-inf") if len(self._under_way) < self.drain.arrays(self._window) else self._turn_at

    def _take(self, passed_over: AbstractSet[str]) -> tuple[QueuedSample, ...]:
        if self.stored.page:
            samples = self.stored.page.take(self._array_most, passed_over)
            if samples:
                return samples
            self.stored.leave()
        return () if self.stored.more else self.history.take(self._array_most, passed_over)

    def lifted(self) -> None:
        """Try again what was passed over: topics are refused no longer."""
        under_way = (kept.row for each in self._under_way for kept in samples_of(each))
        self.stored.read_again(row for row in under_way if row is not None)

    def repeat(self, now: float) -> bool:
        """Once the past is open, let what rule 2 says wait once more; return True if it does."""
        if now < self._open_from or not (self._repeat or self._unheard):
            return False
        again = self._acknowledged if self._repeat else self._unheard
        self._repeat = False
        self._take_again(again)
        return True

    def _take_again(self, again: deque[tuple[float, QueuedSample]]) -> None:
        self.history.extend(replace(kept, repeated=True) for _, kept in again)
        again.clear()

    def due(self, refused: AbstractSet[str]) -> float | None:
        """Return when `next` may have something though nothing happens before; None: not by time alone."""
        declared = self.losses.due() if publication.EVENT not in refused and not self._declaring else None
        times = [] if declared is None else [declared]
        again = self._acknowledged if self._repeat else self._unheard
        in_memory = not self.stored.more and (again or self.history.waits(_devices(refused)))
        if self.stored.page or in_memory:
            times.append(max(self._array_at, self._free_at))
        return max(self._open_from, min(times)) if times else None

    # What became of it

    def over(self, letter: OutboxItem) -> None:
        """Note that a letter is no longer under way."""
        if isinstance(letter, HistoryBatch | LossNotice):
            self._under_way.pop(letter, None)

    def settled(self, letter: OutboxItem, now: float, *, heard: bool = True) -> None:
        """Note that the broker has it; `heard`: it did not say that nobody listens."""
        if not self._repeat:
            self._forget(now - AGAIN_WITHIN)
        if isinstance(letter, HistoryBatch) and self.drain.settled(now):
            self.drain.look(now, len(self) + self.stored.depth)
        rows = [kept.row for kept in samples_of(letter) if kept.row is not None]
        if rows:
            self.stored.settled(rows, now)
        else:
            late = not (heard or self._repeat) and now < self._open_from
            (self._unheard if late else self._acknowledged).extend((now, kept) for kept in samples_of(letter))

    def dead(self, letter: OutboxItem) -> None:
        """Note that it will never be delivered."""
        if isinstance(letter, LossNotice):
            self.losses.restore(letter.loss)
        for kept in samples_of(letter):
            if not kept.repeated:
                self.losses.add(kept.sample)
            if kept.row is not None:
                self.stored.release([kept.row])

    def cut(self, array: HistoryBatch) -> None:
        """Let an array that is too large wait again, to go in halves, and so those after it on this connection."""
        self._array_most = len(array.samples) // 2
        self._array_at = 0.0
        self.refused(array)

    def cut_for(self, array: HistoryBatch, until: float) -> None:
        """Let the arrays after this one, which ended its connection, have half as many samples `until` then."""
        self._limit, self._limit_until = len(array.samples) // 2, until

    def reload(self) -> None:
        """Try arrays of any length again."""
        self._limit_until = float("-inf")

    def shorten(self, array: HistoryBatch, count: int) -> HistoryBatch:
        """Return an array of its first samples to be under way in its place; the others wait again."""
        self._wait(array.samples[count:])
        shorter = HistoryBatch(array.samples[:count])
        self._under_way = {shorter if each is array else each: None for each in self._under_way}
        self._array_at -= SAMPLE_EVERY * (len(array.samples) - count)
        self.drain.taken(full=True)
        return shorter

    def refused(self, array: HistoryBatch) -> None:
        """Let an array that the broker refused wait again."""
        self._wait(array.samples)

    def _wait(self, samples: tuple[QueuedSample, ...]) -> None:
        (self.history if samples[0].row is None else self.stored.page).put_back(samples)

    def put_back(self, letter: HistoryBatch | LossNotice) -> None:
        """Let what was under way wait again; what is in the store does so anyway."""
        if isinstance(letter, LossNotice):
            self.losses.restore(letter.loss)
        else:
            self.history.extend(kept for kept in letter.samples if kept.row is None)

    def _forget(self, before: float) -> None:
        while self._acknowledged and self._acknowledged[0][0] < before:
            self._acknowledged.popleft()

    # The store

    @property
    def away(self) -> bool:
        """The broker is."""
        return not self._connected

    def spill_at_last(self) -> bool:
        """Tell whether there is anything for the store before the daemon ends."""
        return bool(self.history or (self._repeat and self._acknowledged))

    def spill_due(self) -> float | None:
        """Return when `spill` is wanted for what waits here; None: for nothing."""
        if self._spilling:
            return None
        if len(self.history) > self._capacity // 2:
            return self._spill_at
        if self._connected or not self.spill_at_last():
            return None
        return max(self._away_since + AWAY_AFTER, self._spill_at)

    def spill(self) -> list[QueuedSample]:
        """Take what the store shall keep; `spilled` or `not_spilled` is to follow."""
        if not self._connected and self._repeat:
            self._take_again(self._acknowledged)
        while len(self._spilling) < SPILL_MOST and self.history:
            self._spilling += self.history.take(SPILL_MOST - len(self._spilling))
        return self._spilling

    def spilled(self, evicted: tuple[Loss, ...], now: float) -> None:
        """Note that the store has it, and what it had to evict."""
        self._spilling = []
        self.stored.more = True
        self.losses.evicted(evicted)
        self._spill_at = float("-inf") if self.history else now + SPILL_EVERY

    def not_spilled(self, now: float) -> None:
        """Let it wait in memory, since the store cannot take it."""
        self.history.extend(self._spilling)
        self._spilling = []
        self._spill_at = now + SPILL_EVERY

    @property
    def beyond(self) -> int:
        """The id of the last row that the store may not evict: it is in the page or under way, or one before it is."""
        under_way = any(isinstance(each, HistoryBatch) and each.samples[0].row is not None for each in self._under_way)
        return 0 if self.stored.left and not (self.stored.page or under_way) else self.stored.after

    def page_due(self) -> float | None:
        """Return when the next page of the store is wanted; None: none is."""
        wanted = self._connected and self.stored.more and not self.stored.page
        return self._open_from if wanted else None

    def undeclared(self) -> list[Loss]:
        """Return the losses that are not declared, one under way included."""
        under_way = [each.loss for each in self._under_way if isinstance(each, LossNotice)]
        return under_way + self.losses.waiting()

    def correct(self, shift: int, clock: ClockState = "synced") -> None:
        """Give what waits the time that the clock tells now, as `QueuedSample.at` does."""
        self.history.correct(shift, clock)
        self.stored.page.correct(shift, clock)
        self._spilling = [kept.at(shift, clock) for kept in self._spilling]

    # How much

    def __len__(self) -> int:
        """Count the samples that wait in memory alone."""
        return len(self.history) + len(self._spilling)

    def waiting(self) -> Iterator[QueuedSample]:
        """Return the oldest of what waits in memory."""
        yield from self._spilling[:1]
        oldest = self.history.oldest()
        if oldest is not None:
            yield oldest


def _devices(refused: AbstractSet[str]) -> AbstractSet[str]:
    """Return the devices whose history is refused."""
    if not refused:
        return refused
    topics = (topic.split("/") for topic in refused)
    return {levels[1] for levels in topics if levels[0] == "device" and levels[-1] == publication.HISTORY}
