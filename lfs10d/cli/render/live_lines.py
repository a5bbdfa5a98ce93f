"""The live view as lines for pipes and programs: one for each new value or other change. Pure."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from datetime import tzinfo
from typing import Any

from lfs10d.cli.local_time import stamp, zone_name
from lfs10d.cli.render.foreign import mapping
from lfs10d.cli.render.live_state import LiveState, ShownDevice
from lfs10d.cli.render.live_table import DataSource, TableRow, header, rows, table
from lfs10d.telemetry.publication import iso_time

WIDE = 10_000
"""Columns: a line in a pipe is never wrapped."""


class LiveLines:
    """Keeps what was printed last; text has the times of `zone` (None: this machine's), data those of UTC."""

    def __init__(self, zone: tzinfo | None = None) -> None:
        self._zone = zone
        self._heading: tuple[str, ...] = ()
        self._printed: dict[str, tuple[object, ...]] = {}

    def changes(
        self, live: LiveState, source: DataSource, *, now: float, wall: float
    ) -> Iterator[tuple[str, dict[str, Any] | None]]:
        """Yield each new line as text and as data for JSON; a heading, which begins with #, has no data."""
        lines = header(live, source, WIDE, pace=False, wall=wall, zone=self._zone)
        heading = tuple("".join(text for text, _ in line) for line in lines)
        if heading != self._heading:
            self._heading = heading
            yield from ((f"# {text}", None) for text in heading)
        for row, device in zip(
            rows(live, source, now=now, wall=wall, zone=self._zone), live.devices.values(), strict=True
        ):
            printed = (device.boot, device.seq, row.state, row.value)
            if self._printed.get(device.name) != printed:
                self._printed[device.name] = printed
                ts = round(wall * 1000)
                data = _data(device, row, iso_time(ts), age=live.age(device, wall), alive=source.alive)
                yield _text(row, stamp(ts, self._zone)), data


def health(status: Mapping[str, Any], zone: tzinfo | None = None) -> Iterator[str]:
    """Yield the daemon's status in words."""
    broker, ts = mapping(status.get("broker")), status.get("ts")
    live = LiveState(str(mapping(status.get("line")).get("name", "?")))
    live.on_status(status, now=0.0)
    connected, waiting = broker.get("connected") is True, broker.get("depth")
    words = f"broker {'connected' if connected else 'away'}" + (f", {waiting} samples wait" if waiting else "")
    wall = ts / 1000 if isinstance(ts, int) else 0.0
    source = DataSource(f"{words}; times: {zone_name(wall * 1000, zone)}", alive=True)
    shown = rows(live, source, now=0.0, wall=wall, zone=zone)
    for pieces in (*header(live, source, WIDE, wall=wall, zone=zone), (), *table(shown, WIDE)):
        yield "".join(text for text, _ in pieces)


def _text(row: TableRow, time: str) -> str:
    words = [time, row.name, row.slave, row.value, row.state]
    if row.rtt:
        words.append(f"answer {row.rtt}")
    if row.age and not (row.good and not row.stale):
        words.append(f"last value {row.age} ago")
    if row.just:
        words.append(row.just)
    return "  ".join(words)


def _data(device: ShownDevice, row: TableRow, time: str, *, age: float | None, alive: bool) -> dict[str, Any]:
    return {
        "time": time,
        "device": device.name,
        "slave": device.slave,
        "label": device.label,
        "values": device.values,
        "units": device.units,
        "state": row.state,
        "error": device.error,
        "errors": device.errors,
        "online": device.online,
        "age_s": None if age is None else round(age, 1),
        "rtt_ms": device.rtt_ms,
        "gust_10m": device.gust,
        "mean_2m": device.mean,
        "just": row.just or None,
        "live": alive and not row.stale,
    }
