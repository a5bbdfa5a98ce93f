"""The queue to the broker: what is sent next, what is kept, and what is lost. Pure: time is an argument.

The rules (contract, section 3):

1. Classes by weight (`turns`): changes of retained topics, responses and events, and live samples 8 each; history 8,
   and more while the backlog does not shrink (`drain`); refreshes of retained topics (newer figures, nothing else) 4;
   traces, and what clears a retained topic, 1. The first three go before the others until the window was full; then
   all go in turn until nothing waits. Within a class the oldest goes first; live samples device by device.
2. Of a retained topic only the newest version waits, and no second version goes while the first is under way.
   After a connect the whole burst goes first, and everything else only after that, but for no longer than 10 s; its
   `last` (availability) goes when all of it is acknowledged.
3. A sample that is older than 3 s when its turn comes belongs to the backlog, whose rules are in `backlog`.
4. An item is done when it is acknowledged (PUBACK). When a connection is lost, all items in flight wait again.
5. At most `capacity` samples wait in memory: beyond that re-sends are dropped first, then the oldest, declared.
6. What the broker refuses waits, and its topic is passed over for a time (`refusals`); the others go on. Only what is
   wrong in itself is dead; a batch is first cut smaller. A dead sample is declared like an evicted one.
7. What ends the connection each time is found (`suspects`), and treated like that, for an hour.
8. At a clean exit one last message goes as soon as the window has room, and nothing after it.

==============  ======================  ===========================  =======================  ================
item            acknowledged            connection lost              refused                  unfit
==============  ======================  ===========================  =======================  ================
`Retained`      gone                    gone (the burst renews it),  the newest waits         gone
                                        a clearing one waits again
`Message`       gone                    waits again (QoS 0: gone)    waits (trace: gone)      gone
`LiveSample`    remembered for 10 s to  waits again                  waits with the backlog   declared
                be sent again
`HistoryBatch`  as `LiveSample`         waits again                  waits again              cut or declared
`LossNotice`    gone                    waits again                  waits again              waits again
==============  ======================  ===========================  =======================  ================
"""

from __future__ import annotations

from collections.abc import Iterable
from itertools import chain, islice

from lfs10d.outbox.backlog import BATCH_MOST, HISTORY_AFTER, Backlog
from lfs10d.outbox.congestion import Congested, Congestion
from lfs10d.outbox.history import QueuedSample
from lfs10d.outbox.in_flight import InFlight
from lfs10d.outbox.items import HistoryBatch, LiveSample, Message, OutboxItem, Retained
from lfs10d.outbox.last_message import LastMessage
from lfs10d.outbox.queues import Queues
from lfs10d.outbox.refusals import Refusals
from lfs10d.outbox.suspects import Culprit, Suspects
from lfs10d.system.clock_step import ClockState
from lfs10d.telemetry.publication import BacklogStats, Publication, PublicationKind

CAPACITY = 10_000
"""Samples that wait in memory (contract, section 3)."""

IN_FLIGHT_MOST = 20
"""Items under way; mosquitto's own default for `max_inflight_messages`."""


class Outbox:
    """The rules above. `detection`: seconds in which a dead connection is noticed; `history_wait` as in `Backlog`."""

    def __init__(self, *, capacity: int = CAPACITY, detection: float = 40, history_wait: float = HISTORY_AFTER) -> None:
        self._capacity = capacity
        self._congestion = Congestion()
        self._refusals = Refusals()
        self.backlog = Backlog(capacity=capacity, detection=detection, history_wait=history_wait)
        """The backlog: samples that are no longer live."""
        self.suspects = Suspects()
        """The messages that may have ended the last connection."""
        self._queues = Queues(self.backlog, self._refusals, self.suspects)
        self._in_flight = InFlight(self.suspects)
        self._last_message: LastMessage | None = None

    def send_samples(self, *, telemetry: bool) -> None:
        """Take whether samples are sent; else none is taken, and the backlog keeps those that it has; records go."""
        if telemetry and not self.backlog.telemetry:
            self.backlog.lifted()
        self.backlog.telemetry = telemetry

    def add(
        self, publication: Publication, now: float, *, correlation: bytes | None = None, shift: int | None = None
    ) -> None:
        """Take one publication; while the broker is away only samples, events, responses and clearings stay.

        `shift` is the wall clock less the monotonic one now, in ms.
        """
        connected = self._in_flight.window > 0
        if publication.sample is not None:
            if publication.sample.grouped and not self.backlog.telemetry:
                return
            if self._queues.live.waiting:
                self.age(now)
            self._queues.live.add(LiveSample(publication, QueuedSample(publication.sample, now, shift=shift)))
            self._make_room()
        elif publication.kind is PublicationKind.RETAINED:
            if (connected or publication.payload is None) and self._queues.retained.add(publication, now):
                self._displaced(now)
        elif publication.kind is PublicationKind.TRACE:
            if connected:
                self._queues.messages.traces.append(Message(publication))
        else:
            self._queues.messages.messages.append(Message(publication, correlation))

    def _displaced(self, now: float) -> None:
        """Note that a state was replaced or a sample grew old while it waited."""
        if self.announced and self._in_flight.full:
            self._congestion.displaced(now)

    def burst(self, publications: Iterable[Publication], last: Publication) -> None:
        """Send all retained topics, then `last`, then everything else."""
        self._queues.retained.burst(publications, last)

    def send_last(self, last: Publication) -> LastMessage:
        """Send `last` as soon as the window has room, and nothing else over this connection (rule 8)."""
        self._last_message = LastMessage(Retained(last))
        return self._last_message

    def connected(self, now: float, *, window: int = IN_FLIGHT_MOST) -> None:
        """Begin to send: at most `window` items under way at once. `burst` is to follow."""
        self._in_flight.window = window
        self._last_message = None
        self._congestion.connected()
        self.backlog.connected(now, window)
        self._queues.connected(now)

    def lost(self, now: float, culprit: Culprit | None = None, *, denied: bool = False) -> None:
        """Put back what was under way (rule 4), and remember to repeat what was acknowledged lately.

        `culprit` is what ended the connection (rule 7); `denied`: the broker said that we may not publish it.
        """
        self._queues.lost()
        self.backlog.lost(now)
        under_way = self._in_flight.lost()
        if culprit is not None:
            under_way = self._queues.condemn(culprit, under_way, now, denied=denied)
        for item in reversed(under_way):
            self._queues.put_back(item)
        self._make_room()

    def next(self, now: float, *, batch: bool = True) -> OutboxItem | None:
        """Take what goes next; it is under way until acknowledged, refused, unfit or lost. None: nothing goes now.

        `batch`: the batch before is on its way, so that another may follow.
        """
        if self._last_message is not None:
            return self._last_message.next(self._in_flight, now)
        if self._in_flight.alone is not None:
            return self._in_flight.next_alone()
        if self._in_flight.full:
            self._queues.full()
            return None
        if self._refusals.topics:
            self._queues.lift_due(now)
        self._repeat(now)
        if self._queues.live.waiting:
            self.age(now)
        item = self._queues.next(now, batch=batch)
        return None if item is None else self._in_flight.begin(item, now)

    @property
    def waits(self) -> bool:
        """Something may go, now or later; False: nothing before something is added."""
        if self._last_message is not None:
            return not self._last_message.sent
        return self._in_flight.alone is not None or bool(self._queues) or self._queues.due() is not None

    def due(self) -> float | None:
        """Return when `next` may have something though nothing happens before; None: not by time alone."""
        return None if self._in_flight.closed or self._last_message is not None else self._queues.due()

    def on_ack(self, item: OutboxItem, now: float, *, nobody_listens: bool = False) -> None:
        """Note that the broker has it; `nobody_listens`: it said that no subscription matches."""
        since = self._over(item)
        if self._refusals.reported:
            self._refusals.accepted(item.topic)
        if not isinstance(item, (Retained, Message)):
            self._congestion.answered(now - since)
            self._repeat(now)
            self.backlog.on_ack(item, now, nobody_listens=nobody_listens)

    def congested(self, now: float) -> Congested | None:
        """Return once what the window carries, where that is less than what is published."""
        return self._congestion.report(now, self._in_flight.window) if self._congestion.lasts else None

    def refused(self, item: OutboxItem, reason: int, now: float) -> bool:
        """Note that the broker refused it, not as `UNFIT` (`refusals`); return True if its topic is to be reported."""
        self._over(item)
        report = self._refusals.refused(item.topic, reason, now)
        if self._last_message is None or item is not self._last_message.item:
            self._queues.refused(item)
        self._make_room()
        return report

    def unfit(self, item: OutboxItem) -> bool:
        """Note that it can never be sent as it is; return True if its topic is to be reported.

        A batch is cut in two and waits again, and so do the batches after it on this connection.
        """
        self._over(item)
        if isinstance(item, HistoryBatch) and len(item.samples) > 1:
            self.backlog.cut(item)
            return False
        self.backlog.dead(item)
        return self._refusals.unfit(item.topic)

    def passes_over(self, topic: str) -> bool:
        """Return whether nothing is sent to a topic now, because the broker refuses it."""
        return topic in self._refusals.topics

    def shorten(self, batch: HistoryBatch, count: int) -> HistoryBatch:
        """Return a batch of its first `count` samples, under way in its place; the others wait again."""
        shorter = self.backlog.shorten(batch, count)
        self._in_flight.replace(batch, shorter)
        return shorter

    def reload(self, now: float) -> bool:
        """Try again what was refused before, and report anew; return True if a topic was refused."""
        return self._queues.reload(now)

    def _over(self, item: OutboxItem) -> float:
        """Note that it is under way no longer; return when it was taken."""
        since = self._in_flight.end(item)
        if self._last_message is not None:
            self._last_message.note(item)
        if isinstance(item, Retained):
            self._queues.retained.over(item)
        elif not isinstance(item, (LiveSample, Message)):
            self.backlog.over(item)
        return since

    def _repeat(self, now: float) -> None:
        recent = self.backlog.recent
        if (recent.repeat or recent.without_listener) and self.backlog.repeat(now):
            self._make_room()

    @property
    def announced(self) -> bool:
        """We are connected, and the burst and its `last` are acknowledged."""
        return self._in_flight.window > 0 and self._queues.retained.announced

    @property
    def retained_out(self) -> bool:
        """We are `announced`, and no version of a retained topic waits: who asks the broker now finds the newest."""
        return self.announced and not self._queues.retained

    @property
    def idle(self) -> bool:
        """Nothing is under way, and nothing but the backlog waits."""
        queues = self._queues
        return not (self._in_flight or queues.retained or queues.messages.messages or queues.live.waiting)

    @property
    def depth(self) -> int:
        """Samples that wait or are under way, those in the store included."""
        return self._in_memory() + self.backlog.spool.depth

    @property
    def stats(self) -> BacklogStats:
        """The figures for `line/stats`."""
        oldest_ts = self.backlog.spool.oldest()
        if oldest_ts is None:
            under_way = chain.from_iterable(self._in_flight.in_memory())
            live = (each.queued for each in self._queues.live.waiting)
            waiting = chain(under_way, self.backlog.waiting(), islice(live, 1))
            first = min(waiting, key=lambda queued: queued.since, default=None)
            oldest_ts = first.sample.ts if first else None
        return BacklogStats(self.depth, oldest_ts, self.backlog.losses.total)

    def _in_memory(self) -> int:
        """Return how many samples are in memory alone."""
        return len(self._queues.live) + len(self.backlog) + sum(map(len, self._in_flight.in_memory()))

    def next_old(self) -> float | None:
        """Return when the oldest live sample becomes history; None: there is none."""
        return self._queues.live.old_at

    def age(self, now: float) -> None:
        """Let live samples that are too old for it wait with the backlog."""
        for live in self._queues.live.take_old(now):
            self.backlog.history.add(live.queued)
            self._displaced(now)

    def _make_room(self) -> None:
        history, lives = self.backlog.history, self._queues.live
        waiting = len(lives.waiting) + history.count + len(self.backlog.spill.samples)
        if waiting + BATCH_MOST * len(self._in_flight) <= self._capacity:
            return  # there is room whatever is under way
        while self._in_memory() > self._capacity and (history or lives):
            live = None if history else lives.take_oldest()
            queued = history.evict() if live is None else live.queued
            if queued is not None:
                self.backlog.losses.add(queued.sample)

    def not_spilled(self, now: float) -> None:
        """Let what the store could not take wait in memory, as far as there is room."""
        self.backlog.spill.failed(now)
        self._make_room()

    def correct(self, shift: int, clock: ClockState = "synced") -> None:
        """Give what waits the time that the clock tells now, as `QueuedSample.at` does; `shift` as in `add`."""
        self._queues.live.correct(shift, clock)
        self.backlog.correct(shift, clock)
