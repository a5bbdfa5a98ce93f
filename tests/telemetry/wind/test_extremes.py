"""What is greatest and least in two windows together."""

from __future__ import annotations

from lfs10d.telemetry.wind.extremes import NOTHING_FOUND, Extremes, Found, Peak


def test_of_equal_gusts_the_later_counts() -> None:
    found = Extremes(1, 3.0, Peak(3.0, 1), Peak(3.0, 1))
    found.add(Extremes(1, 3.0, Peak(3.0, 2), Peak(3.0, 2)))
    assert found == Extremes(2, 3.0, Peak(3.0, 2), Peak(3.0, 2))
    found.add(Extremes(1, 2.0, Peak(2.0, 3), Peak(4.0, 3)))
    assert found == Extremes(3, 3.0, Peak(3.0, 2), Peak(3.0, 2))
    found.add(Extremes(1, 4.0, None, None))
    assert found == Extremes(4, 4.0, Peak(3.0, 2), Peak(3.0, 2))


def test_of_equal_gusts_that_are_found_the_later_counts() -> None:
    earlier, later = Found(2, 5.0, 4.0, 10, 1.0, 11), Found(3, 4.5, 4.0, 20, 1.0, 21)
    assert earlier.with_later(later) == Found(5, 5.0, 4.0, 20, 1.0, 21)
    assert earlier.with_later(later._replace(gust=3.9, lull=1.1)) == Found(5, 5.0, 4.0, 10, 1.0, 11)
    for found in (earlier, NOTHING_FOUND):
        assert found.with_later(NOTHING_FOUND) == NOTHING_FOUND.with_later(found) == found
