"""All queues to the broker, by class, and which item is sent next: rules 1, 2 and 6 of `outbox`. Pure."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Set as AbstractSet
from functools import partial

from lfs10d.outbox.backlog import Backlog
from lfs10d.outbox.items import HistoryBatch, LiveSample, LossNotice, Message, OutboxItem, Retained
from lfs10d.outbox.live_queue import LiveQueue
from lfs10d.outbox.message_queue import MessageQueue
from lfs10d.outbox.refusals import BANNED_FOR, Refusals
from lfs10d.outbox.retained import RetainedQueue
from lfs10d.outbox.suspects import Culprit, Suspects
from lfs10d.outbox.turns import (
    CHANGES,
    CLEARINGS,
    FIRST_CLASSES,
    HISTORY,
    LIVE,
    MESSAGES,
    REFRESHES,
    TRACES,
    Turns,
    weight,
)

BURST_FIRST = 10.0
"""Seconds for which a burst keeps everything else back; what follows in turn then is no smaller for it."""


class Queues:
    """The queues of the classes; those of the topics in `refusals` are passed over."""

    def __init__(self, backlog: Backlog, refusals: Refusals, suspects: Suspects) -> None:
        self.retained = RetainedQueue()
        self.messages = MessageQueue()
        self.live = LiveQueue()
        self.backlog = backlog
        self._refusals = refusals
        self._suspects = suspects
        self._refused = refusals.topics
        self._burst_until: float | None = None
        self._classes: dict[int, Callable[[AbstractSet[str]], OutboxItem | None]] = {
            CHANGES: self.retained.next_change,
            MESSAGES: partial(self.messages.take, self.messages.messages),
            LIVE: self._next_live,
            HISTORY: self._next_history,
            REFRESHES: partial(self.retained.take, self.retained.refreshes),
            TRACES: partial(self.messages.take, self.messages.traces),
            CLEARINGS: partial(self.retained.take, self.retained.clearings),
        }
        self._turns = Turns(len(self._classes))
        self._now = 0.0
        self._narrow = False  # the window was full, and not everything has gone since

    def connected(self, now: float) -> None:
        """Begin anew on another connection."""
        self._burst_until = None
        self._lift(self._refusals.connected(now))

    def lost(self) -> None:
        """Forget what the next burst holds, and traces."""
        self.messages.traces.clear()
        self.retained.lost()

    # What goes

    def full(self) -> None:
        """Note that the window was full: until everything has gone, no class goes before the others."""
        self._narrow = True

    def next(self, now: float, *, batch: bool) -> OutboxItem | None:
        """Take what goes next, None where nothing may; no history unless `batch`."""
        self._now = now
        if self.retained.last is None:
            self._burst_until = None
        elif self._keeps_back(now):
            retained = self.retained.next_change(self._refused)
            if retained is not None or self.retained.last is not None:
                return retained
        for number in self._turns.order(self._waiting(batch=batch), first=None if self._narrow else FIRST_CLASSES):
            item = self._classes[number](self._refused)
            if item is None:
                self._turns.passed(number)
            else:
                bursting = self.retained.last is not None
                self._turns.went(number, weight(number, bursting=bursting, level=self.backlog.drain.level))
                return item
        self._narrow = False
        return None

    def _waiting(self, *, batch: bool) -> list[int]:
        """Return the classes that hold something, in order; no history unless `batch`."""
        retained, messages = self.retained, self.messages
        holding = (
            (CHANGES, retained.changes or retained.last),
            (MESSAGES, messages.messages),
            (LIVE, self.live.waiting),
            (HISTORY, batch and self.backlog.waits),
            (REFRESHES, retained.refreshes),
            (TRACES, messages.traces),
            (CLEARINGS, retained.clearings),
        )
        return [number for number, held in holding if held]

    def _keeps_back(self, now: float) -> bool:
        """Return whether nothing but the burst may go now, whose `last` waits."""
        if self._burst_until is None:
            self._burst_until = now + BURST_FIRST
        return now < self._burst_until

    def _next_live(self, refused: AbstractSet[str]) -> LiveSample | None:
        while (live := self.live.take()) is not None:
            if live.topic not in refused:
                return live
            self.backlog.history.add(live.queued)
        return None

    def _next_history(self, refused: AbstractSet[str]) -> HistoryBatch | LossNotice | None:
        return self.backlog.next(self._now, refused)

    def __bool__(self) -> bool:
        """Return whether anything but the backlog waits."""
        retained, messages = self.retained, self.messages
        waiting = self.live.waiting or retained.changes or retained.refreshes or retained.clearings
        return bool(waiting or retained.last or messages.messages or messages.traces)

    def due(self) -> float | None:
        """Return when `next` may have something though nothing happens before; None: not by time alone."""
        if not self.backlog.waits:
            return self._refusals.due() if self._refused else None
        times = (self.backlog.due(self._refused), self._refusals.due())
        return min((each for each in times if each is not None), default=None)

    # What waits again

    def put_back(self, item: OutboxItem) -> None:
        """Let an item wait that was under way when the connection was lost."""
        match item:
            case Retained():
                self.retained.put_back(item)
            case Message():
                self.messages.put_back(item)
            case LiveSample():
                self.live.put_back(item)
            case _:
                self.backlog.put_back(item)

    def condemn(self, culprit: Culprit, under_way: list[OutboxItem], now: float, *, denied: bool) -> list[OutboxItem]:
        """Do away with what ended the connection; return what else was under way."""
        guilty = [item for item in under_way if item.topic == culprit.topic]
        batches = [item for item in guilty if isinstance(item, HistoryBatch) and len(item.samples) > 1]
        if batches and not denied:
            self.backlog.cut_for(batches[0], now + BANNED_FOR)
            self._suspects.cut(culprit)
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

    def refused(self, item: OutboxItem) -> None:
        """Let an item wait until its topic is tried again; a sample waits with the backlog."""
        match item:
            case Retained():
                self.retained.wait_again(item)
            case Message():
                self.messages.pass_over(item)
            case LiveSample():
                self.backlog.history.add(item.queued)
            case _:
                self.backlog.refused(item)

    def lift_due(self, now: float) -> None:
        """Try the topics again whose time has come."""
        due = self._refusals.due()
        if due is not None and due <= now:
            self._lift(self._refusals.lift(now))

    def reload(self, now: float) -> bool:
        """Try again what was refused before, and report anew; return True if a topic was refused."""
        lifted = self._refusals.reload(now)
        self.backlog.reload()
        self._lift(lifted)
        return bool(lifted)

    def _lift(self, topics: AbstractSet[str]) -> None:
        if topics:
            self.retained.lifted(topics)
            self.messages.lifted(topics)
            self.backlog.lifted()
