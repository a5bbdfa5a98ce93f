"""Frames of the line as they are told on `trace`. Pure: time is an argument."""

from __future__ import annotations

from typing import TYPE_CHECKING

from lfs10d.modbus.frames import describe
from lfs10d.telemetry import TRACE, VERSION, Kind, Publication

if TYPE_CHECKING:
    from collections.abc import Mapping

    from lfs10d.facts import Instant
    from lfs10d.modbus.frames import Codec
    from lfs10d.reading import Exchanged

LONGEST = 600
"""Bytes of one piece that are told; the longest frame, in ASCII, has 513 (Modbus over Serial Line V1.02, 2.5.2)."""


class Trace:
    """Tells exchanges until `until` (monotonic s). `codecs` by slave id; other slaves are read by `usual`."""

    def __init__(self, until: float, codecs: Mapping[int, Codec], usual: Codec) -> None:
        self.until = until
        self._codecs = codecs
        self._usual = usual

    def told(self, exchange: Exchanged, now: Instant) -> list[Publication]:
        """Return what one exchange put on the line and what came back, in order.

        `ts` is when our first byte was sent, and when the last byte of what came back was heard. The silence is
        known before what we sent.
        """
        codec = self._codecs.get(exchange.slave, self._usual)
        told = []
        if exchange.began is not None:
            gap_us = None if exchange.gap is None else round(exchange.gap * 1e6, 1)
            told.append(_frame("tx", now.ts(exchange.began), exchange.sent, codec, gap_us))
        if exchange.heard:
            told.append(_frame("rx", now.ts(exchange.at), exchange.heard, codec))
        return told


def _frame(direction: str, ts: int, data: bytes, codec: Codec, gap_us: float | None = None) -> Publication:
    shown = data[:LONGEST]
    text = describe(shown, codec)
    if len(shown) < len(data):
        text += f"; {len(data) - len(shown)} bytes more"
    payload = {
        "v": VERSION,
        "ts": ts,
        "direction": direction,
        "gap_us": gap_us,
        "hex": shown.hex(" ").upper(),
        "text": text,
    }
    return Publication(TRACE, payload, Kind.TRACE, retain=False, qos=0)
