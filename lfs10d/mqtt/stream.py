"""What a broker sends, cut into packets and read: MQTT 5.0 and 3.1.1. Pure.

::

    [ type and flags ][ remaining length, 1 to 4 bytes ][ variable header: packet id, reason, properties ][ payload ]

What a broker may not send is `MalformedError`, after which nothing on the connection can be trusted. Sections are
those of the MQTT 5.0 specification.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import TYPE_CHECKING, NamedTuple

from lfs10d.mqtt.endings import UNSUPPORTED_VERSION
from lfs10d.mqtt.settings import Version

if TYPE_CHECKING:
    from collections.abc import Iterator


class Type(IntEnum):
    """What a broker may send: the upper half of the first byte (2.1.2)."""

    CONNACK = 2
    PUBLISH = 3
    PUBACK = 4
    SUBACK = 9
    UNSUBACK = 11
    PINGRESP = 13
    DISCONNECT = 14


_OLD_REASONS = {1: UNSUPPORTED_VERSION, 2: 0x85, 3: 0x88, 4: 0x86, 5: 0x87}
"""What a broker of 3.1.1 says in its CONNACK (MQTT 3.1.1, section 3.2.2.3), as the reasons of 5.0."""
_OTHERWISE = 0x80
"""Unspecified error (2.4)."""
_OLD_CONNACK = 2
"""Bytes of a CONNACK without properties."""

PUBACK_REASONS = frozenset({0x00, 0x10, 0x80, 0x83, 0x87, 0x90, 0x91, 0x97, 0x99})
"""What a PUBACK may say (3.4.2.1)."""

_LENGTH_BYTES = 4

_RECEIVE_MAXIMUM, _MAXIMUM_PACKET_SIZE, _SERVER_KEEP_ALIVE = 0x21, 0x27, 0x13
_RESPONSE_TOPIC, _CORRELATION_DATA, _SUBSCRIPTION_IDENTIFIER, _USER_PROPERTY = 0x08, 0x09, 0x0B, 0x26
_FIXED = dict.fromkeys((0x01, 0x17, 0x19, 0x24, 0x25, 0x28, 0x29, 0x2A), 1)
_FIXED |= dict.fromkeys((_SERVER_KEEP_ALIVE, _RECEIVE_MAXIMUM, 0x22, 0x23), 2)
_FIXED |= dict.fromkeys((0x02, 0x11, 0x18, _MAXIMUM_PACKET_SIZE), 4)
"""Bytes of the properties that are a number (2.2.2.2)."""
_COUNTED = frozenset({0x03, _RESPONSE_TOPIC, 0x12, 0x15, 0x1A, 0x1C, 0x1F, _CORRELATION_DATA, 0x16})
"""Properties that are text or bytes behind a length of two bytes."""


class MalformedError(ValueError):
    """The broker sent what is no packet that it may send."""


class Packet(NamedTuple):
    """One whole packet; `flags` is the lower half of its first byte."""

    type: Type
    flags: int
    body: bytes


@dataclass(frozen=True, slots=True)
class Connack:
    """The answer to CONNECT; `reason` >= 0x80 is a refusal. `keepalive` is in s; None: the broker did not say."""

    reason: int
    receive_maximum: int | None = None
    maximum_packet_size: int | None = None
    keepalive: int | None = None


@dataclass(frozen=True, slots=True)
class Delivery:
    """A PUBLISH to us; to be acknowledged by `mid` where that is not None."""

    topic: bytes
    payload: bytes
    retained: bool
    mid: int | None
    response_topic: bytes | None
    correlation: bytes | None


def packets(stream: bytearray) -> Iterator[Packet]:
    """Take every whole packet off the front of `stream`; raises MalformedError."""
    while True:
        length = shift = 0
        for at in range(1, 1 + _LENGTH_BYTES):
            if at >= len(stream):
                return
            length |= (stream[at] & 0x7F) << shift
            shift += 7
            if not stream[at] & 0x80:
                break
        else:
            raise MalformedError("a remaining length of more than four bytes")
        end = at + 1 + length
        if len(stream) < end:
            return
        try:
            kind = Type(stream[0] >> 4)
        except ValueError:
            raise MalformedError(f"packet type {stream[0] >> 4}") from None
        packet = Packet(kind, stream[0] & 0x0F, bytes(stream[at + 1 : end]))
        del stream[:end]
        yield packet


def connack(body: bytes, version: Version) -> Connack:
    """Read the body of a CONNACK; one without properties is of a broker that speaks 3.1.1."""
    if len(body) < _OLD_CONNACK:
        raise MalformedError("a short CONNACK")
    reason = body[1]
    if len(body) == _OLD_CONNACK:
        if reason:
            return Connack(_OLD_REASONS.get(reason, _OTHERWISE))
        return Connack(UNSUPPORTED_VERSION if version is Version.V5 else 0)
    said = _properties(body, 2)[0] if version is Version.V5 else {}
    return Connack(
        reason, *(_number(said, key) for key in (_RECEIVE_MAXIMUM, _MAXIMUM_PACKET_SIZE, _SERVER_KEEP_ALIVE))
    )


def puback(body: bytes) -> tuple[int, int]:
    """Read the body of a PUBACK: packet id and reason; without a reason it is 0."""
    if len(body) < 2:  # noqa: PLR2004 - the packet id
        raise MalformedError("a short PUBACK")
    reason = body[2] if len(body) > 2 else 0  # noqa: PLR2004
    if reason not in PUBACK_REASONS:
        raise MalformedError(f"a PUBACK with reason 0x{reason:02X}")
    return int.from_bytes(body[:2], "big"), reason


def suback(body: bytes, version: Version) -> tuple[int, tuple[int, ...]]:
    """Read the body of a SUBACK: packet id and one reason per filter."""
    if len(body) < 2:  # noqa: PLR2004
        raise MalformedError("a short SUBACK")
    begin = _properties(body, 2)[1] if version is Version.V5 else 2
    return int.from_bytes(body[:2], "big"), tuple(body[begin:])


def disconnected(body: bytes) -> int:
    """Read the body of a DISCONNECT of 5.0: its reason; without one it is 0."""
    return body[0] if body else 0


def delivery(packet: Packet, version: Version) -> Delivery:
    """Read a PUBLISH."""
    body, qos = packet.body, packet.flags >> 1 & 0x03
    if qos > 1:
        raise MalformedError(f"a message of QoS {qos}, which nobody subscribed to")
    topic, at = _counted(body, 0)
    mid = None
    if qos:
        mid, at = int.from_bytes(_slice(body, at, 2), "big"), at + 2
    said: dict[int, bytes] = {}
    if version is Version.V5:
        said, at = _properties(body, at)
    return Delivery(
        topic, body[at:], bool(packet.flags & 0x01), mid, said.get(_RESPONSE_TOPIC), said.get(_CORRELATION_DATA)
    )


def _slice(body: bytes, at: int, size: int) -> bytes:
    if at + size > len(body):
        raise MalformedError("a packet that ends within a field")
    return body[at : at + size]


def _counted(body: bytes, at: int) -> tuple[bytes, int]:
    size = int.from_bytes(_slice(body, at, 2), "big")
    return _slice(body, at + 2, size), at + 2 + size


def _variable(body: bytes, at: int) -> tuple[int, int]:
    """Read a variable byte integer (1.5.5); return it and where it ends."""
    number = 0
    for place in range(_LENGTH_BYTES):
        (byte,) = _slice(body, at + place, 1)
        number |= (byte & 0x7F) << 7 * place
        if not byte & 0x80:
            return number, at + place + 1
    raise MalformedError("a variable byte integer of more than four bytes")


def _properties(body: bytes, at: int) -> tuple[dict[int, bytes], int]:
    """Read the properties at `at`; return the last of each as its bytes, and where they end."""
    size, at = _variable(body, at)
    end = at + size
    found: dict[int, bytes] = {}
    while at < end:
        key, at = _variable(body, at)
        if key in _FIXED:
            found[key] = _slice(body, at, _FIXED[key])
            at += _FIXED[key]
        elif key in _COUNTED:
            found[key], at = _counted(body, at)
        elif key == _USER_PROPERTY:
            _, at = _counted(body, at)
            _, at = _counted(body, at)
        elif key == _SUBSCRIPTION_IDENTIFIER:
            _, at = _variable(body, at)
        else:
            raise MalformedError(f"property 0x{key:02X}")
    if at != end or end > len(body):
        raise MalformedError("properties that do not end where they should")
    return found, end


def _number(said: dict[int, bytes], key: int) -> int | None:
    return int.from_bytes(said[key], "big") if key in said else None
