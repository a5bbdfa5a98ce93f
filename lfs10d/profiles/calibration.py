"""A value's calibration, as in a certificate: `number * scale + offset`, exact in decimals, then rounded. Pure."""

from __future__ import annotations

from decimal import Decimal
from typing import cast

from lfs10d.reading import Number
from lfs10d.system.dataclass import dataclass

DIGITS = 7
"""Significant digits of a calibrated number: as many as a float32 carries."""


@dataclass(frozen=True, slots=True)
class Calibration:
    """Turns the profile's number into the calibrated one, in the value's unit.

    `keeps_zero`: 0 stays 0, for an anemometer at rest measures no wind, whatever offset its certificate has.
    """

    scale: Number
    offset: Number
    keeps_zero: bool = False

    def apply(self, number: Number) -> Number:
        """Return the calibrated number; infinite where it is too large for a float.

        Scale and offset are the decimals that a person wrote. The result has seven significant digits at most, but
        never fewer decimals than the number had: 12.99 with 1.0137 and 0.061 is 13.22896. Integers stay integers where
        scale and offset are whole.
        """
        scale, offset = self.scale, self.offset
        if self.keeps_zero and number == 0:
            return number
        if isinstance(number, int) and scale == int(scale) and offset == int(offset):
            return number * int(scale) + int(offset)
        given = Decimal(repr(number))
        exact = given * Decimal(repr(scale)) + Decimal(repr(offset))
        least = min(exact.adjusted() - DIGITS + 1, _last_place(given), 0)
        return float(round(exact, -least) if _last_place(exact) < least else exact)


def _last_place(number: Decimal) -> int:
    """Return the exponent of a finite number's last digit: -2 for 12.99."""
    return cast("int", number.as_tuple().exponent)
