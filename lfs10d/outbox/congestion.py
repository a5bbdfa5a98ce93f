"""Detects a connection that carries fewer messages than are published, and its capacity: for one warning. Pure.

It does where the window was full and states were replaced before they went, or samples grew old, in each of three
periods of 10 s in a row.
"""

from __future__ import annotations

from lfs10d.system.dataclass import dataclass

PERIOD = 10.0
"""Seconds of a period."""

PERIODS = 3
"""Periods in a row."""

REPORTED_EVERY = 86_400.0
"""Seconds from one report to the next at least."""

SMOOTHING = 0.125
"""The part of a round trip in the mean (RFC 6298, section 2)."""


@dataclass(frozen=True, slots=True)
class Congested:
    """`round_trip` in seconds from a message to its acknowledgement; `window`: messages under way at most."""

    round_trip: float
    window: int

    @property
    def rate(self) -> float:
        """Messages a second."""
        return self.window / self.round_trip


class Congestion:
    """The rule above."""

    def __init__(self) -> None:
        self.lasts = False
        """Too little was carried in so many periods that `report` has something to say."""
        self._round_trip = 0.0
        self._period: int | None = None
        self._in_a_row = 0
        self._reported_at = float("-inf")

    def connected(self) -> None:
        """Begin anew on another connection."""
        self._round_trip = 0.0
        self._period = None
        self._in_a_row = 0
        self.lasts = False

    def answered(self, seconds: float) -> None:
        """Take the time from a message to its acknowledgement."""
        if not self._round_trip:
            self._round_trip = seconds
        else:
            self._round_trip += SMOOTHING * (seconds - self._round_trip)

    def displaced(self, now: float) -> None:
        """Note that the window was full, and that something did not go as it should for that."""
        period = int(now // PERIOD)
        if period == self._period:
            return
        self._in_a_row = self._in_a_row + 1 if self._period == period - 1 else 1
        self.lasts = self._in_a_row >= PERIODS
        self._period = period

    def report(self, now: float, window: int) -> Congested | None:
        """Return once what the window carries, if it carries too little."""
        if not (self.lasts and self._round_trip) or now - self._reported_at < REPORTED_EVERY:
            return None
        self._reported_at = now
        return Congested(self._round_trip, window)
