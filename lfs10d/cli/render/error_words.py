"""Error codes in a few words, as the live table shows them beside the code; docs/when-it-goes-wrong.md has the rest."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from lfs10d.system.logs import escape

MEANINGS: Final[Mapping[str, str]] = {
    "timeout": "no answer",
    "crc": "garbled answer",
    "malformed": "broken answer",
    "wrong_slave": "another slave answers",
    "wrong_function": "answers something else",
    "exception": "refuses",
    "out_of_range": "impossible value",
    "not_finite": "not a number",
    "unavailable": "has no value now",
    "late": "answers too late",
    "collision": "line never silent",
    "starting": "not polled yet",
    "disabled": "not polled",
    "overrun": "polled too seldom",
    "port_lost": "no port",
    "port_busy": "another program has the port",
    "wrong_rate": "sensors use another rate",
    "duplicate_id": "two sensors answer",
    "config_conflict": "two devices with one id",
    "storage_full": "disk not writable",
    "duplicate_client": "client id used twice",
}
"""By the codes of `lfs10d.reading.FaultCode`."""

OF_THE_LINE: Final = frozenset({"starting", "port_lost", "port_busy", "config_conflict"})
"""Codes in a device's sample that are not about the device itself."""

BESIDE_GOOD: Final = frozenset({"duplicate_id"})
"""Codes of errors that are active though the samples are good."""


def in_words(code: str) -> str:
    """Return a code with its meaning: `timeout, no answer`; alone where it is not known, and safe to print."""
    return f"{code}, {MEANINGS[code]}" if code in MEANINGS else escape(code)
