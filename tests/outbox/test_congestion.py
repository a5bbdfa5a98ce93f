"""Whether the window carries less than is published."""

from __future__ import annotations

import pytest

from lfs10d.outbox.congestion import PERIOD, PERIODS, REPORTED_EVERY, Congested, Congestion


def congest(congestion: Congestion, now: float, periods: int = PERIODS) -> float:
    """Let something be displaced in so many periods; return when the last ended."""
    for _ in range(periods):
        congestion.displaced(now)
        congestion.displaced(now + 1.0)
        now += PERIOD
    return now


def test_three_periods_in_a_row_are_reported_once_with_what_the_window_carries() -> None:
    congestion = Congestion()
    congestion.answered(0.9)
    now = congest(congestion, 0.0, PERIODS - 1)
    assert congestion.report(now, 20) is None
    now = congest(congestion, now, 1)
    told = congestion.report(now, 20)
    assert told == Congested(0.9, 20)
    assert told.rate == pytest.approx(22.2, abs=0.1)
    now = congest(congestion, now)
    assert congestion.report(now, 20) is None
    now = congest(congestion, now + REPORTED_EVERY)
    assert congestion.report(now, 20) is not None


def test_periods_that_are_not_in_a_row_are_not_reported() -> None:
    congestion = Congestion()
    congestion.answered(0.9)
    now = congest(congestion, 0.0, PERIODS - 1)
    congest(congestion, now + PERIOD, PERIODS - 1)
    assert congestion.report(now, 20) is None


def test_another_connection_begins_anew() -> None:
    congestion = Congestion()
    congestion.answered(0.9)
    now = congest(congestion, 0.0)
    congestion.connected()
    assert congestion.report(now, 20) is None
    now = congest(congestion, now)
    assert congestion.report(now, 20) is None  # nothing was acknowledged yet
    congestion.answered(0.1)
    assert congestion.report(now, 10) == Congested(0.1, 10)


def test_the_round_trip_is_a_mean_in_which_one_of_many_counts_little() -> None:
    congestion = Congestion()
    for _ in range(50):
        congestion.answered(0.2)
    congestion.answered(1.0)
    congest(congestion, 0.0)
    told = congestion.report(30.0, 10)
    assert told is not None
    assert told.round_trip == pytest.approx(0.3)
