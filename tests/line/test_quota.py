"""A share of the line is never exceeded but by its credit and one use."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lfs10d.line.quota import Quota


def test_an_empty_account_is_ready_when_it_has_filled_up() -> None:
    share = Quota(0.05, credit=0.0, now=10.0)
    assert share.allows(10.0)
    share.spend(0.2, 10.0)
    assert not share.allows(13.9)
    assert share.ready_at(10.0) == pytest.approx(14.0)
    assert share.allows(share.ready_at(10.0))


def test_credit_is_taken_ahead_and_never_grows_beyond_its_size() -> None:
    share = Quota(0.1, credit=1.0, now=0.0)
    share.spend(0.6, 1000.0)
    assert share.allows(1000.0)
    share.spend(0.6, 1000.0)
    assert not share.allows(1000.0)
    assert share.ready_at(1000.0) == pytest.approx(1002.0)


def test_a_ready_account_is_ready_now() -> None:
    assert Quota(0.5, credit=0.0, now=3.0).ready_at(4.0) == 4.0


@given(st.floats(0.01, 1.0), st.floats(0.0, 2.0), st.lists(st.floats(0.001, 1.0), min_size=1, max_size=60))
def test_over_any_time_the_use_stays_within_the_share(rate: float, credit: float, uses: list[float]) -> None:
    share = Quota(rate, credit=credit, now=0.0)
    now = used = 0.0
    for use in uses:
        now = share.ready_at(now)
        assert share.allows(now)
        assert used <= rate * now + credit + 1e-6
        share.spend(use, now)
        used += use
