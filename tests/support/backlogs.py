"""A backlog in virtual time: a store in memory beside it, samples, a connection."""

from __future__ import annotations

from dataclasses import dataclass, field

from lfs10d.outbox.items import OutboxItem, samples_of
from lfs10d.outbox.losses import Loss
from lfs10d.outbox.outbox import Outbox
from lfs10d.outbox.store.sample_file import StoredRow
from lfs10d.system.clock_step import ClockState
from lfs10d.telemetry.publication import (
    TELEMETRY,
    Publication,
    PublicationKind,
    Sample,
    device_topic,
    retained,
)

NOT_AUTHORIZED, QUOTA_EXCEEDED = 0x87, 0x97
ONLINE = retained("availability", "online")


def sample(seq: int, device: str = "a", *, boot: str = "k2", clock: ClockState = "synced") -> Publication:
    measured = Sample(device, boot, seq, 1000 * seq, clock, None, {}, (), "bad", "timeout", None)
    topic = device_topic(device, TELEMETRY)
    return Publication(topic, measured.payload("line0"), PublicationKind.SAMPLE, retain=False, qos=1, sample=measured)


@dataclass
class MemoryStore:
    """What the store does, without a disk. `room`: rows that fit."""

    room: int = 10**9
    rows: dict[int, StoredRow] = field(default_factory=dict)
    next: int = 1
    losses: tuple[Loss, ...] = ()
    broken: bool = False

    def spill(self, outbox: Outbox, now: float) -> bool:
        """Do what is due; return True if something was."""
        outbox.age(now)
        due = outbox.backlog.spill.due()
        if due is None or due > now:
            return False
        self.take(outbox, now)
        return True

    def take(self, outbox: Outbox, now: float) -> None:
        """Take what waits in memory."""
        backlog = outbox.backlog
        queued = backlog.spill.take()
        if self.broken:
            outbox.not_spilled(now)
            return
        delivered, evicted = backlog.spool.delivered, []
        for each in queued:
            self.rows[self.next] = StoredRow(self.next, each.sample, each.shift, each.repeated)
            self.next += 1
        for number in [number for number in self.rows if number > backlog.beyond]:
            if len(self.rows) <= self.room:
                break
            row = self.rows.pop(number)
            if not row.repeated and number not in delivered:
                evicted.append(Loss(row.sample.device, row.sample.boot, row.sample.seq, row.sample.seq, 1))
        self.losses = (*backlog.undeclared(), *evicted)
        self.tell(outbox)
        backlog.spilled(tuple(evicted), now)

    def page(self, outbox: Outbox, now: float, most: int = 7) -> bool:
        """Give a page if one is due; return True if one was."""
        backlog = outbox.backlog
        due = backlog.page_due()
        if due is None or due > now or self.broken:
            return False
        found = [row for number, row in sorted(self.rows.items()) if number > backlog.spool.after]
        backlog.spool.take_page(found[:most], most)
        return True

    def release(self, outbox: Outbox, now: float) -> None:
        """Delete what is due."""
        due = outbox.backlog.spool.release_due()
        if due is None or due > now or self.broken:
            return
        gone = outbox.backlog.spool.releasing(now)
        for number in gone:
            self.rows.pop(number, None)
        self.losses = tuple(outbox.backlog.undeclared())
        outbox.backlog.spool.deleted(gone)
        self.tell(outbox)

    def tell(self, outbox: Outbox) -> None:
        """Tell what there is."""
        first = next((row.sample.ts for _, row in sorted(self.rows.items())), None)
        outbox.backlog.spool.update(len(self.rows), first)

    def opened(self, outbox: Outbox) -> None:
        """Begin with an outbox of the next life."""
        self.tell(outbox)
        outbox.backlog.spool.more = bool(self.rows)
        for loss in self.losses:
            outbox.backlog.losses.restore(loss)


def connect(outbox: Outbox, now: float) -> None:
    outbox.connected(now)
    outbox.burst([], ONLINE)
    while not outbox.announced:
        item = outbox.next(now)
        assert item is not None
        outbox.on_ack(item, now)


def seqs(item: OutboxItem | None) -> list[int]:
    assert item is not None
    return [queued.sample.seq for queued in samples_of(item)]


def away(count: int, store: MemoryStore) -> Outbox:
    """Return an outbox whose samples of 0.0 s are all in the store."""
    outbox = Outbox()
    for seq in range(1, count + 1):
        outbox.add(sample(seq), 0.0)
    while store.spill(outbox, 4.0):
        pass
    return outbox
