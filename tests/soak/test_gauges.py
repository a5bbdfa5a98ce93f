"""What a leak looks like, and what is none."""

from __future__ import annotations

import os

import pytest

from soak.gauges import ALLOWED, JUDGED_FROM, POINTS_MOST, WARM_UP, Gauge, Point, read

HOURS = 8 * 3600


def life(seconds: int, **slopes: float) -> Gauge:
    """Return a life with a point a second in which figures grow by so much an hour."""
    gauge = Gauge()
    for at in range(seconds):
        figures = {what: 10.0 + slopes.get(what, 0.0) * at / 3600 for what in ALLOWED}
        gauge.add(Point(at, **figures))
    return gauge


def test_a_flat_life_is_flat() -> None:
    assert life(HOURS).grown() == []


@pytest.mark.parametrize("what", ALLOWED)
def test_what_leaks_is_told(what: str) -> None:
    (finding,) = life(HOURS, **{what: 2.0 * ALLOWED[what]}).grown()
    assert finding.startswith(f"{what} grew by ")


def test_the_warm_up_and_a_short_life_are_not_judged() -> None:
    short = life(int(WARM_UP + JUDGED_FROM), rss=1e6)
    assert not short.judged
    assert short.grown() == []
    warm = Gauge()
    for at in range(HOURS):
        warm.add(Point(at, 50 + min(at, WARM_UP), 40, 10, 4))
    assert warm.grown() == []


def test_a_peak_that_passes_is_no_leak_and_is_remembered() -> None:
    gauge = Gauge()
    for at in range(HOURS):
        gauge.add(Point(at, 90 if 10_000 < at < 10_100 else 50, 40, 10, 4))
    assert gauge.grown() == []
    assert gauge.highest["rss"] == 90


def test_points_stay_few_and_cover_the_whole_life() -> None:
    gauge = life(5 * HOURS)
    assert len(gauge.points) <= POINTS_MOST + 1
    assert gauge.points[0].at == 0
    assert gauge.points[-1].at > 4.9 * HOURS


def test_a_process_is_read() -> None:
    point = read(os.getpid(), 1.0)
    assert point.rss >= point.rss_anon > 1
    assert point.descriptors >= 3
    assert point.threads >= 1
