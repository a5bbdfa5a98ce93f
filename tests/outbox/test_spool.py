"""The part of the backlog that lies in the store: pages, second sending, letting go."""

from __future__ import annotations

from lfs10d.outbox.history import QueuedSample
from lfs10d.outbox.spool import AGAIN_WITHIN, RELEASE_EVERY, RELEASE_MOST, Spool
from lfs10d.outbox.store.sample_file import StoredRow
from lfs10d.telemetry.publication import Sample


def row(number: int, *, repeated: bool = False) -> StoredRow:
    sample = Sample("a", "k", number, 1000 * number, "synced", None, {}, (), "bad", "timeout", None)
    return StoredRow(number, sample, None, repeated)


def rows(first: int, last: int) -> list[StoredRow]:
    return [row(number) for number in range(first, last + 1)]


def filled(count: int) -> Spool:
    """Return what is known of a store of so many rows, of which the whole is taken as a page."""
    stored = Spool(rows=count, oldest_ts=1000, more=True)
    stored.take_page(rows(1, count), count + 1)
    return stored


def ids(kept: tuple[QueuedSample, ...]) -> list[int | None]:
    return [each.row for each in kept]


def test_a_page_goes_in_order_and_a_short_one_is_the_last() -> None:
    stored = Spool(rows=5, more=True)
    stored.take_page(rows(1, 3), 3)
    assert (stored.more, stored.after) == (True, 3)
    assert ids(stored.page.take(9)) == [1, 2, 3]
    stored.take_page(rows(4, 5), 3)
    assert (stored.more, stored.after) == (False, 5)


def test_what_is_passed_over_is_read_again_and_nothing_else() -> None:
    stored = filled(6)
    stored.read_again(())
    assert (stored.after, stored.turn) == (6, 0), "nothing was passed over"
    acknowledged, under_way = stored.page.take(1), stored.page.take(2)
    assert (ids(acknowledged), ids(under_way)) == ([1], [2, 3])
    stored.settled([1], 0.0)
    stored.leave()
    assert (stored.left, stored.depth, stored.more) == (True, 5, False)
    stored.read_again([2, 3])
    assert (stored.left, stored.after, stored.more, stored.turn) == (False, 0, True, 1)
    stored.take_page(rows(1, 6), 9)
    assert ids(stored.page.take(9)) == [4, 5, 6]
    stored.rewind()
    stored.take_page(rows(1, 6), 9)
    assert ids(stored.page.take(9)) == [1, 2, 3, 4, 5, 6]


def test_what_was_repeated_before_a_restart_is_known_as_such() -> None:
    stored = Spool(rows=1)
    stored.take_page([row(1, repeated=True)], 9)
    assert stored.page.take(1)[0].repeated


def test_acknowledged_rows_no_longer_count_and_leave_ten_seconds_later_in_batches() -> None:
    stored = filled(6)
    stored.page.take(4)
    stored.settled([1, 2], 100.0)
    stored.settled([3, 4], 100.1)
    assert stored.depth == 2
    assert stored.release_due() == 100.0 + AGAIN_WITHIN
    assert stored.releasing(110.05) == {1, 2}
    stored.deleted(frozenset({1, 2}))
    stored.told(4, 3000)
    assert stored.depth == 2
    assert stored.release_due() == 110.05 + RELEASE_EVERY
    assert stored.releasing(115.1) == {3, 4}
    stored.deleted(frozenset({3, 4}))
    assert stored.release_due() is None


def test_after_a_loss_what_was_acknowledged_lately_is_read_and_sent_once_more() -> None:
    stored = filled(4)
    stored.page.take(3)
    stored.settled([1], 100.0)
    stored.settled([2], 105.0)
    stored.settled([3], 110.5)
    turn = stored.turn
    stored.rewind()
    assert (stored.after, stored.more, len(stored.page), stored.turn) == (0, True, 0, turn + 1)
    assert stored.depth == 3
    assert stored.delivered == {1, 2, 3}
    stored.take_page(rows(1, 4), 9)
    page = stored.page.take(9)
    assert ids(page) == [2, 3, 4]
    assert [kept.repeated for kept in page] == [True, True, False]


def test_nothing_is_read_again_where_the_store_is_empty() -> None:
    stored = Spool()
    stored.rewind()
    assert not stored.more


def test_much_is_let_go_in_several_batches_without_a_pause() -> None:
    stored = filled(RELEASE_MOST + 1)
    stored.release(range(1, RELEASE_MOST + 2))
    first = stored.releasing(0.0)
    stored.deleted(first)
    assert stored.release_due() == 0.0
    last = stored.releasing(0.0)
    stored.deleted(last)
    assert (len(first), len(last), stored.release_due()) == (RELEASE_MOST, 1, None)


def test_parting_in_order_lets_everything_go_that_was_acknowledged() -> None:
    stored = filled(3)
    stored.settled([1, 2], 100.0)
    stored.release_all()
    assert stored.releasing(100.0) == {1, 2}


def test_what_never_will_be_delivered_is_let_go_too() -> None:
    stored = filled(3)
    before = stored.letting_go
    stored.release([3])
    assert (before, stored.letting_go) == (False, True)
    assert stored.depth == 2
    assert stored.releasing(0.0) == {3}


def test_the_oldest_is_the_pages_first_else_the_stores_and_none_where_none_waits() -> None:
    stored = Spool(rows=2, oldest_ts=7)
    assert stored.oldest() == 7
    stored.take_page(rows(1, 2), 9)
    assert stored.oldest() == 1000
    stored.settled(ids_of(stored.page.take(2)), 0.0)
    assert stored.oldest() is None


def ids_of(kept: tuple[QueuedSample, ...]) -> list[int]:
    return [each.row for each in kept if each.row is not None]
