"""The figures for Prometheus, as OpenMetrics 1.0 or as Prometheus' own text format. Pure.

A value that is not good now is absent, and so is everything of a daemon that is away but whether it is connected:
Prometheus then shows a gap, and never an old number as a new one.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import field
from typing import Any, Final

from lfs10d import __version__
from lfs10d.cli.render.live_state import ShownDevice
from lfs10d.system.dataclass import dataclass
from lfs10d.web.line_model import LineModel, Side
from lfs10d.web.pruned import MOST_NUMBER

OPENMETRICS: Final = "application/openmetrics-text; version=1.0.0; charset=utf-8"
PROMETHEUS: Final = "text/plain; version=0.0.4; charset=utf-8"
"""Content types."""

_UNITS: Final = {
    "m/s": "meters_per_second", "km/h": "kilometers_per_hour", "°": "degrees", "deg": "degrees", "°C": "celsius",
    "%": "percent", "%RH": "percent", "hPa": "hectopascals", "Pa": "pascals", "mm": "millimeters", "m": "meters",
    "V": "volts", "A": "amperes", "W": "watts", "lx": "lux", "lux": "lux", "s": "seconds", "Hz": "hertz", "1": "",
    "W/m2": "watts_per_square_meter", "W/m²": "watts_per_square_meter", "mm/h": "millimeters_per_hour",
}  # fmt: skip
_DEVICE: Final = "lfs10d_device"
_OWN: Final = frozenset(
    f"{_DEVICE}_{own}{suffix}"
    for own in ("online", "polls", "poll_errors", "response_seconds", "last_good_timestamp_seconds")
    for suffix in ("", "_total", "_created", "_count", "_sum")
)
"""Names that our own metrics of a device have or may have (OpenMetrics 1.0, section 4.3)."""
_NO_EXCHANGE: Final = frozenset({"overrun", "port_lost", "port_busy"})
"""Codes that are counted without a request on the line."""
_OLD_AFTER: Final = 1.5
"""s beyond three intervals after which a value is not published: the way from the sensor to here takes some."""


@dataclass(slots=True)
class Family:
    """The samples of one metric. `unit` is the end of its name, as OpenMetrics wants it told."""

    name: str
    kind: str
    help: str
    unit: str = ""
    rows: dict[tuple[str, tuple[tuple[str, str], ...]], float] = field(default_factory=dict)
    """By suffix and labels."""

    def add(self, value: object, suffix: str = "", **labels: str) -> None:
        """Add a sample, if the value is a finite number; of two with the same labels the first stays."""
        number = _number(value)
        if number is not None:
            self.rows.setdefault((suffix, tuple(labels.items())), float(number))


def openmetrics_wanted(accept: str) -> bool:
    """Return whether an Accept header prefers OpenMetrics to Prometheus' text (RFC 9110, section 12.5.1)."""
    best = {"application/openmetrics-text": 0.0, "text/plain": 0.0}
    for each in accept.split(","):
        kind, *parameters = (part.strip().lower() for part in each.split(";"))
        given = next((part.removeprefix("q=") for part in parameters if part.startswith("q=")), "1")
        weight = float(given) if re.fullmatch(r"[01](\.\d{0,3})?", given) else 0.0
        if kind in best:
            best[kind] = max(best[kind], weight)
    return best["application/openmetrics-text"] > 0 and best["application/openmetrics-text"] >= best["text/plain"]


def text(lines: Iterable[LineModel], wall: float, *, openmetrics: bool) -> str:
    """Return the figures of these lines; `wall` is now, epoch seconds of this machine."""
    families = _Families()
    families.of("lfs10d_build_info", "gauge", "The version of lfs10d that serves these metrics.").add(
        1, version=__version__
    )
    for line in lines:
        _add_line(families, line, wall)
    written = [row for family in families for row in _written(family, openmetrics=openmetrics)]
    return "".join(f"{row}\n" for row in written) + ("# EOF\n" if openmetrics else "")


class _Families:
    def __init__(self) -> None:
        self._families: dict[str, Family] = {}

    def of(self, name: str, kind: str, words: str, unit: str = "") -> Family:
        return self._families.setdefault(name, Family(name, kind, words, unit))

    def __iter__(self) -> Iterator[Family]:
        return iter(self._families.values())


def _add_line(families: _Families, line: LineModel, wall: float) -> None:
    source = line.source(wall)
    key = line.key
    connected = line.broker(source)["connected"]
    families.of("lfs10d_mqtt_connected", "gauge", "Whether the daemon is connected to its broker.").add(
        1 if connected else 0, line=key
    )
    if not source.alive:
        return
    side = line.side(source)
    state = side.live.line
    load = _number(state.get("load_pct"))
    if load is not None:
        families.of("lfs10d_line_load_ratio", "gauge", "Share of time in which the line is in use.", "ratio").add(
            load / 100, line=key
        )
    _add_exchanges(families, key, state)
    gaps = _mapping(state.get("gap_us"))
    for quantile, name in (("0", "min"), ("0.5", "p50"), ("0.99", "p99")):
        gap = _number(gaps.get(name))
        if gap is not None:
            families.of(
                "lfs10d_line_gap_seconds", "summary", "Silence measured before requests; 0 is the least.", "seconds"
            ).add(gap / 1e6, line=key, quantile=quantile)
    broker, store = line.broker(source), _mapping(state.get("store"))
    families.of("lfs10d_store_samples", "gauge", "Samples waiting for the broker.").add(broker["waiting"], line=key)
    families.of("lfs10d_store_dropped", "counter", "Samples dropped since the daemon's start.").add(
        store.get("dropped"), "_total", line=key
    )
    for device in side.live.devices.values():
        _add_device(families, line, side, device, wall)


def _add_exchanges(families: _Families, key: str, state: Mapping[str, Any]) -> None:
    exchanges = _number(state.get("exchanges"))
    errors = {code: count for code, count in _counts(state.get("errors")).items() if code not in _NO_EXCHANGE}
    if exchanges is None:
        return
    family = families.of("lfs10d_line_exchanges", "counter", "Requests on the line since the daemon's start.")
    family.add(max(0, exchanges - sum(errors.values())), "_total", line=key, result="ok")
    for code, count in errors.items():
        family.add(count, "_total", line=key, result=code)


def _add_device(families: _Families, line: LineModel, side: Side, device: ShownDevice, wall: float) -> None:
    labels = {"line": line.key, "device": device.name}
    families.of(f"{_DEVICE}_online", "gauge", "Whether the device answers.").add(int(device.online), **labels)
    age = side.live.age(device, wall)
    sample = side.samples.get(device.name, {})
    fresh = age is not None and age <= 3 * device.interval + _OLD_AFTER
    if sample.get("quality") in ("good", "partial") and device.enabled and fresh:
        for name, value in device.values.items():
            unit = unit_words(device.units.get(name, ""))
            families.of(
                _gauge(name, unit), "gauge", f"{name.replace('_', ' ')} as the device measured it last.", unit
            ).add(value, **labels)
    stats = _mapping(side.extras.get((device.name, "stats")))
    families.of(f"{_DEVICE}_polls", "counter", "Polls since the daemon's start.").add(
        stats.get("polls"), "_total", **labels
    )
    for code, count in _counts(stats.get("errors")).items():
        families.of(f"{_DEVICE}_poll_errors", "counter", "Failed polls since the daemon's start, by code.").add(
            count, "_total", **labels, code=code
        )
    rtt = _mapping(stats.get("rtt_ms"))
    for quantile, name in (("0.5", "p50"), ("0.95", "p95")):
        time = _number(rtt.get(name))
        if time is not None:
            families.of(
                f"{_DEVICE}_response_seconds",
                "summary",
                "First bit of the request to last bit of the reply.",
                "seconds",
            ).add(time / 1e3, **labels, quantile=quantile)
    if device.good_ts is not None:
        families.of(
            f"{_DEVICE}_last_good_timestamp_seconds",
            "gauge",
            "When the device gave its last good value, by the daemon's clock.",
            "seconds",
        ).add(device.good_ts / 1e3, **labels)


def _gauge(name: str, unit: str) -> str:
    """Return the name of a value's metric, which is none of our own."""
    ending = f"_{unit}" if unit and not name.endswith(f"_{unit}") else ""
    metric = f"{_DEVICE}_{_metric_part(name)}{ending}"
    return f"{metric}_value" if metric in _OWN else metric


def unit_words(unit: str) -> str:
    """Return a unit as it stands in the name of a metric; letters and digits alone where it is not known."""
    return _UNITS[unit] if unit in _UNITS else _metric_part(unit).strip("_")


def _metric_part(name: str) -> str:
    return re.sub(r"[^a-z0-9]+", "_", name.lower())


def _written(family: Family, *, openmetrics: bool) -> Iterator[str]:
    """Yield the lines of a family; nothing where it has no sample."""
    if not family.rows:
        return
    total = family.kind == "counter" and not openmetrics
    name = f"{family.name}_total" if total else family.name
    yield f"# HELP {name} {_escaped(family.help)}"
    yield f"# TYPE {name} {family.kind}"
    if openmetrics and family.unit and family.name.endswith(f"_{family.unit}"):
        yield f"# UNIT {name} {family.unit}"
    for (suffix, labels), value in family.rows.items():
        shown = ",".join(f'{label}="{_escaped(text)}"' for label, text in labels)
        yield f"{family.name}{suffix}{{{shown}}} {_figure(value)}"


def _figure(value: float) -> str:
    return str(int(value)) if value.is_integer() and abs(value) < 2**53 else repr(round(value, 9))


def _escaped(words: str) -> str:
    return words.replace("\\", r"\\").replace('"', r"\"").replace("\n", r"\n")


def _number(value: object) -> float | None:
    """Return a value that is a finite number."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    return value if abs(value) < MOST_NUMBER else None


def _mapping(value: object) -> Mapping[str, Any]:
    return value if isinstance(value, Mapping) else {}


def _counts(value: object) -> dict[str, float]:
    """Return counts by code; what is no code is left out, for anybody may publish it."""
    counts = {str(code): _number(count) for code, count in _mapping(value).items()}
    return {code: count for code, count in counts.items() if count is not None and re.fullmatch(r"[a-z_]{1,32}", code)}
