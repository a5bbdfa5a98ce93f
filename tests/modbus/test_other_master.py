"""When another master on the line asks a slave, and so when we had better not."""

from __future__ import annotations

import pytest

from lfs10d.modbus.other_master import FORGOTTEN, KEPT, OURS, OtherMaster

EVERY = 0.2
TOOK = 0.04


def asking(count: int = 4, every: float = EVERY, took: float = TOOK) -> OtherMaster:
    """Return one that asks slave 2 at 0 s, 0.2 s and so on, and is answered 40 ms later."""
    other = OtherMaster()
    for n in range(count):
        other.asked(2, n * every)
        other.answered(2, n * every + took)
    return other


LAST = 3 * EVERY


@pytest.mark.parametrize(
    ("behind", "waits_until"),
    [(0.0, TOOK), (0.03, TOOK), (TOOK, None), (0.1, None), (EVERY - OURS * TOOK + 0.001, EVERY + TOOK)],
)
def test_a_request_waits_for_the_pause_in_which_it_is_over(behind: float, waits_until: float | None) -> None:
    until = asking().busy_until(2, LAST + behind)
    assert until == (None if waits_until is None else pytest.approx(LAST + waits_until))


def test_the_rhythm_goes_on_where_its_requests_are_not_heard() -> None:
    other = asking()
    assert other.busy_until(2, LAST + 3 * EVERY + 0.01) == pytest.approx(LAST + 3 * EVERY + TOOK)
    assert other.busy_until(2, LAST + 3 * EVERY + 0.1) is None


def test_of_requests_that_were_not_all_heard_the_shortest_pause_counts() -> None:
    other = OtherMaster()
    for at in (0.0, 0.4, 0.6, 1.2):
        other.asked(2, at)
    other.answered(2, 1.2 + TOOK)
    assert other.busy_until(2, 1.39) == pytest.approx(1.4 + TOOK)


def test_a_slower_rhythm_counts_after_a_few_requests() -> None:
    other = asking()
    for n in range(KEPT):
        other.asked(2, 10.0 + n)
    assert other.busy_until(2, 15.2) is None
    assert other.busy_until(2, 15.99) == pytest.approx(16.0 + TOOK)


def test_where_nothing_is_known_or_the_pause_is_too_short_nothing_waits() -> None:
    assert asking(1).busy_until(2, 0.01) is None
    assert asking(every=0.09).busy_until(2, 0.28) is None
    assert asking().busy_until(3, LAST) is None
    unanswered = OtherMaster()
    unanswered.answered(2, 0.1)
    for at in (0.0, 0.2):
        unanswered.asked(2, at)
    assert unanswered.busy_until(2, 0.21) is None


def test_one_that_is_gone_is_forgotten() -> None:
    other = asking()
    assert other.busy_until(2, LAST + FORGOTTEN + 0.001) is None
    other.asked(2, 10.0)
    assert other.busy_until(2, 10.001) is None
