"""What waits for the broker, in which order it goes, and what becomes of it. Pure: time is an argument.

The rules (contract, section 3):

1. Classes by weight (`turns`): changes of retained topics, responses and events, and live samples 8 each; the backlog
   8, and more while it does not shrink (`drain`); refreshes of retained topics (newer figures, nothing else) 4;
   traces, and what clears a retained topic, 1. The first three go before the others until the window was full; then
   all go in turn until nothing waits: each class goes on, and refreshes come less often. Within a class the oldest
   goes first; live samples device by device.
2. Of a retained topic only the newest version waits, and no second version goes while the first is under way.
   After a connect the whole burst goes first, and everything else only after that, but for no longer than 10 s; its
   `last` (availability) goes when all of it is settled.
3. A sample that is older than 3 s when its turn comes belongs to the backlog, whose rules are in `past`.
4. An item leaves for ever when it is settled (PUBACK). A connection lost puts all that was under way back.
5. At most `capacity` samples wait in memory. Beyond that those go first that are only repeated, then the oldest,
   which are declared.
6. What the broker refuses waits, and its topic is passed over until it is tried again, see `refusals`; the others go
   on. Only a message that is wrong in itself is dead; a batch is first cut smaller. A dead sample is declared like
   an evicted one.
7. What ends the connection each time is found (`suspects`), and treated like that, for an hour.

====================  =========================  ============================  ====================  ===============
item                settled                    connection lost               refused               unfit
====================  =========================  ============================  ====================  ===============
`Retained`            gone                       gone (the burst renews it),   the newest waits      gone
                                                 a clearing one waits again
`Message`             gone                       waits again (QoS 0: gone)     waits (trace: gone)   gone
`LiveSample`                kept 10 s for a second     waits again                   waits with the backlog   declared
                      sending
`HistoryBatch`               as `LiveSample`        waits again                   waits again           cut or declared
`LossNotice`         gone                       waits again                   waits again           waits again
====================  =========================  ============================  ====================  ===============
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from collections.abc import Set as AbstractSet
from dataclasses import replace
from itertools import chain

from lfs10d.outbox.backlog import Backlog
from lfs10d.outbox.congestion import Congested, Congestion
from lfs10d.outbox.history import QueuedSample
from lfs10d.outbox.items import HistoryBatch, LiveSample, LossNotice, Message, OutboxItem, Retained, samples_of
from lfs10d.outbox.live_queue import LiveQueue
from lfs10d.outbox.refusals import BANNED_FOR, Refusals
from lfs10d.outbox.retained import RetainedQueue
from lfs10d.outbox.suspects import Culprit, Suspects
from lfs10d.outbox.turns import Turns
from lfs10d.system.clock_step import ClockState
from lfs10d.telemetry.publication import BacklogStats, Publication, PublicationKind, iso_time

CAPACITY = 10_000
"""Samples that wait in memory (contract, section 3)."""

LIVE_FOR = 3.0
"""Seconds after which a sample is history (contract, section 3)."""

MESSAGES_MOST = 1000
"""Responses and events that wait while the broker is away; and traces while it is slow."""

IN_FLIGHT_MOST = 20
"""Items under way; mosquitto's own default for `max_inflight_messages`."""

BURST_FIRST = 10.0
"""Seconds for which a burst keeps everything else back; what follows in turn then is no smaller for it."""

CHANGES, MESSAGES, LIVE, HISTORY, REFRESHES, TRACES, CLEARINGS = range(7)
"""The classes, as `Turns` numbers them."""

FIRST_CLASSES = HISTORY
"""Those below go before the others while the window has room for all."""

WEIGHT = 8
REFRESH_WEIGHT = 4
LEAST_WEIGHT = 1
"""Weights of the classes (rule 1)."""


class Outbox:
    """The rules above. `detection`: seconds in which a dead connection is noticed at the latest."""

    def __init__(self, *, capacity: int = CAPACITY, detection: float = 40.0) -> None:
        self._capacity = capacity
        self._window = 0  # 0: not connected
        self._under_way: dict[OutboxItem, float] = {}  # since when
        self._retained = RetainedQueue()
        self._messages: deque[Message] = deque(maxlen=MESSAGES_MOST)
        self._live = LiveQueue()
        self._traces: deque[Message] = deque(maxlen=MESSAGES_MOST)
        self._burst_until: float | None = None
        self._congestion = Congestion()
        self._refusals = Refusals()
        self._refused = self._refusals.topics
        self._passed_over: deque[Message] = deque(maxlen=MESSAGES_MOST)
        self._unfit: set[str] = set()
        self._alone: OutboxItem | None = None
        self._alone_went = False
        self.suspects = Suspects()
        """What may have ended the last connection."""
        self.telemetry = True
        """False: samples are not taken, and what waits of the backlog stays where it is."""
        self.backlog = Backlog(capacity=capacity, detection=detection)
        """What is no longer live."""
        self._classes: dict[int, Callable[[float], OutboxItem | None]] = {
            CHANGES: lambda _now: self._retained.next_change(self._refused),
            MESSAGES: lambda _now: self._next_message(self._messages),
            LIVE: lambda _now: self._next_live(),
            HISTORY: self._next_history,
            REFRESHES: lambda _now: self._retained.next_refresh(self._refused),
            TRACES: lambda _now: self._next_message(self._traces),
            CLEARINGS: lambda _now: self._retained.next_clearing(self._refused),
        }
        self._turns = Turns(len(self._classes))
        self._batch_may_go = True
        self._narrow = False  # the window was full, and not everything has gone since

    # What comes in

    def add(
        self, publication: Publication, now: float, *, correlation: bytes | None = None, shift: int | None = None
    ) -> None:
        """Take one publication; while the broker is away only samples, events, responses and clearings stay.

        `shift` is the wall clock less the monotonic one now, in ms.
        """
        if publication.sample is not None:
            if not self.telemetry:
                return
            self._live.add(LiveSample(publication, QueuedSample(publication.sample, now, shift=shift)))
            self.age(now)
            self._make_room()
        elif publication.kind is PublicationKind.RETAINED:
            if (self._window or publication.payload is None) and self._retained.add(publication):
                self._displaced(now)
        elif publication.kind is PublicationKind.TRACE:
            if self._window:
                self._traces.append(Message(publication))
        else:
            self._messages.append(Message(publication, correlation))

    def _displaced(self, now: float) -> None:
        """Note that a state was replaced or a sample grew old while it waited."""
        if self.announced and len(self._under_way) >= self._window:
            self._congestion.displaced(now)

    def burst(self, publications: Iterable[Publication], last: Publication) -> None:
        """Send all retained topics, then `last`, then everything else."""
        self._retained.burst(publications, last)

    # What happens to the connection

    def connected(self, now: float, *, window: int = IN_FLIGHT_MOST) -> None:
        """Begin to send: at most `window` items under way at once. `burst` is to follow."""
        self._window = window
        self._burst_until = None
        self._congestion.connected()
        self.backlog.connected(now, window)
        self._lift(self._refusals.connected(now))

    def lost(self, now: float, culprit: Culprit | None = None, *, denied: bool = False) -> None:
        """Put back what was under way (rule 4), and remember to repeat what was acknowledged lately.

        `culprit` is what ended the connection (rule 7); `denied`: the broker said that we may not publish it.
        """
        self._window = 0
        self._alone = None
        self._traces.clear()
        self._retained.lost()
        self.backlog.lost(now)
        under_way, self._under_way = list(self._under_way), {}
        if culprit is not None:
            under_way = self._condemn(culprit, under_way, now, denied=denied)
        for item in reversed(under_way):
            self._put_back(item)
        self._make_room()

    def _condemn(self, culprit: Culprit, under_way: list[OutboxItem], now: float, *, denied: bool) -> list[OutboxItem]:
        """Do away with what ended the connection; return what else was under way."""
        guilty = [item for item in under_way if item.topic == culprit.topic]
        batches = [item for item in guilty if isinstance(item, HistoryBatch) and len(item.samples) > 1]
        if batches and not denied:
            self.backlog.cut_for(batches[0], now + BANNED_FOR)
            self.suspects.cut(culprit)
            return under_way
        self._refusals.ban(culprit.topic, now)
        for item in guilty:
            if isinstance(item, LiveSample):
                self.backlog.history.add(item.queued)
            elif isinstance(item, HistoryBatch) and not denied:
                self.backlog.dead(item)
            elif isinstance(item, HistoryBatch | LossNotice):
                self.backlog.put_back(item)
        return [item for item in under_way if item.topic != culprit.topic]

    def _put_back(self, item: OutboxItem) -> None:
        match item:
            case Retained():
                self._retained.put_back(item)
            case Message(publication=publication):
                if publication.qos and len(self._messages) < MESSAGES_MOST:
                    self._messages.appendleft(item)
            case LiveSample():
                self._live.put_back(item)
            case _:
                self.backlog.put_back(item)

    # What goes out

    def next(self, now: float, *, batch: bool = True) -> OutboxItem | None:
        """Take what goes next; it is under way until settled, refused, unfit or lost. None: nothing goes now.

        `batch`: the batch before is on its way, so that another may follow.
        """
        if self._alone is not None:
            return self._next_alone()
        if len(self._under_way) >= self._window:
            self._narrow = True
            return None
        self._batch_may_go = batch
        item = self._next(now)
        if item is None:
            return None
        self._under_way[item] = now
        if not self.suspects.goes_alone(item.topic):
            return item
        self._alone, self._alone_went = item, False
        return self._next_alone()

    def _next_alone(self) -> OutboxItem | None:
        """Return what goes alone as soon as nothing else is under way, once."""
        if self._alone_went or len(self._under_way) > 1:
            return None
        self._alone_went = True
        return self._alone

    def _next(self, now: float) -> OutboxItem | None:
        self._lift_due(now)
        if self._keeps_back(now):
            retained = self._retained.next_change(self._refused)
            if retained is not None or self._retained.first:
                return retained
        self.age(now)
        for number in self._turns.order(first=None if self._narrow else FIRST_CLASSES):
            item = self._classes[number](now)
            if item is None:
                self._turns.passed(number)
            else:
                self._turns.went(number, self._weight(number))
                return item
        self._narrow = False
        return None

    def _keeps_back(self, now: float) -> bool:
        """Tell whether nothing but the burst may go now."""
        if not self._retained.first:
            self._burst_until = None
            return False
        if self._burst_until is None:
            self._burst_until = now + BURST_FIRST
        return now < self._burst_until

    def _weight(self, number: int) -> int:
        """Return the weight of a class; what is left of a burst has as much as samples and past together."""
        bursting = self._retained.first
        if number == CHANGES:
            return 2 * WEIGHT if bursting else WEIGHT
        if number == HISTORY:
            return WEIGHT if bursting else WEIGHT * self.backlog.drain.level
        if number in (MESSAGES, LIVE):
            return WEIGHT
        return REFRESH_WEIGHT if number == REFRESHES else LEAST_WEIGHT

    def _next_message(self, queue: deque[Message]) -> OutboxItem | None:
        while queue:
            item = queue.popleft()
            if item.topic not in self._refused:
                return item
            self._wait_for_topic(item)
        return None

    def _next_live(self) -> OutboxItem | None:
        while (item := self._live.take()) is not None:
            if item.topic not in self._refused:
                return item
            self._wait_for_topic(item)
        return None

    def _next_history(self, now: float) -> OutboxItem | None:
        self._repeat(now)
        return self.backlog.next(now, self._refused) if self._batch_may_go and self.telemetry else None

    def _wait_for_topic(self, item: Message | LiveSample) -> None:
        """Let an item wait until its topic is passed over no longer; a sample may go with the backlog."""
        if isinstance(item, LiveSample):
            self.backlog.history.add(item.queued)
        elif item.publication.kind is not PublicationKind.TRACE:
            self._passed_over.append(item)

    def _lift_due(self, now: float) -> None:
        due = self._refusals.due()
        if due is not None and due <= now:
            self._lift(self._refusals.lift(now))

    def _lift(self, topics: AbstractSet[str]) -> None:
        """Try these topics again."""
        if not topics:
            return
        self._retained.lifted(topics)
        again = [message for message in self._passed_over if message.topic in topics]
        self._messages.extendleft(reversed(again))
        self._passed_over = deque((each for each in self._passed_over if each.topic not in topics), MESSAGES_MOST)
        self.backlog.lifted()

    @property
    def waits(self) -> bool:
        """Something may go, now or later; False: nothing before something is added."""
        if self._alone is not None:
            return True
        return bool(self._retained or self._messages or self._live or self._traces) or self.due() is not None

    def due(self) -> float | None:
        """Return when `next` may have something though nothing happens before; None: not by time alone."""
        if self._alone is not None or len(self._under_way) >= self._window:
            return None
        times = (self.backlog.due(self._refused) if self.telemetry else None, self._refusals.due())
        return min((each for each in times if each is not None), default=None)

    # What became of it

    def on_ack(self, item: OutboxItem, now: float, *, heard: bool = True) -> None:
        """Note that the broker has it; `heard`: it did not say that nobody listens."""
        if isinstance(item, LiveSample | HistoryBatch):
            self._congestion.answered(now - self._under_way[item])
        self._over(item)
        self._refusals.accepted(item.topic)
        self._repeat(now)
        self.backlog.on_ack(item, now, heard=heard)

    def congested(self, now: float) -> Congested | None:
        """Return once what the window carries, where that is less than what is published."""
        return self._congestion.report(now, self._window)

    def refused(self, item: OutboxItem, reason: int, now: float) -> bool:
        """Note that the broker refused it, not as `UNFIT` (`refusals`); return True if its topic is to be reported."""
        self._over(item)
        told = self._refusals.refused(item.topic, reason, now)
        match item:
            case Retained():
                self._retained.refused(item)
            case Message() | LiveSample():
                self._wait_for_topic(item)
            case HistoryBatch():
                self.backlog.refused(item)
            case _:
                self.backlog.put_back(item)
        self._make_room()
        return told

    def unfit(self, item: OutboxItem) -> bool:
        """Note that it can never be sent as it is; return True if its topic is to be reported.

        A batch is cut in two and waits again, and so do the batches after it on this connection.
        """
        self._over(item)
        if isinstance(item, HistoryBatch) and len(item.samples) > 1:
            self.backlog.cut(item)
            return False
        self.backlog.dead(item)
        if item.topic in self._unfit:
            return False
        self._unfit.add(item.topic)
        return True

    def passes_over(self, topic: str) -> bool:
        """Tell whether nothing is sent to a topic now, because the broker refuses it."""
        return topic in self._refused

    def shorten(self, batch: HistoryBatch, count: int) -> HistoryBatch:
        """Return a batch of its first `count` samples, under way in its place; the others wait again."""
        shorter = self.backlog.shorten(batch, count)
        self._under_way = {shorter if item is batch else item: at for item, at in self._under_way.items()}
        if self._alone is batch:
            self._alone = shorter
        return shorter

    def reload(self, now: float) -> bool:
        """Try again what was refused before, and report anew; return True if a topic was refused."""
        lifted = self._refusals.reload(now)
        self._unfit.clear()
        self.backlog.reload()
        self._lift(lifted)
        return bool(lifted)

    def _over(self, item: OutboxItem) -> None:
        del self._under_way[item]
        if item is self._alone:
            self._alone = None
        if isinstance(item, Retained):
            self._retained.over(item)
        self.backlog.over(item)

    def _repeat(self, now: float) -> None:
        """Let what may have been lost at the broker wait once more, from the moment the backlog is opened."""
        if self.backlog.repeat(now):
            self._make_room()

    # What waits

    @property
    def announced(self) -> bool:
        """We are connected, and the burst and its `last` are settled."""
        return self._window > 0 and self._retained.announced

    @property
    def retained_out(self) -> bool:
        """We are `announced`, and no version of a retained topic waits: who asks the broker now finds the newest."""
        return self.announced and not self._retained

    @property
    def idle(self) -> bool:
        """Nothing is under way, and nothing but the backlog waits."""
        return not (self._under_way or self._retained or self._messages or self._live)

    @property
    def under_way(self) -> tuple[OutboxItem, ...]:
        """What is under way, in the order in which it was taken."""
        return tuple(self._under_way)

    @property
    def depth(self) -> int:
        """Samples that wait or are under way, those in the store included."""
        return self._in_memory() + self.backlog.spool.depth

    @property
    def dropped(self) -> int:
        """Samples that were lost since the start, declared or not."""
        return self.backlog.losses.total

    @property
    def stats(self) -> BacklogStats:
        """What `line/stats` says of it."""
        oldest_ts = self.backlog.spool.oldest()
        if oldest_ts is None:
            under_way = chain.from_iterable(self._under_way_alone())
            waiting = [*under_way, *self.backlog.waiting(), *self._oldest_live()]
            first = min(waiting, key=lambda queued: queued.since, default=None)
            oldest_ts = first.sample.ts if first else None
        return BacklogStats(self.depth, oldest_ts, self.dropped)

    def _in_memory(self) -> int:
        """Return how many samples are in memory alone."""
        return len(self._live) + len(self.backlog) + sum(len(samples) for samples in self._under_way_alone())

    def _under_way_alone(self) -> Iterator[tuple[QueuedSample, ...]]:
        """Return the samples under way that are not in the store, item by item: all of one are, or none is."""
        for item in self._under_way:
            samples = samples_of(item)
            if samples and samples[0].row is None:
                yield samples

    def _oldest_live(self) -> list[QueuedSample]:
        first = self._live.oldest()
        return [] if first is None else [first.queued]

    def next_old(self) -> float | None:
        """Return when the oldest live sample becomes history; None: there is none."""
        first = self._live.oldest()
        return None if first is None else first.queued.since + LIVE_FOR

    def age(self, now: float) -> None:
        """Let live samples that are too old for it wait with the backlog."""
        while (live := self._live.oldest()) is not None and now - live.queued.since > LIVE_FOR:
            self._live.take_oldest()
            self.backlog.history.add(live.queued)
            self._displaced(now)

    def _make_room(self) -> None:
        history = self.backlog.history
        while self._in_memory() > self._capacity and (history or self._live):
            live = None if history else self._live.take_oldest()
            queued = history.evict() if live is None else live.queued
            if queued is not None:
                self.backlog.losses.add(queued.sample)

    def not_spilled(self, now: float) -> None:
        """Let what the store could not take wait in memory, as far as there is room."""
        self.backlog.not_spilled(now)
        self._make_room()

    # The clock

    def correct(self, shift: int, clock: ClockState = "synced") -> None:
        """Give what waits the time that the clock tells now, as `QueuedSample.at` does; `shift` as in `add`."""
        self._live.change(lambda live: _corrected(live, shift, clock))
        self.backlog.correct(shift, clock)


def _corrected(live: LiveSample, shift: int, clock: ClockState) -> LiveSample:
    queued = live.queued.at(shift, clock)
    payload = live.publication.payload
    if queued is live.queued or not isinstance(payload, dict):
        return live
    sample = queued.sample
    told = {**payload, "ts": sample.ts, "time": iso_time(sample.ts), "clock": sample.clock}
    return LiveSample(replace(live.publication, payload=told, sample=sample), queued)
