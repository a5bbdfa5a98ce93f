"""Which item goes next, and where an item waits again."""

from __future__ import annotations

import pytest

from lfs10d.outbox.backlog import HISTORY_AFTER, Backlog
from lfs10d.outbox.history import QueuedSample
from lfs10d.outbox.items import HistoryBatch, LossNotice
from lfs10d.outbox.losses import Loss
from lfs10d.outbox.queues import BURST_FIRST, Queues
from lfs10d.outbox.refusals import Refusals
from lfs10d.outbox.suspects import Culprit, Suspects
from lfs10d.telemetry import publication
from tests.support.outbox_items import batch, event, live, queued, record, retained, trace

NOT_AUTHORIZED = 0x87
QUOTA = 0x97


class Waiting:
    """Queues whose backlog is open."""

    def __init__(self) -> None:
        self.refusals = Refusals()
        self.suspects = Suspects()
        self.backlog = Backlog(capacity=100, detection=40.0)
        self.backlog.connected(-HISTORY_AFTER, 20)
        self.queues = Queues(self.backlog, self.refusals, self.suspects)
        self.queues.connected(0.0)


@pytest.fixture
def waiting() -> Waiting:
    """Give queues in which nothing waits."""
    return Waiting()


def test_changes_messages_and_live_samples_go_before_history_until_the_window_was_full(waiting: Waiting) -> None:
    queues = waiting.queues
    assert not queues
    assert queues.next(0.0, batch=True) is None
    waiting.backlog.history.add(queued("h", 1))
    sample, message = live("a", 1), event("x")
    queues.messages.traces.append(trace())
    queues.live.add(sample)
    queues.messages.messages.append(message)
    queues.retained.add(publication.retained("line/error", {}), 0.0)
    assert queues
    first = queues.next(0.0, batch=True)
    assert first is not None
    assert first.topic == "line/error"
    queues.full()
    assert [queues.next(0.0, batch=True), queues.next(0.0, batch=True)] == [message, sample]
    assert isinstance(queues.next(0.0, batch=True), HistoryBatch)


def test_refreshes_traces_and_what_clears_a_topic_go_last(waiting: Waiting) -> None:
    queues, trace_line = waiting.queues, trace()
    queues.retained.add(publication.retained("device/gone/state", None), 0.0)
    queues.messages.traces.append(trace_line)
    queues.retained.add(publication.retained("device/a/state", {}, refresh=True), 0.0)
    assert queues
    went = [queues.next(0.0, batch=True) for _ in range(3)]
    assert [each.topic for each in went if each is not None] == [
        "device/a/state",
        trace_line.topic,
        "device/gone/state",
    ]
    assert not queues
    assert queues.next(0.0, batch=True) is None


def test_when_all_has_gone_the_first_classes_go_before_the_others_again(waiting: Waiting) -> None:
    queues = waiting.queues
    queues.full()
    assert queues.next(0.0, batch=True) is None
    first, second = trace(), event("x")
    queues.messages.traces.append(first)
    queues.messages.messages.append(second)
    assert [queues.next(0.0, batch=True), queues.next(0.0, batch=True)] == [second, first]


def test_no_history_while_the_batch_before_is_not_on_its_way_or_samples_are_not_wanted(waiting: Waiting) -> None:
    waiting.backlog.history.add(queued("h", 1))
    assert waiting.queues.next(0.0, batch=False) is None
    assert waiting.queues.due() is not None
    waiting.backlog.telemetry = False
    assert waiting.queues.next(0.0, batch=True) is None
    assert waiting.queues.due() is None


def test_records_go_though_samples_are_not_wanted(waiting: Waiting) -> None:
    waiting.backlog.telemetry = False
    waiting.backlog.history.add(queued("h", 1))
    waiting.backlog.history.add(QueuedSample(record(1, "h"), 5.0))
    assert waiting.queues.due() is not None
    batch = waiting.queues.next(0.0, batch=True)
    assert isinstance(batch, HistoryBatch)
    assert batch.topic == "device/h/record"
    assert waiting.queues.next(10.0, batch=True) is None


def test_a_burst_keeps_everything_else_back_for_ten_seconds(waiting: Waiting) -> None:
    queues, sample = waiting.queues, live("a", 1)
    queues.live.add(sample)
    queues.retained.burst([publication.retained("state", {})], publication.retained("availability", "online"))
    first = queues.next(0.0, batch=True)
    assert first is not None
    assert first.topic == "state"
    assert queues.next(BURST_FIRST - 0.1, batch=True) is None
    assert queues.next(BURST_FIRST, batch=True) is sample


def test_a_live_sample_of_a_refused_topic_waits_with_the_backlog(waiting: Waiting) -> None:
    sample, other = live("a", 1), live("b", 1)
    waiting.refusals.refused(sample.topic, NOT_AUTHORIZED, 0.0)
    waiting.queues.live.add(sample)
    waiting.queues.live.add(other)
    assert waiting.queues.next(0.0, batch=False) is other
    assert len(waiting.backlog.history) == 1
    waiting.queues.live.add(live("a", 2))
    assert waiting.queues.next(0.0, batch=False) is None
    assert len(waiting.backlog.history) == 2


def test_what_is_refused_waits_in_its_place(waiting: Waiting) -> None:
    for item in (retained("line/error"), event("x"), live("a", 1), batch("b", 1)):
        waiting.queues.refused(item)
    assert waiting.queues.retained
    assert len(waiting.backlog.history) == 2
    assert not waiting.queues.messages
    waiting.queues.refused(LossNotice(Loss("a", "k", 1, 2, 2)))
    assert waiting.backlog.losses.undeclared() == [Loss("a", "k", 1, 2, 2)]


def test_what_was_under_way_at_a_loss_waits_in_its_place_and_the_burst_is_forgotten(waiting: Waiting) -> None:
    queues = waiting.queues
    queues.retained.add(publication.retained("line/error", {}), 0.0)
    queues.messages.traces.append(trace())
    queues.lost()
    assert not queues
    for item in (retained("gone", None), event("x"), live("a", 1), batch("b", 1)):
        queues.put_back(item)
    assert (bool(queues.retained), len(queues.messages.messages), len(queues.live)) == (True, 1, 1)
    assert len(waiting.backlog.history) == 1


def test_a_topic_is_tried_again_when_its_time_has_come(waiting: Waiting) -> None:
    message = event("x")
    assert waiting.queues.due() is None
    waiting.refusals.refused("event", QUOTA, 0.0)
    assert waiting.queues.due() == 1.0
    waiting.queues.refused(message)
    waiting.queues.lift_due(0.5)
    assert waiting.queues.next(0.5, batch=True) is None
    waiting.queues.lift_due(1.0)
    assert waiting.queues.next(1.0, batch=True) is message


def test_a_reload_tries_everything_again(waiting: Waiting) -> None:
    message = event("x")
    assert not waiting.queues.reload(0.0)
    waiting.refusals.refused("event", NOT_AUTHORIZED, 0.0)
    waiting.queues.refused(message)
    assert waiting.queues.reload(0.0)
    assert waiting.queues.next(0.0, batch=True) is message


def test_a_batch_that_ends_the_connection_is_cut(waiting: Waiting) -> None:
    long, other = batch("a", 1, 2, 3, 4), event("x")
    assert waiting.queues.condemn(Culprit(long.topic, 900), [long, other], 0.0, denied=False) == [long, other]
    assert waiting.refusals.topics == set()


@pytest.mark.parametrize(("denied", "waits", "lost"), [(False, 1, 1), (True, 2, 0)])
def test_what_ends_the_connection_is_banned_and_its_samples_wait_unless_they_are_why(
    waiting: Waiting, *, denied: bool, waits: int, lost: int
) -> None:
    sample, other = live("a", 1), event("x")
    assert waiting.queues.condemn(Culprit(sample.topic, 90), [sample, other], 0.0, denied=denied) == [other]
    one = batch("a", 2)
    assert waiting.queues.condemn(Culprit(one.topic, 90), [one], 0.0, denied=denied) == []
    assert waiting.refusals.topics == {sample.topic, one.topic}
    assert (len(waiting.backlog.history), waiting.backlog.losses.total) == (waits, lost)


def test_a_loss_notice_that_ends_the_connection_waits(waiting: Waiting) -> None:
    notice = LossNotice(Loss("a", "k", 1, 2, 2))
    waiting.queues.condemn(Culprit("event", 90), [notice, event("x")], 0.0, denied=False)
    assert waiting.backlog.losses.undeclared() == [notice.loss]


def test_where_the_last_of_a_burst_is_refused_the_rest_goes_on(waiting: Waiting) -> None:
    sample = live("a", 1)
    waiting.refusals.refused("availability", NOT_AUTHORIZED, 0.0)
    waiting.queues.retained.burst([], publication.retained("availability", "online"))
    waiting.queues.live.add(sample)
    assert waiting.queues.next(0.0, batch=True) is sample
