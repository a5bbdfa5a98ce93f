"""Decides when times of an unsynchronised wall clock are corrected. Pure.

A gateway without a battery for its clock begins in the past; then somebody sets it: NTP once the network is there, or a
person. The monotonic clock goes on evenly, so that the time between a sample and now is known whatever was set.
"""

from __future__ import annotations

from typing import Literal, TypeAlias

ClockState: TypeAlias = Literal["synced", "unsynced", "unknown"]
"""How far the wall clock can be trusted."""

STEP_MS = 1000
"""A wall clock that moves this far at once has been set (ms); slewed it moves 0.5 ms in a second."""


def stepped(shift: int, now: int) -> bool:
    """Return whether the clock was set between two moments: each is the wall clock less the monotonic one, in ms."""
    return abs(now - shift) >= STEP_MS


def corrects(clock: ClockState, shift: int, now: int, now_clock: ClockState) -> bool:
    """Return whether a time with the state `clock` and `shift` is to be corrected by the present clock.

    One that was synchronised stays. Any other is corrected by a clock that is synchronised, and by any clock that was
    set since: what was set is nearer to the truth than what was before.
    """
    return clock != "synced" and (now_clock == "synced" or stepped(shift, now))
