"""What the times of a daemon are where nobody gives others."""

from __future__ import annotations

from lfs10d.daemon.pace import USUAL, Pace


def test_the_usual_times_are_those_of_the_contract() -> None:
    assert Pace() == USUAL
    assert (USUAL.history_wait, USUAL.change_share) == (10.0, 0.3)
