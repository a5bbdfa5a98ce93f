"""How much of the window the history takes."""

from __future__ import annotations

import pytest

from lfs10d.outbox.drain import LEVEL_MOST, LOOK_BATCHES, LOOK_EVERY, Drain


def look(drain: Drain, now: float, depth: int, *, full: bool = True) -> int:
    """Settle as many batches as a look wants, and return the level after it."""
    drain.taken(full=full)
    for _ in range(LOOK_BATCHES):
        if drain.on_ack(now):
            drain.look(now, depth)
    return drain.level


def test_the_level_doubles_while_the_backlog_does_not_shrink() -> None:
    drain = Drain()
    drain.begin(0.0)
    depths = (100, 100, 110, 120, 130)
    assert [look(drain, LOOK_EVERY * (number + 1), depth) for number, depth in enumerate(depths)] == [1, 2, 4, 8, 8]
    assert drain.level == LEVEL_MOST


def test_the_level_stays_while_the_backlog_shrinks() -> None:
    drain = Drain()
    drain.begin(0.0)
    assert [look(drain, 5.0, 100), look(drain, 10.0, 100), look(drain, 15.0, 99), look(drain, 20.0, 98)] == [1, 2, 2, 2]


def test_where_batches_are_not_full_the_level_is_halved() -> None:
    drain = Drain()
    drain.begin(0.0)
    for number in range(4):
        look(drain, 5.0 * (number + 1), 100)
    assert [look(drain, 25.0 + 5.0 * number, 500, full=False) for number in range(4)] == [4, 2, 1, 1]


def test_it_is_looked_at_after_five_seconds_and_four_batches() -> None:
    drain = Drain()
    drain.begin(0.0)
    assert [drain.on_ack(1.0) for _ in range(6)] == [False] * 6
    assert drain.on_ack(LOOK_EVERY)
    drain.look(LOOK_EVERY, 1)
    assert [drain.on_ack(2 * LOOK_EVERY) for _ in range(LOOK_BATCHES)] == [False, False, False, True]


def test_another_connection_begins_at_level_one() -> None:
    drain = Drain()
    drain.begin(0.0)
    look(drain, 5.0, 1)
    look(drain, 10.0, 1)
    drain.begin(100.0)
    assert drain.level == 1
    assert look(drain, 105.0, 10) == 1


@pytest.mark.parametrize(
    ("level", "window", "batches"), [(1, 20, 1), (2, 20, 5), (4, 20, 10), (8, 20, 20), (2, 1, 1), (8, 1, 1)]
)
def test_batches_under_way(level: int, window: int, batches: int) -> None:
    drain = Drain()
    drain.level = level
    assert drain.batches(window) == batches
