"""Frames in words, for traces and logs; our own words and hex digits only."""

from __future__ import annotations

from lfs10d.modbus.frames import EXCEPTION_FLAG, EXCEPTION_NAMES, Codec
from lfs10d.modbus.request import (
    BIT_READS,
    READS,
    WRITE_MULTIPLE_COILS,
    WRITE_MULTIPLE_REGISTERS,
    WRITE_SINGLE_REGISTER,
)

_SEVERAL = frozenset({WRITE_MULTIPLE_COILS, WRITE_MULTIPLE_REGISTERS})
_REQUEST_DATA = 4
"""Address and count, or address and value."""
_DESCRIBED = 16
"""Most frames of one piece that are described."""


def describe(frame: bytes, codec: Codec) -> str:
    """Return sent or received bytes in words, for traces and logs; our own words and hex digits only.

    `frame` may hold several frames and noise.
    """
    stream = codec.fold(frame)
    parts: list[str] = []
    at = 0
    for begin, end, body in codec.frames(stream, stream[0] if stream else 0, len(stream)):
        if begin < at or len(parts) >= _DESCRIBED:
            continue
        parts += _noise(begin - at)
        parts.append(_in_words(body))
        at = end
    return "; ".join(parts + _noise(len(stream) - at)) or "nothing"


def _noise(count: int) -> list[str]:
    return [f"{count} byte{'s' * (count > 1)} of no frame"] if count else []


def _in_words(body: bytes) -> str:
    slave, function, data = body[0], body[1], body[2:]
    whose = f"slave {slave}" if slave else "every slave"
    if function & EXCEPTION_FLAG and len(data) == 1:
        name = EXCEPTION_NAMES.get(data[0], "of the device's own")
        return f"{whose} refuses function {function - EXCEPTION_FLAG:02X}: exception {data[0]:02X} {name}"
    known = _of_two_words(function, data, whose) if len(data) == _REQUEST_DATA else None
    if known is not None:
        return known
    if function in READS and data and data[0] == len(data) - 1:
        return f"{whose} answers {data[1:].hex(' ', 1 if function in BIT_READS else 2).upper()}"
    if function in _SEVERAL and len(data) > _REQUEST_DATA and data[_REQUEST_DATA] == len(data) - _REQUEST_DATA - 1:
        first, content = int.from_bytes(data[:2], "big"), data[_REQUEST_DATA + 1 :].hex(" ", 2).upper()
        return f"write {content} from 0x{first:04X} on of {whose}"
    return f"function {function:02X} of {whose}: {data.hex(' ').upper()}"


def _of_two_words(function: int, data: bytes, whose: str) -> str | None:
    """Return a request or a confirmation in words, None for other functions."""
    first, second = int.from_bytes(data[:2], "big"), int.from_bytes(data[2:], "big")
    if function in READS:
        return f"read {second} {_plural(function, second)} at 0x{first:04X} of {whose}"
    if function == WRITE_SINGLE_REGISTER:
        return f"write 0x{second:04X} to 0x{first:04X} of {whose}"
    if function in _SEVERAL:
        return f"{whose} confirms {second} {_plural(function, second)} written from 0x{first:04X} on"
    return None


def _plural(function: int, count: int) -> str:
    bits = function in BIT_READS or function == WRITE_MULTIPLE_COILS
    return f"{'bit' if bits else 'register'}{'s' * (count != 1)}"
