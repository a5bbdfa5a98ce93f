"""What a client sends, as bytes: MQTT 5.0 and 3.1.1. Pure; what comes back is read in `stream`.

QoS 0 and 1, no sessions that outlive a connection, no topic aliases. Sections are those of the MQTT 5.0 specification.
"""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

from lfs10d.mqtt.settings import Version

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from lfs10d.mqtt.messages import Filter, Will

PINGREQ = b"\xc0\x00"
DISCONNECT = b"\xe0\x00"

LONGEST = 268_435_455
"""The greatest remaining length (1.5.5)."""

_RECEIVE_MAXIMUM, _RESPONSE_TOPIC, _CORRELATION_DATA = b"\x21", b"\x08", b"\x09"
"""Properties (2.2.2.2)."""


def connect(
    version: Version,
    client_id: str,
    *,
    keepalive: int,
    receive_maximum: int,
    username: str | None = None,
    password: str | None = None,
    will: Will | None = None,
) -> bytes:
    """Return a CONNECT that begins anew (clean start); the will has QoS 1 and is retained (3.1)."""
    five = version is Version.V5
    nothing = b"\x00" if five else b""
    flags = 0x02
    payload = [_string(client_id)]
    if will is not None:
        flags |= 0x04 | 0x08 | 0x20
        payload += [nothing, _string(will.topic), _behind_length(will.payload)]
    if username is not None:
        flags |= 0x80
        payload.append(_string(username))
        if password is not None:
            flags |= 0x40
            payload.append(_string(password))
    level = b"\x05" if five else b"\x04"
    properties = b"\x03" + _RECEIVE_MAXIMUM + receive_maximum.to_bytes(2, "big") if five else b""
    head = _string("MQTT") + level + bytes((flags,)) + keepalive.to_bytes(2, "big") + properties
    return _packet(0x10, (head, *payload))


def publish(
    version: Version,
    topic: str,
    payload: bytes,
    *,
    mid: int | None,
    retain: bool = False,
    response_topic: str | None = None,
    correlation: bytes | None = None,
) -> bytes:
    """Return a PUBLISH of QoS 1, without `mid` of QoS 0 (3.3); by 3.1.1 without the two last."""
    parts = [_string(topic)]
    if mid is not None:
        parts.append(mid.to_bytes(2, "big"))
    if version is Version.V5:
        properties = b"" if response_topic is None else _RESPONSE_TOPIC + _string(response_topic)
        if correlation is not None:
            properties += _CORRELATION_DATA + _behind_length(correlation)
        parts.append(_length(len(properties)) + properties)
    parts.append(payload)
    return _packet(0x30 | (mid is not None) << 1 | retain, parts)


def acknowledge(mid: int) -> bytes:
    """Return a PUBACK (3.4)."""
    return b"\x40\x02" + mid.to_bytes(2, "big")


def subscribe(version: Version, mid: int, filters: Sequence[Filter]) -> bytes:
    """Return a SUBSCRIBE; retained messages are sent at each (retain handling 0; 3.8)."""
    five = version is Version.V5
    parts = [mid.to_bytes(2, "big"), b"\x00" if five else b""]
    for each in filters:
        options = each.qos | each.no_local << 2 | each.retain_as_published << 3 if five else each.qos
        parts += [_string(each.topic), bytes((options,))]
    return _packet(0x82, parts)


def unsubscribe(version: Version, mid: int, topics: Iterable[str]) -> bytes:
    """Return an UNSUBSCRIBE (3.10)."""
    head = mid.to_bytes(2, "big") + (b"\x00" if version is Version.V5 else b"")
    return _packet(0xA2, (head, *map(_string, topics)))


def _packet(first: int, parts: Sequence[bytes]) -> bytes:
    return b"".join((bytes((first,)), _length(sum(map(len, parts))), *parts))


def _length(number: int) -> bytes:
    """Return a variable byte integer (1.5.5)."""
    if not 0 <= number <= LONGEST:
        raise ValueError(f"a packet has at most {LONGEST} bytes, not {number}")
    if number <= 0x7F:  # noqa: PLR2004 - seven bits a byte
        return bytes((number,))
    if number <= 0x3FFF:  # noqa: PLR2004 - twice seven: a sample
        return bytes((number & 0x7F | 0x80, number >> 7))
    out = bytearray()
    while number > 0x7F:  # noqa: PLR2004
        out.append(number & 0x7F | 0x80)
        number >>= 7
    out.append(number)
    return bytes(out)


def _behind_length(data: bytes) -> bytes:
    return len(data).to_bytes(2, "big") + data


@lru_cache(maxsize=2048)
def _string(text: str) -> bytes:
    """Return text behind its length. Remembered: a daemon has a few hundred topics."""
    return _behind_length(text.encode())
