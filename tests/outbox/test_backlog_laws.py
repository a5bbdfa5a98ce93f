"""Whatever happens to broker and store, each sample arrives or is declared."""

from __future__ import annotations

from itertools import pairwise

from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, precondition, rule

from lfs10d.outbox.backlog import HISTORY_AFTER
from lfs10d.outbox.items import HistoryBatch, LossNotice, OutboxItem, samples_of
from lfs10d.outbox.losses import DECLARED_EVERY, Loss
from lfs10d.outbox.outbox import Outbox
from tests.support.backlogs import NOT_AUTHORIZED, QUOTA_EXCEEDED, MemoryStore, connect, sample

# Laws


class PastLaws(RuleBasedStateMachine):
    """Whatever happens to broker, disk and daemon: every sample is delivered or declared, and in order.

    None is delivered twice but where a connection was lost within 10 s of its acknowledgement.
    """

    CAPACITY = 20
    ROOM = 40

    def __init__(self) -> None:
        super().__init__()
        self.store = MemoryStore(room=self.ROOM)
        self.now = 0.0
        self.life = 0
        self.online = False
        self.measured: set[tuple[str, str, int]] = set()
        self.delivered: dict[tuple[str, str, int], list[float]] = {}
        self.declared: list[Loss] = []
        self.losses_at: list[float] = []
        self.connects_at: list[float] = []
        self.begin()

    def begin(self) -> None:
        self.life += 1
        self.outbox = Outbox(capacity=self.CAPACITY, detection=1.0)
        self.store.opened(self.outbox)
        self.seqs = {"a": 0, "b": 0}

    @rule(device=st.sampled_from("ab"), count=st.integers(1, 12))
    def measure(self, device: str, count: int) -> None:
        for _ in range(count):
            self.seqs[device] += 1
            self.outbox.add(sample(self.seqs[device], device, boot=f"k{self.life:04}"), self.now)
            self.measured.add((device, f"k{self.life:04}", self.seqs[device]))

    @rule(seconds=st.sampled_from([0.1, 1.0, 3.5, 6.0, 12.0, 70.0]))
    def wait(self, seconds: float) -> None:
        self.now += seconds
        self.keep()

    def keep(self) -> None:
        while self.store.spill(self.outbox, self.now) and not self.store.broken:
            pass
        self.store.release(self.outbox, self.now)
        self.store.page(self.outbox, self.now)

    @rule(broken=st.booleans())
    def disk(self, broken: bool) -> None:  # noqa: FBT001 - drawn by hypothesis
        self.store.broken = broken

    @precondition(lambda self: not self.online)
    @rule()
    def connect(self) -> None:
        connect(self.outbox, self.now)
        self.connects_at.append(self.now)
        self.online = True

    @precondition(lambda self: self.online)
    @rule()
    def lose(self) -> None:
        self.outbox.lost(self.now)
        self.losses_at.append(self.now)
        self.online = False

    @precondition(lambda self: self.online and len(self.outbox._in_flight) > 0)
    @rule(denied=st.booleans())
    def throw_out(self, denied: bool) -> None:  # noqa: FBT001 - drawn by hypothesis
        """End the connection for what is under way, as the broker does."""
        sent = {item.topic: 100 for item in self.outbox._in_flight}
        self.outbox.lost(self.now, self.outbox.suspects.ended(sent, certain=denied), denied=denied)
        self.losses_at.append(self.now)
        self.online = False

    @precondition(lambda self: not self.online and not self.store.broken)
    @rule()
    def restart(self) -> None:
        """End in order while the broker is away, and begin anew."""
        self.outbox.age(float("inf"))
        while self.outbox.backlog.spill.at_last:
            self.store.take(self.outbox, self.now)
        self.store.losses = tuple(self.outbox.backlog.undeclared())
        gone = self.outbox.backlog.spool.releasing(self.now)
        for number in gone:
            self.store.rows.pop(number, None)
        self.begin()

    @precondition(lambda self: self.online)
    @rule(fate=st.sampled_from(["settled", "settled", "settled", "settled", "refused", "denied", "unfit", "nothing"]))
    def go(self, fate: str) -> None:
        item = self.outbox.next(self.now)
        if item is None or fate == "nothing":
            return
        if fate == "refused":
            self.outbox.refused(item, QUOTA_EXCEEDED, self.now)
        elif fate == "denied":
            self.outbox.refused(item, NOT_AUTHORIZED, self.now)
        elif fate == "unfit":
            self.outbox.unfit(item)
        else:
            self.settle(item)

    def settle(self, item: OutboxItem) -> None:
        if isinstance(item, HistoryBatch):
            queued = [(each.sample.boot, each.sample.seq) for each in item.samples]
            assert queued == sorted(set(queued))
            assert len({each.key for each in item.samples}) == 1
        self.outbox.on_ack(item, self.now)
        for each in samples_of(item):
            key = (each.sample.device, each.sample.boot, each.sample.seq)
            self.delivered.setdefault(key, []).append(self.now)
        if isinstance(item, LossNotice):
            self.declared.append(item.loss)

    @invariant()
    def memory_is_bounded(self) -> None:
        in_memory = self.outbox.depth - self.outbox.backlog.spool.depth
        assert in_memory <= self.CAPACITY + sum(len(samples_of(each)) for each in self.outbox._in_flight)
        assert len(self.store.rows) <= self.ROOM + 7

    def teardown(self) -> None:
        """Let everything go: then all is accounted for."""
        self.store.broken = False
        if not self.online:
            connect(self.outbox, self.now)
        for item in tuple(self.outbox._in_flight):
            self.settle(item)
        self.outbox.reload(self.now)
        self.now += HISTORY_AFTER + DECLARED_EVERY
        for _ in range(3000):
            self.keep()
            taken = self.outbox.next(self.now)
            if taken is not None:
                self.settle(taken)
                continue
            due = [each for each in (self.outbox.due(), self.outbox.backlog.spool.release_due()) if each is not None]
            if not due and self.outbox.backlog.page_due() is None:
                break
            self.now = max([self.now, *due[:1]]) if self.outbox.due() is not None else self.now + 1.0
        assert self.outbox.depth == 0
        assert not self.store.rows
        covered = {
            (loss.source, loss.boot, seq) for loss in self.declared for seq in range(loss.from_seq, loss.to_seq + 1)
        }
        assert self.measured <= set(self.delivered) | covered
        assert set(self.delivered) <= self.measured
        count = sum(loss.count for loss in self.declared)
        assert count >= len(self.measured - set(self.delivered))
        if self.life == 1:  # a new life does not know what was acknowledged shortly before
            assert count == len(self.measured - set(self.delivered)) == self.outbox.stats.dropped
        for times in self.delivered.values():
            for before, after in pairwise(times):
                # A loss between the two, not longer than 10 s and the time to notice it after the first; or a
                # reconnect not longer than 10 s before the first.
                lately = any(before - HISTORY_AFTER <= connected <= before for connected in self.connects_at[1:])
                assert lately or any(before - HISTORY_AFTER - 13 <= lost <= after for lost in self.losses_at)


PastLaws.TestCase.settings = settings(max_examples=150, stateful_step_count=60, deadline=None)

TestPastLaws = PastLaws.TestCase
