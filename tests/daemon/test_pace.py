"""What the times of a daemon are where nobody gives others."""

from __future__ import annotations

from lfs10d.daemon.pace import USUAL, Pace


def test_history_waits_ten_seconds_and_a_change_takes_three_tenths_of_the_line() -> None:
    assert Pace() == USUAL
    assert (USUAL.history_wait, USUAL.change_share) == (10.0, 0.3)
