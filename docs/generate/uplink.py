"""The table of bytes a day in docs/mqtt.md: what the daemon's own station and encoder make of two minutes of polls."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from docs.generate.markdown import table
from lfs10d.mqtt.encoding import encode, packet_size
from lfs10d.mqtt.settings import Version
from lfs10d.reading import Reading
from lfs10d.schema.quantities import duration_text
from lfs10d.system.clock import Instant
from lfs10d.telemetry.info import DaemonInfo, DeviceInfo, LineInfo, WindInfo, WindValues
from lfs10d.telemetry.publication import Publication, PublicationKind
from lfs10d.telemetry.station import Station

DAY = 86_400
MEASURED = 120
"""Seconds of polls that are counted, as often as a day has room for them."""

PUBACK = 4
"""Bytes that come back for each publication of QoS 1 (MQTT 5.0, section 3.4)."""

WALL = 1_795_298_000.0
TOPICS = "lfs10d/line0"
DEVICE = DeviceInfo(
    name="slave-2",
    slave=2,
    label=None,
    profile="lfs10",
    interval=1.0,
    enabled=True,
    response_timeout=None,
    value_names=("wind_speed",),
    units={"wind_speed": "m/s"},
    offline_after=3,
)
SETTINGS = (
    (True, 1.0, 10.0),
    (True, 60.0, 60.0),
    (False, 1.0, 10.0),
    (False, 10.0, 60.0),
    (False, 60.0, 60.0),
    (False, 60.0, 3600.0),
)
"""`mqtt.telemetry`, `mqtt.state_every` and `wind.every` of each row."""

SENSORS = (1, 8, 32)


def bytes_a_day(
    sensors: int, *, telemetry: bool, state_every: float, wind_every: float | None = None
) -> tuple[int, int]:
    """Return the bytes of MQTT a day to the broker and back, of sensors that answer every second, without a burst.

    `wind_every` in s is that of the wind statistics; None: without them.
    """
    wind = None if wind_every is None else WindInfo(WindValues("wind_speed", None, "m/s"), wind_every, records=0)
    devices = [
        replace(DEVICE, name=f"slave-{2 + n}", slave=2 + n, state_every=state_every, wind=wind) for n in range(sensors)
    ]
    line = LineInfo("line0", "/dev/ttyUSB0", 9600, "none", 8, 1, "rtu", 0.0036458)
    daemon = DaemonInfo("0.1", "gateway", "k3f9a2c7", None, "0123456789ab", 0, {"version": "5"}, ())
    station = Station(daemon, line, devices, Instant(0.0, WALL, "synced"))
    there = back = 0
    for second in range(-60, MEASURED):  # what begins with the start is over before it is counted
        for number, device in enumerate(devices):
            now = 1000.0 + second + number / sensors
            values = {"wind_speed": round(3.0 + (second * 7 + number) % 900 / 100, 2)}
            reading = Reading(device.name, now, values, None, 0.0182, online=True, response_timeout=0.2)
            instant = Instant(now, WALL + now, "synced")
            sent = [
                each
                for each in station.on_event(reading, instant)
                if telemetry or each.kind is not PublicationKind.SAMPLE
            ]
            if station.due() <= now:
                sent += station.tick(instant)
            if second >= 0:
                there += sum(map(_size, sent))
                back += PUBACK * sum(each.qos for each in sent)
    return there * DAY // MEASURED, back * DAY // MEASURED


def _size(publication: Publication) -> int:
    payload = encode(publication.payload)
    return packet_size(f"{TOPICS}/{publication.topic}", payload, version=Version.V5, qos=publication.qos)


def bytes_table() -> str:
    """Return the table: megabytes a day to the broker, and back in brackets."""
    return table(
        ("`telemetry`", "`state_every`", "`wind.every`", *(f"{each} sensor{'s' * (each > 1)}" for each in SENSORS)),
        _rows(),
    )


def _rows() -> Iterable[tuple[str, ...]]:
    for telemetry, state_every, wind_every in SETTINGS:
        cells = (
            bytes_a_day(each, telemetry=telemetry, state_every=state_every, wind_every=wind_every) for each in SENSORS
        )
        yield (
            f"`{str(telemetry).lower()}`",
            f"`{state_every:g}s`",
            f"`{duration_text(wind_every)}`",
            *(f"{there / 1e6:.1f} MB ({back / 1e6:.2f})" for there, back in cells),
        )
