"""Real payloads for the page: what the station publishes for a short story of two sensors, and answers to requests.

Mast-top measures; the other is silent until its error rises, answers once, and is silent again. The clock begins at
a fixed moment, so the page is the same each time.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Final

from docs.generate.payloads import TracePayload
from lfs10d.command import Command, ok, rejected
from lfs10d.commands.message import response
from lfs10d.modbus import diagnosis
from lfs10d.modbus.timing import LineTiming
from lfs10d.reading import Exchanged, Fault, FaultCode, PortChanged, Purpose, Reading, UartCounted, UartCounters
from lfs10d.system.clock import Instant
from lfs10d.telemetry.info import DaemonInfo, DeviceInfo, LineInfo
from lfs10d.telemetry.publication import Publication, Sample
from lfs10d.telemetry.station import Station

LINE: Final = "line0"
BOOT: Final = "k3f9a2c7"
BEGUN: Final = 1795298000.0
"""Epoch s of the story's begin: 2026-11-21T21:53:20Z."""

SENT, HEARD = bytes.fromhex("02030001000295f8"), bytes.fromhex("020304414fd70a332f")
"""Slave 2 is read, and answers 12.99 m/s."""

_MAST = DeviceInfo(
    name="mast-top",
    slave=2,
    label="Mast, 10 m",
    profile="lfs10",
    interval=1.0,
    enabled=True,
    response_timeout=None,
    value_names=("wind_speed",),
    units={"wind_speed": "m/s"},
    offline_after=3,
)
_ROOF = replace(_MAST, name="slave-3", slave=3, label=None)
_LINE = LineInfo(
    name=LINE,
    port="/dev/serial/by-id/usb-FTDI_FT232R_USB_UART_A50285BI-if00-port0",
    baudrate=9600,
    parity="none",
    databits=8,
    stopbits=1,
    framing="rtu",
    gap_required=LineTiming.of(9600).gap,
)
_DAEMON = DaemonInfo(
    version="1.0.0",
    host="gateway-17",
    boot=BOOT,
    previous_boot="k3f9a2c6",
    config_hash="5d41402abc4b",
    mqtt={"version": "5"},
    features=("history",),
)


EVENT_TS: Final = Instant(31, BEGUN + 31, "synced").ts()
"""Epoch milliseconds of the events shown."""


def _at(mono: float) -> Instant:
    return Instant(mono, BEGUN + mono, "synced")


class Story:
    """What was published, topic by topic; the newest that is worth showing stands last."""

    def __init__(self) -> None:
        self.by_topic: dict[str, list[object]] = {}
        self._samples: list[Sample] = []
        self._station = Station(_DAEMON, _LINE, (_MAST, _ROOF), _at(0))
        self._note(self._station.burst(_at(0)))
        self._note(self._station.on_event(PortChanged(0.05, None), _at(0.05)))
        counters = UartCounters(framing=0, parity=0, overrun=0, breaks=0)
        self._note(self._station.on_event(UartCounted(0.1, counters), _at(0.1)))
        for second in range(1, 31):
            self._poll(second)
            self._note(self._station.tick(_at(second + 0.5)))

    def _poll(self, second: int) -> None:
        at = second + 0.003
        asked = Exchanged(
            at, at - 0.0265, at - 0.0228, 0.003701, 2, Purpose.POLL, fault=None, sent=SENT, heard=HEARD
        )  # fmt: skip
        values = {"wind_speed": (12.99, 12.34, 11.87)[second % 3]}
        good = Reading("mast-top", at, values, None, rtt=0.0182, online=True, response_timeout=0.062)
        silence = Fault(FaultCode.TIMEOUT, diagnosis.silent(0.2).message)
        if second == 20:  # noqa: PLR2004  # two thirds into the story
            other = Reading("slave-3", at + 0.04, values, None, rtt=0.0191, online=True, response_timeout=0.05)
        else:
            online = 20 < second < 23 or second < 3  # noqa: PLR2004 - a made-up minute
            other = Reading("slave-3", at + 0.2, None, silence, rtt=None, online=online, response_timeout=0.05)
        for event in (asked, good, other):
            self._note(self._station.on_event(event, _at(event.at + 0.001)))

    def _note(self, publications: list[Publication]) -> None:
        for each in publications:
            self.by_topic.setdefault(each.topic, []).append(each.payload)
            if each.sample is not None:
                self._samples.append(each.sample)

    def newest(self, topic: str) -> object:
        """Return what stands on a topic at the end."""
        return self.by_topic[topic][-1]

    def history(self) -> list[dict[str, object]]:
        """Return two samples as they go out late."""
        late = [sample for sample in self._samples if sample.device == "mast-top"][:2]
        return [sample.payload(LINE, historical=True) for sample in late]

    def cleared(self) -> object:
        """Return the error object of the sensor that had come back."""
        return next(
            payload
            for payload in self.by_topic["device/slave-3/error"]
            if isinstance(payload, dict) and payload.get("cleared") is not None
        )


def trace() -> object:
    """Return one traced frame."""
    return TracePayload(
        v=1,
        ts=_at(1).ts(),
        direction="tx",
        gap_us=3701.0,
        hex=SENT.hex(" ").upper(),
        text="read 2 registers at 0x0001 of slave 2",
    ).model_dump()


def responses() -> Iterator[object]:
    """Yield an answer that says yes, and one that says no."""
    done = {"applied": ["slaves.mast-top.interval"], "restart_required": []}
    yield response(Command(id="a1"), "config/reload", ok(done), 8.4)
    message = "no such parameter; known are: none"
    yield response(Command(id="a2"), "config/reload", rejected("invalid_param", message, param="file"), 0.3)
