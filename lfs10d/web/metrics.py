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
from lfs10d.cli.render.foreign import mapping, number
from lfs10d.cli.render.live_state import ShownDevice
from lfs10d.system.dataclass import dataclass
from lfs10d.web.line_model import LineModel, Side

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
_GAP: Final = "lfs10d_line_gap_seconds"
_RESPONSE: Final = f"{_DEVICE}_response_seconds"
_PER_SECOND: Final = {_GAP: 1e6, _RESPONSE: 1e3}
"""In how many of its unit a second is published."""
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
        figure = number(value)
        if figure is not None:
            self.rows.setdefault((suffix, tuple(labels.items())), float(figure))


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
    families.gauge("lfs10d_build_info", "The version of lfs10d that serves these metrics.", 1, version=__version__)
    for line in lines:
        _add_line(families, line, wall)
    written = [row for family in families.values() for row in _written(family, openmetrics=openmetrics)]
    return "".join(f"{row}\n" for row in written) + ("# EOF\n" if openmetrics else "")


class _Families(dict[str, Family]):
    """By name, in order."""

    def of(self, name: str, kind: str, words: str, unit: str = "") -> Family:
        return self.setdefault(name, Family(name, kind, words, unit))

    def gauge(self, name: str, words: str, value: object, unit: str = "", **labels: str) -> None:
        self.of(name, "gauge", words, unit).add(value, **labels)

    def counter(self, name: str, words: str, value: object, **labels: str) -> None:
        self.of(name, "counter", words).add(value, "_total", **labels)

    def quantiles(self, name: str, words: str, figures: object, keys: Mapping[str, str], **labels: str) -> None:
        """Add those of these figures that are there, in seconds by quantile."""
        for quantile, key in keys.items():
            figure = number(mapping(figures).get(key))
            if figure is not None:
                per_second = _PER_SECOND[name]
                self.of(name, "summary", words, "seconds").add(figure / per_second, **labels, quantile=quantile)


def _add_line(families: _Families, line: LineModel, wall: float) -> None:
    source, key = line.source(wall), line.key
    broker = line.broker(source)
    connected = 1 if broker["connected"] else 0
    families.gauge("lfs10d_mqtt_connected", "Whether the daemon is connected to its broker.", connected, line=key)
    if not source.alive:
        return
    side = line.side(source)
    state = side.live.line
    load = number(state.get("load_pct"))
    if load is not None:
        words = "Share of time in which the line is in use."
        families.gauge("lfs10d_line_load_ratio", words, load / 100, "ratio", line=key)
    _add_exchanges(families, key, state)
    words = "Silence measured before requests; 0 is the least."
    families.quantiles(_GAP, words, state.get("gap_us"), {"0": "min", "0.5": "p50", "0.99": "p99"}, line=key)
    families.gauge("lfs10d_store_samples", "Samples waiting for the broker.", broker["waiting"], line=key)
    dropped = mapping(state.get("store")).get("dropped")
    families.counter("lfs10d_store_dropped", "Samples dropped since the daemon's start.", dropped, line=key)
    for device in side.live.devices.values():
        _add_device(families, line, side, device, wall)


def _add_exchanges(families: _Families, key: str, state: Mapping[str, Any]) -> None:
    exchanges = number(state.get("exchanges"))
    errors = {code: count for code, count in _counts(state.get("errors")).items() if code not in _NO_EXCHANGE}
    if exchanges is None:
        return
    for result, count in (("ok", max(0, exchanges - sum(errors.values()))), *errors.items()):
        words = "Requests on the line since the daemon's start."
        families.counter("lfs10d_line_exchanges", words, count, line=key, result=result)


def _add_device(families: _Families, line: LineModel, side: Side, device: ShownDevice, wall: float) -> None:
    labels = {"line": line.key, "device": device.name}
    families.gauge(f"{_DEVICE}_online", "Whether the device answers.", int(device.online), **labels)
    age = side.live.age(device, wall)
    sample = side.samples.get(device.name, {})
    fresh = age is not None and age <= 3 * device.interval + _OLD_AFTER
    if sample.get("quality") in ("good", "partial") and device.enabled and fresh:
        for name, value in device.values.items():
            unit = unit_words(device.units.get(name, ""))
            words = f"{name.replace('_', ' ')} as the device measured it last."
            families.gauge(_gauge(name, unit), words, value, unit, **labels)
    stats = mapping(side.extras.get((device.name, "stats")))
    families.counter(f"{_DEVICE}_polls", "Polls since the daemon's start.", stats.get("polls"), **labels)
    for code, count in _counts(stats.get("errors")).items():
        words = "Failed polls since the daemon's start, by code."
        families.counter(f"{_DEVICE}_poll_errors", words, count, **labels, code=code)
    words = "First bit of the request to last bit of the reply."
    families.quantiles(_RESPONSE, words, stats.get("rtt_ms"), {"0.5": "p50", "0.95": "p95"}, **labels)
    if device.good_ts is not None:
        words = "When the device gave its last good value, by the daemon's clock."
        families.gauge(f"{_DEVICE}_last_good_timestamp_seconds", words, device.good_ts / 1e3, "seconds", **labels)


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


def _counts(value: object) -> dict[str, float]:
    """Return counts by code; what is no code is left out, for anybody may publish it."""
    counts = {str(code): number(count) for code, count in mapping(value).items()}
    return {code: count for code, count in counts.items() if count is not None and re.fullmatch(r"[a-z_]{1,32}", code)}
