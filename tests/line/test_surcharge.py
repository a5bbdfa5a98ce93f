"""What a change is charged for what it costs the others."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lfs10d.line.surcharge import CROWDED, MISSED, Surcharge

WIRE = 0.025
SHARE = 0.3


def charged(surcharge: Surcharge, began: float, ended: float, *intervals: float) -> float:
    return surcharge.charge(SHARE, began, ended, intervals=intervals, wire_time=WIRE)


def test_on_a_line_with_time_a_change_is_charged_what_it_takes() -> None:
    assert charged(Surcharge(), 0.0, 0.2, 1.0, 1.0) == pytest.approx(0.2)
    assert charged(Surcharge(), 0.0, 5.0) == pytest.approx(5.0), "nobody else is polled"


def test_on_a_crowded_line_a_change_is_charged_more() -> None:
    assert charged(Surcharge(), 0.0, 0.2, *[0.5] * 10) == pytest.approx(CROWDED * 0.2)
    assert charged(Surcharge(), 0.0, 0.2, 0.0, 1.0) == pytest.approx(CROWDED * 0.2), "one takes all that is left"


def test_what_makes_others_miss_polls_is_charged_by_what_they_may_miss() -> None:
    assert charged(Surcharge(), 0.0, 1.0, 0.4, 2.0) == pytest.approx(0.6 * SHARE / MISSED)


def test_exchanges_on_end_count_as_one_until_others_may_have_the_line() -> None:
    surcharge = Surcharge()
    first = charged(surcharge, 0.0, 0.3, 0.4)
    second = charged(surcharge, 0.3, 1.0, 0.4)
    assert (first, second) == pytest.approx((0.3, 0.6 * SHARE / MISSED))
    surcharge.released()
    assert charged(surcharge, 1.0, 1.3, 0.4) == pytest.approx(0.3)


@given(st.lists(st.floats(0.01, 1.0), min_size=1, max_size=6), st.floats(0.05, 2.0))
def test_a_wait_in_pieces_is_charged_no_less_than_in_one(pieces: list[float], interval: float) -> None:
    surcharge, at, total = Surcharge(), 0.0, 0.0
    for piece in pieces:
        total += charged(surcharge, at, at + piece, interval)
        at += piece
    assert total >= max(0.0, at - interval) * SHARE / MISSED - 1e-9
    assert total >= at - 1e-9
