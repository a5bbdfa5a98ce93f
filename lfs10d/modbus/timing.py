"""Durations on a serial line at one rate. No other module multiplies by a baud rate.

A timing belongs to an exchange; where the rate changes between two exchanges the slower gap holds.
All times are seconds.
"""

from __future__ import annotations

from lfs10d.system.dataclass import dataclass

SILENT_INTERVAL_CHARACTERS = 3.5
"""t3.5: least silence between two frames, in characters (Modbus over Serial Line V1.02, section 2.5.1.1)."""

FIXED_ABOVE_BAUDRATE = 19200
"""Above this rate the interval is fixed (Modbus over Serial Line V1.02, section 2.5.1.1)."""

FIXED_SILENT_INTERVAL = 1750e-6
"""t3.5 above that rate, in s."""

_PARITIES = ("none", "even", "odd")


@dataclass(frozen=True, slots=True)
class LineTiming:
    """The times of one rate and character format; `gap` is the silence that precedes every request.

    `character`, its start, parity and stop bits included, `t35` and `gap` are seconds.
    """

    baudrate: int
    character: float
    t35: float
    gap: float

    @classmethod
    def of(
        cls,
        baudrate: int,
        *,
        databits: int = 8,
        parity: str = "none",
        stopbits: int = 1,
        extra_gap: float = 0.0,
    ) -> LineTiming:
        """Return the times of a rate; `extra_gap` seconds are added to the 3.5 characters of silence."""
        if baudrate < 1:
            raise ValueError(f"a baud rate is positive, not {baudrate}")
        if databits not in (7, 8) or stopbits not in (1, 2) or parity not in _PARITIES:
            raise ValueError(f"no such character: {databits} data bits, parity {parity}, {stopbits} stop bits")
        if not 0.0 <= extra_gap < float("inf"):
            raise ValueError(f"an extra gap is a duration, not {extra_gap}")
        bits = 1 + databits + (parity != "none") + stopbits
        character = bits / baudrate
        fixed = baudrate > FIXED_ABOVE_BAUDRATE
        t35 = FIXED_SILENT_INTERVAL if fixed else SILENT_INTERVAL_CHARACTERS * character
        return cls(
            baudrate=baudrate,
            character=character,
            t35=t35,
            gap=t35 + extra_gap,
        )

    def transmission(self, characters: int) -> float:
        """Return the time in s of this many characters on the wire without a pause."""
        return characters * self.character

    def exchange(self, request_characters: int, answer_characters: int, turnaround: float = 0.0) -> float:
        """Return the line time of one exchange, the gap before the request and before the next included."""
        return 2 * self.gap + self.transmission(request_characters + answer_characters) + turnaround

    def slower(self, other: LineTiming) -> float:
        """Return the longer gap of the two: the silence needed where the rate changes."""
        return max(self.gap, other.gap)
