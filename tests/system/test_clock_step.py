"""When a time is corrected that nobody vouched for."""

from __future__ import annotations

import pytest

from lfs10d.system.clock_step import STEP_MS, ClockState, corrects, stepped


@pytest.mark.parametrize(("by", "set_"), [(0, 0), (300, 0), (STEP_MS - 1, 0), (STEP_MS, 1), (400 * 86_400_000, 1)])
def test_a_clock_that_moves_far_at_once_has_been_set(by: int, set_: int) -> None:
    for shift in (by, -by):
        assert stepped(5, 5 + shift) == bool(set_)


@pytest.mark.parametrize(
    ("then", "now", "by", "corrected"),
    [
        ("synced", "synced", 10**9, 0),
        ("synced", "unsynced", 10**9, 0),
        ("unsynced", "synced", 0, 1),
        ("unknown", "synced", 0, 1),
        ("unknown", "unsynced", 0, 0),
        ("unknown", "unsynced", 10**9, 1),
        ("unsynced", "unsynced", -(10**9), 1),
    ],
)
def test_only_a_clock_nobody_vouched_for_is_corrected_by_a_better_one(
    then: ClockState, now: ClockState, by: int, corrected: int
) -> None:
    assert corrects(then, 7, 7 + by, now) == bool(corrected)
