"""The part of the backlog that lies in the store: pages, second sending, letting go."""

from __future__ import annotations

from lfs10d.outbox.history import QueuedSample
from lfs10d.outbox.recent_acks import AGAIN_WITHIN
from lfs10d.outbox.spool import RELEASE_EVERY, RELEASE_MOST, Spool
from lfs10d.outbox.store.sample_file import StoredRow
from lfs10d.telemetry.publication import Sample


def row(number: int, *, repeated: bool = False) -> StoredRow:
    sample = Sample("a", "k", number, 1000 * number, "synced", None, {}, (), "bad", "timeout", None)
    return StoredRow(number, sample, None, repeated)


def rows(first: int, last: int) -> list[StoredRow]:
    return [row(number) for number in range(first, last + 1)]


def filled(count: int) -> Spool:
    """Return what is known of a store of so many rows, of which the whole is taken as a page."""
    spool = Spool(rows=count, oldest_ts=1000, more=True)
    spool.take_page(rows(1, count), count + 1)
    return spool


def ids(queued: tuple[QueuedSample, ...]) -> list[int | None]:
    return [each.row for each in queued]


def test_a_page_goes_in_order_and_a_short_one_is_the_last() -> None:
    spool = Spool(rows=5, more=True)
    spool.take_page(rows(1, 3), 3)
    assert (spool.more, spool.after) == (True, 3)
    assert ids(spool.page.take(9)) == [1, 2, 3]
    spool.take_page(rows(4, 5), 3)
    assert (spool.more, spool.after) == (False, 5)


def test_what_is_passed_over_is_read_again_and_nothing_else() -> None:
    spool = filled(6)
    spool.read_again(())
    assert (spool.after, spool.turn) == (6, 0), "nothing was passed over"
    acknowledged, under_way = spool.page.take(1), spool.page.take(2)
    assert (ids(acknowledged), ids(under_way)) == ([1], [2, 3])
    spool.on_ack([1], 0.0)
    spool.leave()
    assert (spool.left, spool.depth, spool.more) == (True, 5, False)
    spool.read_again([2, 3])
    assert (spool.left, spool.after, spool.more, spool.turn) == (False, 0, True, 1)
    spool.take_page(rows(1, 6), 9)
    assert ids(spool.page.take(9)) == [4, 5, 6]
    spool.rewind()
    spool.take_page(rows(1, 6), 9)
    assert ids(spool.page.take(9)) == [1, 2, 3, 4, 5, 6]


def test_what_was_repeated_before_a_restart_is_known_as_such() -> None:
    spool = Spool(rows=1)
    spool.take_page([row(1, repeated=True)], 9)
    assert spool.page.take(1)[0].repeated


def test_acknowledged_rows_no_longer_count_and_leave_ten_seconds_later_in_batches() -> None:
    spool = filled(6)
    spool.page.take(4)
    spool.on_ack([1, 2], 100.0)
    spool.on_ack([3, 4], 100.1)
    assert spool.depth == 2
    assert spool.release_due() == 100.0 + AGAIN_WITHIN
    assert spool.releasing(110.05) == {1, 2}
    spool.deleted(frozenset({1, 2}))
    spool.update(4, 3000)
    assert spool.depth == 2
    assert spool.release_due() == 110.05 + RELEASE_EVERY
    assert spool.releasing(115.1) == {3, 4}
    spool.deleted(frozenset({3, 4}))
    assert spool.release_due() is None


def test_after_a_loss_what_was_acknowledged_lately_is_read_and_sent_once_more() -> None:
    spool = filled(4)
    spool.page.take(3)
    spool.on_ack([1], 100.0)
    spool.on_ack([2], 105.0)
    spool.on_ack([3], 110.5)
    turn = spool.turn
    spool.rewind()
    assert (spool.after, spool.more, len(spool.page), spool.turn) == (0, True, 0, turn + 1)
    assert spool.depth == 3
    assert spool.delivered == {1, 2, 3}
    spool.take_page(rows(1, 4), 9)
    page = spool.page.take(9)
    assert ids(page) == [2, 3, 4]
    assert [queued.repeated for queued in page] == [True, True, False]


def test_nothing_is_read_again_where_the_store_is_empty() -> None:
    spool = Spool()
    spool.rewind()
    assert not spool.more


def test_much_is_let_go_in_several_batches_without_a_pause() -> None:
    spool = filled(RELEASE_MOST + 1)
    spool.release(range(1, RELEASE_MOST + 2))
    first = spool.releasing(0.0)
    spool.deleted(first)
    assert spool.release_due() == 0.0
    last = spool.releasing(0.0)
    spool.deleted(last)
    assert (len(first), len(last), spool.release_due()) == (RELEASE_MOST, 1, None)


def test_parting_in_order_lets_everything_go_that_was_acknowledged() -> None:
    spool = filled(3)
    spool.on_ack([1, 2], 100.0)
    spool.release_all()
    assert spool.releasing(100.0) == {1, 2}


def test_what_never_will_be_delivered_is_let_go_too() -> None:
    spool = filled(3)
    before = spool.letting_go
    spool.release([3])
    assert (before, spool.letting_go) == (False, True)
    assert spool.depth == 2
    assert spool.releasing(0.0) == {3}


def test_the_oldest_is_the_pages_first_else_the_stores_and_none_where_none_waits() -> None:
    spool = Spool(rows=2, oldest_ts=7)
    assert spool.oldest() == 7
    spool.take_page(rows(1, 2), 9)
    assert spool.oldest() == 1000
    spool.on_ack(ids_of(spool.page.take(2)), 0.0)
    assert spool.oldest() is None


def ids_of(queued: tuple[QueuedSample, ...]) -> list[int]:
    return [each.row for each in queued if each.row is not None]
