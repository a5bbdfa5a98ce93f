"""The last hour of a value in steps."""

from __future__ import annotations

from lfs10d.web.curve import KEPT, STEP, Curve

T = 1_800_000_000.0


def test_a_step_has_mean_extremes_and_failed_polls() -> None:
    curve = Curve()
    for at, value in ((0.0, 5.0), (1.0, 7.0), (2.0, None), (3.9, 6.0)):
        curve.add(T + at, value)
    curve.add(T + STEP, 9.0)
    assert curve.recent(600) == [[int(T), 6.0, 5.0, 7.0, 1]]
    assert curve.points(0, curve.newest) == [[int(T), 6.0, 5.0, 7.0, 1], [int(T) + STEP, 9.0, 9.0, 9.0, 0]]


def test_a_step_of_failed_polls_has_no_value() -> None:
    curve = Curve()
    curve.add(T, None)
    curve.add(T, None)
    assert curve.points(0, curve.newest) == [[int(T), None, None, None, 2]]


def test_a_step_without_a_poll_is_absent() -> None:
    curve = Curve()
    curve.add(T, 1.0)
    curve.add(T + 10 * STEP, 2.0)
    assert [point[0] for point in curve.points(0, curve.newest)] == [int(T), int(T) + 10 * STEP]


def test_an_hour_is_kept_and_the_backlog_of_that_hour_fills_it() -> None:
    curve = Curve()
    curve.add(T, 1.0)
    curve.add(T + KEPT * STEP, 2.0)
    assert [point[0] for point in curve.points(0, curve.newest)] == [int(T) + KEPT * STEP]
    curve.add(T + STEP, 3.0)
    curve.add(T, 4.0)  # older than an hour: it would take the place of a newer step
    assert [point[1] for point in curve.points(0, curve.newest)] == [3.0, 2.0]


def test_nothing_at_all_is_an_empty_curve() -> None:
    assert Curve().recent(600) == []


def test_a_flood_within_one_step_does_not_overflow() -> None:
    curve = Curve()
    for _ in range(70_000):
        curve.add(T, 1.0)
    assert curve.points(0, curve.newest) == [[int(T), 1.0, 1.0, 1.0, 0]]
