"""Frames of the line as published on `trace`, with the device's name and its values. Pure: time is an argument."""

from __future__ import annotations

from collections.abc import Mapping

from lfs10d.modbus.description import describe
from lfs10d.modbus.frames import Codec
from lfs10d.modbus.request import READ_HOLDING_REGISTERS, READ_INPUT_REGISTERS
from lfs10d.profiles.profile import Profile
from lfs10d.reading import Exchanged, Fault
from lfs10d.system.clock import Instant
from lfs10d.system.dataclass import dataclass
from lfs10d.telemetry.publication import TRACE, VERSION, Publication, PublicationKind

LONGEST = 600
"""Most bytes published of a frame; the longest frame, in ASCII, has 513 (Modbus over Serial Line V1.02, 2.5.2)."""


_READ_BODY = 6
"""Slave, function, address and count."""


@dataclass(frozen=True, slots=True)
class TracedDevice:
    """The device at a slave id: its name, its frames, and the meaning of its registers."""

    name: str
    codec: Codec
    profile: Profile


class FrameTrace:
    """Publishes exchanges until `until` (monotonic s). `devices` by slave id; other slaves are decoded by `usual`."""

    def __init__(self, until: float, devices: Mapping[int, TracedDevice], usual: Codec) -> None:
        self.until = until
        self._devices = devices
        self._usual = usual

    def publications(self, exchange: Exchanged, now: Instant) -> list[Publication]:
        """Return the frames of one exchange, sent and received, in order.

        `ts` is when our first byte was sent, and when the last byte of the reply was received. The gap is
        known before the frame we sent.
        """
        device = self._devices.get(exchange.slave)
        codec = self._usual if device is None else device.codec
        whose = "" if device is None else f"{device.name}: "
        published = []
        if exchange.began is not None:
            gap_us = None if exchange.gap is None else round(exchange.gap * 1e6, 1)
            text = whose + _described(exchange.sent, codec)
            published.append(_frame("tx", now.ts(exchange.began), exchange.sent, text, gap_us))
        if exchange.heard:
            meaning = None if device is None or exchange.fault is not None else _meaning(exchange, device)
            text = whose + _described(exchange.heard, codec) + ("" if meaning is None else f": {meaning}")
            published.append(_frame("rx", now.ts(exchange.at), exchange.heard, text))
        return published


def _meaning(exchange: Exchanged, device: TracedDevice) -> str | None:
    """Return the values of a good reply in words, or their fault; None for a reply without values.

    Where several frames could be the reply none is chosen: a trace shows no value that may be another device's.
    """
    asked = [body for _, _, body in device.codec.frames(exchange.sent, exchange.slave, len(exchange.sent))]
    if (
        len(asked) != 1
        or len(asked[0]) != _READ_BODY
        or asked[0][1] not in (READ_HOLDING_REGISTERS, READ_INPUT_REGISTERS)
    ):
        return None
    head, address, count = asked[0][:2], int.from_bytes(asked[0][2:4], "big"), int.from_bytes(asked[0][4:6], "big")
    heard = device.codec.fold(exchange.heard[:LONGEST])
    answers = [
        body
        for _, _, body in device.codec.frames(heard, exchange.slave, len(heard))
        if body[:3] == head + bytes((2 * count,)) and len(body) == 3 + 2 * count
    ]
    if len(answers) != 1:
        return None
    registers = device.codec.decode(answers[0])
    if device.profile.slave_id is not None and (address, count) == (device.profile.slave_id.register, 1):
        return f"its slave id is {registers[0]}"
    reads = ((block.function, block.address, block.count) for block in device.profile.reads())
    place = next((at for at, read in enumerate(reads) if read == (head[1], address, count)), None)
    if place is None:
        return None
    decoded = device.profile.reads()[place].decode(registers)
    if isinstance(decoded, Fault):
        return decoded.message
    units = device.profile.units
    words = (f"{name} {value}" + (f" {units[name]}" if units[name] != "1" else "") for name, value in decoded.items())
    return ", ".join(words)


def _described(data: bytes, codec: Codec) -> str:
    more = len(data) - LONGEST
    return describe(data[:LONGEST], codec) + (f"; {more} bytes more" if more > 0 else "")


def _frame(direction: str, ts: int, data: bytes, text: str, gap_us: float | None = None) -> Publication:
    shown = data[:LONGEST]
    payload = {
        "v": VERSION,
        "ts": ts,
        "direction": direction,
        "gap_us": gap_us,
        "hex": shown.hex(" ").upper(),
        "text": text,
    }
    return Publication(TRACE, payload, PublicationKind.TRACE, retain=False, qos=0)
