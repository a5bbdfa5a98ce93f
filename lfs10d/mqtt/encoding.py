"""Payloads as bytes, and how large a message is on the wire. Pure."""

from __future__ import annotations

import json
from collections.abc import Iterable

from lfs10d.mqtt.settings import Version
from lfs10d.telemetry.publication import Payload

_JSON = json.JSONEncoder(ensure_ascii=False, allow_nan=False, check_circular=False, separators=(",", ":"))

_REMAINING_LENGTH_STEPS = (127, 16_383, 2_097_151)
"""Largest remaining lengths that take 1, 2 and 3 bytes; others take 4 (MQTT 5.0, section 1.5.5)."""


def encode(payload: Payload) -> bytes:
    """Return the bytes of a payload: JSON, a bare word, or nothing for None; ValueError for NaN or infinity.

    Text from outside that is no Unicode (lone surrogates) becomes question marks, since the broker would drop us.
    """
    if payload is None:
        return b""
    text = payload if isinstance(payload, str) else _JSON.encode(payload)
    return text.encode("utf-8", "replace")


def array(elements: Iterable[bytes]) -> bytes:
    """Return a JSON array of elements that are encoded already."""
    return b"[" + b",".join(elements) + b"]"


def packet_size(topic: str, payload: bytes, *, version: Version, qos: int = 1, correlation: bytes | None = None) -> int:
    """Return the bytes of a PUBLISH (MQTT 5.0, section 3.3), to be held against the broker's Maximum Packet Size."""
    remaining = 2 + len(topic.encode()) + (2 if qos else 0) + len(payload)
    if version is Version.V5:
        properties = 0 if correlation is None else 1 + 2 + len(correlation)
        remaining += _length_of_length(properties) + properties
    return 1 + _length_of_length(remaining) + remaining


def _length_of_length(length: int) -> int:
    return 1 + sum(length > step for step in _REMAINING_LENGTH_STEPS)
