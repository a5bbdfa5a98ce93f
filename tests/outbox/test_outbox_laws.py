"""Whatever happens to the outbox, no sample is lost without being declared."""

from __future__ import annotations

from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, precondition, rule

from lfs10d.outbox.backlog import BATCH_MOST, HISTORY_AFTER
from lfs10d.outbox.items import HistoryBatch, LiveSample, LossNotice, samples_of
from lfs10d.outbox.live_queue import LIVE_FOR
from lfs10d.outbox.losses import DECLARED_EVERY, Loss
from lfs10d.outbox.outbox import Outbox
from tests.support.outboxes import (
    NOT_AUTHORIZED,
    QUOTA_EXCEEDED,
    connect,
    end,
    sample,
    under_way,
)

# Laws


class OutboxLaws(RuleBasedStateMachine):
    """Whatever happens: nothing is lost undeclared, order holds, bounds hold."""

    CAPACITY = 30
    WINDOW = 5

    def __init__(self) -> None:
        super().__init__()
        self.outbox = Outbox(capacity=self.CAPACITY)
        self.now = 0.0
        self.online = False
        self.seqs = {"a": 0, "b": 0}
        self.delivered: set[tuple[str, int]] = set()
        self.declared: list[Loss] = []
        self.last_live = {"a": 0, "b": 0}

    @rule(device=st.sampled_from("ab"), count=st.integers(1, 15))
    def measure(self, device: str, count: int) -> None:
        for _ in range(count):
            self.seqs[device] += 1
            self.outbox.add(sample(self.seqs[device], device), self.now)

    @rule(seconds=st.sampled_from([0.01, 0.2, 2.0, 4.0, 11.0, 70.0]))
    def wait(self, seconds: float) -> None:
        self.now += seconds

    @precondition(lambda self: not self.online)
    @rule()
    def connect(self) -> None:
        connect(self.outbox, self.now, window=self.WINDOW)
        self.online = True

    @precondition(lambda self: self.online)
    @rule()
    def lose(self) -> None:
        self.outbox.lost(self.now)
        self.online = False

    @precondition(lambda self: self.online)
    @rule(denied=st.booleans())
    def throw_out(self, denied: bool) -> None:  # noqa: FBT001 - drawn by hypothesis
        """End the connection for what is under way, as the broker does."""
        end(self.outbox, self.now, under_way(self.outbox), denied=denied)
        self.online = False

    @rule()
    def take(self) -> None:
        item = self.outbox.next(self.now)
        if item is None:
            return
        assert self.online
        queued = samples_of(item)
        assert [each.sample.seq for each in queued] == sorted({each.sample.seq for each in queued})
        assert len({each.key for each in queued}) <= 1
        if isinstance(item, LiveSample):
            assert self.now - item.queued.since <= LIVE_FOR
        if isinstance(item, HistoryBatch):
            assert len(queued) <= BATCH_MOST

    @precondition(lambda self: len(self.outbox._in_flight) > 0)
    @rule(
        which=st.integers(0, 4), fate=st.sampled_from(["settled", "settled", "settled", "refused", "denied", "unfit"])
    )
    def answer(self, which: int, fate: str) -> None:
        item = tuple(self.outbox._in_flight)[which % len(self.outbox._in_flight)]
        if fate == "settled":
            self.outbox.on_ack(item, self.now)
            self.delivered |= {(each.sample.device, each.sample.seq) for each in samples_of(item)}
            if isinstance(item, LossNotice):
                self.declared.append(item.loss)
        elif fate == "refused":
            self.outbox.refused(item, QUOTA_EXCEEDED, self.now)
        elif fate == "denied":
            self.outbox.refused(item, NOT_AUTHORIZED, self.now)
        else:
            self.outbox.unfit(item)

    @invariant()
    def bounds_hold(self) -> None:
        assert self.outbox.depth <= self.CAPACITY
        assert len(self.outbox._in_flight) <= self.WINDOW
        # Arrays may be several (contract, section 3: one at least every 2 s, however long the round trip is).
        assert sum(isinstance(each, LossNotice) for each in self.outbox._in_flight) <= 1

    def teardown(self) -> None:
        """Drain: then every sample was delivered or declared, and the declared count is right."""
        if not self.online:
            connect(self.outbox, self.now, window=self.WINDOW)
        for item in tuple(self.outbox._in_flight):
            self.outbox.on_ack(item, self.now)
            self.delivered |= {(each.sample.device, each.sample.seq) for each in samples_of(item)}
            if isinstance(item, LossNotice):
                self.declared.append(item.loss)
        self.outbox.reload(self.now)
        self.now += HISTORY_AFTER + DECLARED_EVERY
        for _ in range(1000):
            taken = self.outbox.next(self.now)
            if taken is not None:
                self.outbox.on_ack(taken, self.now)
                self.delivered |= {(each.sample.device, each.sample.seq) for each in samples_of(taken)}
                if isinstance(taken, LossNotice):
                    self.declared.append(taken.loss)
                continue
            due = self.outbox.due()
            if due is None:
                break
            self.now = max(self.now, due)
        assert self.outbox.depth == 0
        covered = {(loss.source, seq) for loss in self.declared for seq in range(loss.from_seq, loss.to_seq + 1)}
        measured = {(device, seq) for device, last in self.seqs.items() for seq in range(1, last + 1)}
        assert self.delivered | covered == measured
        assert sum(loss.count for loss in self.declared) == self.outbox.stats.dropped


OutboxLaws.TestCase.settings = settings(max_examples=60, stateful_step_count=40, deadline=None)


TestOutboxLaws = OutboxLaws.TestCase
