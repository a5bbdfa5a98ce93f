"""One line as the page shows it: from MQTT, or from the daemon's status file while the broker is away. Pure.

`now` is monotonic, `wall` epoch seconds of this machine; times in a summary are epoch milliseconds of this machine.
"""

from __future__ import annotations

import re
from collections import deque
from collections.abc import Iterator, Mapping
from dataclasses import field
from typing import Any, Final, TypeGuard

from lfs10d.cli.render.foreign import mapping, named
from lfs10d.cli.render.live_state import FRESH, LiveState, ShownDevice
from lfs10d.system.dataclass import dataclass
from lfs10d.web.curve import Curve, Point
from lfs10d.web.pruned import pruned
from lfs10d.web.words import explained, meaning

MOST_DEVICES: Final = 255
FRAMES_KEPT: Final = 200
EVENTS_KEPT: Final = 30
OVERVIEW: Final = 600
"""s of the curve in the overview."""
_NAME: Final = re.compile(r"[a-z0-9_-]{1,32}")

_DEVICE_LEAVES: Final = ("stats", "config", "wind")
_LINE_KEYS: Final = (
    "port", "baudrate", "parity", "databits", "stopbits", "framing", "open", "activity", "requests",
    "load_pct", "polls_per_s", "cycle_s", "gap_required_us", "gap_us", "exchanges", "errors", "store", "uart",
    "unsolicited_bytes",
)  # fmt: skip
_INFO_KEYS: Final = ("version", "host", "boot", "started", "clock", "changes", "features", "mqtt")


@dataclass(frozen=True, slots=True)
class Source:
    """The source of the figures: `broker`, `status` (the file), or `none` if they are not current; and in words."""

    kind: str
    words: str

    @property
    def alive(self) -> bool:
        """Whether the figures are current."""
        return self.kind != "none"


@dataclass(slots=True)
class Side:
    """The line as one source shows it: its live state and its other last payloads."""

    live: LiveState
    samples: dict[str, dict[str, Any]] = field(default_factory=dict)
    faults: dict[str, Mapping[str, Any]] = field(default_factory=dict)
    extras: dict[tuple[str, str], dict[str, Any]] = field(default_factory=dict)
    """`stats`, `config` and `wind` by device and leaf."""
    profiles: dict[str, str] = field(default_factory=dict)
    info: Mapping[str, Any] = field(default_factory=dict)
    line_error: Mapping[str, Any] | None = None


@dataclass(slots=True)
class Link:
    """The broker and the daemon there: `why` says what is wrong with the broker, empty where nothing is."""

    place: str
    connected: bool = False
    daemon: str | None = None
    """Its last availability; None: none yet."""
    why: str = ""


class LineModel:
    """One line; `changed` are the devices with news since it was emptied last."""

    def __init__(self, key: str, name: str, base: str, link: Link) -> None:
        self.key = key
        self.name = name
        self.base = base
        self.link = link
        self.changed: set[str] = set()
        self.scan: dict[str, Any] | None = None
        self.frames: deque[dict[str, Any]] = deque(maxlen=FRAMES_KEPT)
        self.frames_seen = 0
        self.events: deque[dict[str, Any]] = deque(maxlen=EVENTS_KEPT)
        self.curves: dict[str, Curve] = {}
        self._mqtt = Side(LiveState(name))
        self._names: set[str] = set()
        """Devices that something was published about."""
        self._status: Side | None = None
        self._status_ts = 0.0
        self._status_place = ""
        self._broker: Mapping[str, Any] = {}
        self._heard_at = 0.0
        self._kind = ""

    # What comes in

    def on_message(self, topic: str, payload: Any, *, old: bool, now: float, wall: float) -> None:  # noqa: ANN401 - parsed JSON
        """Take a message under the line's topic; `payload` is its JSON or its bare word, `old`: retained before."""
        self._heard_at = wall
        match topic.split("/"):
            case ["device", name, leaf]:
                if self._may_be(name):
                    self._on_device(name, leaf, payload, old=old, now=now, wall=wall)
            case ["availability"] if payload in ("online", "offline"):
                self.link.daemon = payload
            case ["devices"] if isinstance(payload, list):
                self._on_devices(payload[:MOST_DEVICES], old=old, now=now, wall=wall)
            case _ if isinstance(payload, dict):
                self._on_line(topic, payload, old=old, now=now, wall=wall)

    def _on_line(self, topic: str, message: dict[str, Any], *, old: bool, now: float, wall: float) -> None:
        side, payload = self._mqtt, pruned(message)
        match topic:
            case "info":
                side.info = payload
            case "event":
                self._on_event(payload)
            case "trace":
                self.frames.append(payload)
                self.frames_seen += 1
            case "line/error":
                side.line_error = payload
            case _:
                side.live.on_message(topic, payload, old=old, now=now, wall=wall)

    def _may_be(self, name: str) -> bool:
        """Whether this may be a device: any client may publish, and nothing here may grow without limit."""
        if name not in self._names and len(self._names) < 2 * MOST_DEVICES and _NAME.fullmatch(name):
            self._names.add(name)
        return name in self._names

    def _on_devices(self, entries: list[Any], *, old: bool, now: float, wall: float) -> None:
        side = self._mqtt
        side.live.on_message("devices", entries, old=old, now=now, wall=wall)
        side.profiles = {str(each.get("name")): str(each.get("profile")) for each in entries if isinstance(each, dict)}
        self.changed |= side.live.devices.keys()
        for gone in self._names - side.live.devices.keys():
            side.samples.pop(gone, None)
            side.faults.pop(gone, None)
            self.curves.pop(gone, None)
            for leaf in _DEVICE_LEAVES:
                side.extras.pop((gone, leaf), None)

    def _on_device(self, name: str, leaf: str, payload: Any, *, old: bool, now: float, wall: float) -> None:  # noqa: ANN401 - parsed JSON
        side = self._mqtt
        if leaf == "history":
            for sample in payload[:100] if isinstance(payload, list) else ():
                self._draw(name, sample, side.live)
            return
        before = side.live.mark(name)
        side.live.on_message(f"device/{name}/{leaf}", payload, old=old, now=now, wall=wall)
        self.changed.add(name)
        if not isinstance(payload, dict):
            return
        if leaf in _DEVICE_LEAVES:
            side.extras[name, leaf] = pruned(payload)
        elif leaf == "error":
            side.faults[name] = pruned(payload)
        elif side.live.mark(name) != before:
            side.samples[name] = payload
            self._draw(name, payload, side.live)

    def _draw(self, name: str, sample: object, live: LiveState) -> None:
        """Add a sample to the device's curve."""
        if not isinstance(sample, dict) or sample.get("error") in ("starting", "disabled"):  # it may be unhashable
            return
        ts = sample.get("ts")
        if _is_time(ts):
            value = live.first_value(sample)
            self.curves.setdefault(name, Curve()).add(ts / 1000 + live.ahead, value)

    def _on_event(self, event: dict[str, Any]) -> None:
        if event.get("type") == "scan_progress":
            keys = ("percent", "remaining_s", "baudrate", "slave")
            self.scan = {key: event.get(key) for key in keys}
        else:
            self.events.append(event)

    def on_status(self, place: str, status: Mapping[str, Any], *, now: float) -> None:
        """Take the daemon's status file, read at `place`."""
        ts = status.get("ts")
        if not _is_time(ts) or ts / 1000 == self._status_ts:
            return
        status = pruned(status)
        side = self._status = Side(LiveState(self.name)) if self._status is None else self._status
        side.live.on_status(status, now=now)
        self._status_ts, self._status_place = ts / 1000, place
        side.info = mapping(status.get("info"))
        side.line_error = mapping(mapping(status.get("line")).get("error"))
        self._broker = mapping(status.get("broker"))
        for name, entry in named(status.get("devices")):
            self._on_device_status(side, name, entry)

    def _on_device_status(self, side: Side, name: str, entry: dict[str, Any]) -> None:
        side.profiles[name] = str(entry.get("profile"))
        side.faults[name] = mapping(entry.get("alarm"))
        fresh = side.samples.get(name, {}).get("seq") != entry.get("seq")
        side.samples[name] = {**entry, **mapping(entry.get("values"))}
        if self._kind == "status":
            self.changed.add(name)
            if fresh:
                self._draw(name, side.samples[name], side.live)

    # What is shown

    def source(self, wall: float) -> Source:
        """Return the better source: the broker where the daemon is online there, else a file that is being written."""
        link = self.link
        if link.connected and link.daemon == "online" and self._mqtt.live.known:
            return Source("broker", f"live from {link.place}")
        why = link.why or f"{link.place} is away"
        if link.connected:
            offline = f"{link.place}: the daemon is offline there"
            why = offline if link.daemon is not None else f"{link.place}: no daemon has published there yet"
        if self._status is not None and abs(wall - self._status_ts) <= FRESH:
            return Source("status", f"live from {self._status_place} ({why})")
        return Source("none", f"not live: {why}")

    def side(self, source: Source) -> Side:
        """Return what is shown: of two sources that are not current the newer one."""
        if self._status is None or source.kind == "broker":
            return self._mqtt
        newer = not self._mqtt.live.known or self._status_ts > self._heard_at
        return self._status if source.kind == "status" or newer else self._mqtt

    def summary(self, wall: float) -> dict[str, Any]:
        """Return the line without its devices."""
        source = self.source(wall)
        side = self.side(source)
        if source.kind != self._kind:
            self._kind = source.kind
            self.changed |= side.live.devices.keys()
        line = side.live.line
        activity = line.get("activity")
        if activity != "scanning":
            self.scan = None
        return {
            "key": self.key,
            "name": self.name,
            "base": self.base,
            "known": side.live.known,
            "source": {"kind": source.kind, "words": source.words},
            "reached": self.link.connected,
            "daemon": self.link.daemon if self.link.connected else None,
            "broker": self.broker(source),
            "info": {key: side.info.get(key) for key in _INFO_KEYS},
            "line": {key: line[key] for key in _LINE_KEYS if key in line},
            "error": explained(side.line_error) if source.alive else None,
            "scan": self.scan,
            "order": list(side.live.devices),
            "events": list(self.events),
        }

    def broker(self, source: Source) -> dict[str, Any]:
        """Return the daemon's connection to the broker, and how many samples wait for it."""
        if source.kind == "broker":
            waiting = mapping(self._mqtt.live.line.get("store")).get("depth")
            return {"connected": True, "waiting": waiting, "place": self.link.place}
        connected = self._broker.get("connected") is True if source.kind == "status" else None
        return {"connected": connected, "waiting": self._broker.get("depth"), "place": self.link.place}

    def devices(self, names: set[str] | None, wall: float) -> Iterator[tuple[str, dict[str, Any]]]:
        """Yield the devices of these names (None: all), each with its summary."""
        source = self.source(wall)
        side = self.side(source)
        for name, device in side.live.devices.items():
            if names is None or name in names:
                yield name, self._device(side, device, wall)

    def _device(self, side: Side, device: ShownDevice, wall: float) -> dict[str, Any]:
        name = device.name
        sample = side.samples.get(name, {})
        age = side.live.age(device, wall)
        stats, config, wind = (self._mqtt.extras.get((name, leaf)) for leaf in _DEVICE_LEAVES)
        if side is self._status:  # what was published before stands beside no value of now
            wind = sample["wind"] if isinstance(sample.get("wind"), dict) else None
        errors = sample.get("errors")
        return {
            "name": name,
            "id": device.slave,
            "label": pruned(device.label),
            "profile": side.profiles.get(name),
            "enabled": device.enabled,
            "interval": device.interval,
            "online": device.online,
            "seq": device.seq,
            "values": device.values,
            "units": {key: pruned(device.units.get(key)) for key in device.values},
            "quality": pruned(sample.get("quality")),
            "error": device.error,
            "error_words": None if device.error is None else meaning(device.error),
            "errors": pruned(errors) if isinstance(errors, dict) else None,
            "rtt_ms": device.rtt_ms,
            "good_at": None if age is None else round((wall - age) * 1000),
            "fault": explained(side.faults.get(name)),
            "stats": stats,
            "config": config,
            "wind": wind,
        }

    def recent(self, name: str) -> list[Point]:
        """Return the curve of the overview."""
        curve = self.curves.get(name)
        return [] if curve is None else curve.recent(OVERVIEW)


def _is_time(ts: object) -> TypeGuard[int]:
    """Return whether it may be epoch ms."""
    return isinstance(ts, int) and not isinstance(ts, bool) and 0 < ts < 2**46
