"""Durations and sizes as people write them (`250ms`, `24h`, `512MB`) and back; the baud rates of a line."""

from __future__ import annotations

import re
from collections.abc import Mapping
from decimal import Decimal

BAUDRATES = (1200, 2400, 4800, 9600, 19200, 38400, 57600, 115200)
"""Bits per second a line may run at."""

_SECONDS_PER_UNIT = {
    "ms": Decimal("0.001"),
    "s": Decimal(1),
    "m": Decimal(60),
    "h": Decimal(3600),
    "d": Decimal(86400),
}
_BYTES_PER_UNIT = {"B": 1, "kB": 10**3, "KB": 10**3, "MB": 10**6, "GB": 10**9, "TB": 10**12}

# Twenty digits are more than anyone means; longer ones would only cost time.
_DURATION = re.compile(r"([0-9]{1,20}(?:\.[0-9]{1,20})?)(ms|s|m|h|d)")
_SIZE = re.compile(r"([0-9]{1,20}(?:\.[0-9]{1,20})?)(B|kB|KB|MB|GB|TB)")

DURATION_PATTERN = f"^{_DURATION.pattern}$"
SIZE_PATTERN = f"^{_SIZE.pattern}$"
"""The same forms for a JSON Schema."""


def seconds(value: object) -> float:
    """Return the seconds of a non-negative number or of text such as `250ms`, `1.5s`, `5m`, `24h`, `7d`.

    Raises ValueError (without words) for anything else: negative, not finite, true, text of another form.
    """
    return float(_number(value, _DURATION, _SECONDS_PER_UNIT)) + 0.0  # -0.0 becomes 0.0


_LARGEST_NUMBER = 10**15
"""Largest number: thirty million years, or a petabyte; a larger whole number may not fit a float."""


def duration_text(duration: float) -> str:
    """Return text in the largest unit that divides it, which `seconds` reads back as exactly this duration."""
    exact = Decimal(repr(duration))
    if exact == 0:
        return "0s"
    if exact < 1:
        return f"{_plain(exact * 1000)}ms"
    for unit, least in (("d", 2), ("h", 1), ("m", 1)):  # a day is 24h
        count = exact / _SECONDS_PER_UNIT[unit]
        if count >= least and count == count.to_integral_value():
            return f"{_plain(count)}{unit}"
    return f"{_plain(exact)}s"


def size(value: object) -> int:
    """Return the bytes of a whole number or of text such as `512MB` (powers of 1000).

    Raises ValueError (without words) for anything else, also if it comes to a fraction of a byte.
    """
    count = _number(value, _SIZE, _BYTES_PER_UNIT)
    if isinstance(count, float) or count != int(count):
        raise ValueError
    return int(count)


def _number(value: object, form: re.Pattern[str], units: Mapping[str, Decimal] | Mapping[str, int]) -> Decimal | float:
    """Return a non-negative number, or what text of the form comes to; raise ValueError."""
    if isinstance(value, str):
        match = form.fullmatch(value)
        if match is None:
            raise ValueError
        return Decimal(match[1]) * units[match[2]]
    if isinstance(value, bool) or not isinstance(value, int | float) or not 0 <= value <= _LARGEST_NUMBER:
        raise ValueError
    return value


def size_text(count: int) -> str:
    """Return the shortest text that `size` reads back as exactly this many bytes."""
    for unit in ("TB", "GB", "MB", "kB"):
        if count and count % _BYTES_PER_UNIT[unit] == 0:
            return f"{count // _BYTES_PER_UNIT[unit]}{unit}"
    return f"{count}B"


def _plain(number: Decimal) -> str:
    text = f"{number:f}"
    return text.rstrip("0").rstrip(".") if "." in text else text
