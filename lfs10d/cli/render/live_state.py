"""The state of a line and its devices as MQTT or the daemon's status file shows it. Pure.

Messages may come from any client: what is not of the documented form is ignored, text is escaped when shown.
Ages are by the daemon's clock; its difference from ours is taken from the samples as they arrive.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Mapping
from dataclasses import field
from typing import Any, Final, TypeGuard

from lfs10d.cli.render.foreign import mapping, named, number
from lfs10d.profiles.facts import RESERVED_NAMES
from lfs10d.reading import FaultCode, Value
from lfs10d.system.dataclass import dataclass

MOVES_WITHIN: Final = 3.0
"""s over which a value's movement is measured."""
STANDS_OUT: Final = 3.0
"""A value is marked if it moved this many times as far as the next one."""
FRESH: Final = 3.0
"""s after which a status file, written every second, is no longer that of a running daemon."""
LATE_AFTER: Final = 3.0
"""s beyond three intervals after which a good value counts as old."""


_LEAVES: Final = ("state", "telemetry", "availability", "stats", "error", "wind")
TOPICS: Final = ("devices", "line/state", "line/error", "line/stats", *(f"device/+/{leaf}" for leaf in _LEAVES))
"""Those that `LiveState.on_message` takes, under B."""


@dataclass(slots=True)
class ShownDevice:
    """One slave. `values` are those of the last sample, `good_ts` (epoch ms, its clock) when there were any.

    `good` are partial samples too: then `errors` says of each value that is not there why.
    """

    name: str
    slave: int | None = None
    label: str | None = None
    enabled: bool = True
    interval: float = 1.0
    online: bool = False
    seq: int = -1
    boot: str = ""
    values: dict[str, Value] = field(default_factory=dict)
    errors: dict[str, str] = field(default_factory=dict)
    units: dict[str, str] = field(default_factory=dict)
    good: bool = False
    error: str | None = None
    rtt_ms: float | None = None
    ts: float = 0.0
    """Time stamp of the last sample."""
    good_ts: float | None = None
    since: float | None = None
    """When its error rose, epoch ms of the daemon's clock; None while it has none."""
    alarm: str | None = None
    """The code of that error: of `device/<name>/error`, not of the last sample."""
    gust: float | None = None
    """The greatest mean of 3 s of the last 10 min; None where there is none."""
    mean: float | None = None
    """The mean of the last 2 min."""
    trail: deque[tuple[float, float]] = field(default_factory=deque)
    turned: tuple[float, bool] | None = None
    """Time of the last change of availability, and whether it came online."""

    @property
    def value(self) -> float | None:
        """The first of its values that is a number; None where it has none now."""
        return next((value for value in map(number, self.values.values()) if value is not None), None)

    @property
    def unit(self) -> str:
        """That value's unit."""
        return next((self.units.get(name, "") for name, value in self.values.items() if number(value) is not None), "")

    def moved(self, now: float) -> float:
        """Return the range of its value in the last seconds."""
        while self.trail and self.trail[0][0] < now - MOVES_WITHIN:
            self.trail.popleft()
        values = [value for _, value in self.trail]
        return max(values) - min(values) if values else 0.0


class LiveState:
    """One line as one source shows it. `now` is monotonic, `wall` epoch s of our own clock."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.devices: dict[str, ShownDevice] = {}
        """Those that are configured, in order."""
        self.line: dict[str, Any] = {}
        """`line/state` and `line/stats`."""
        self.line_error: str | None = None
        self.line_error_code: str | None = None
        self.line_error_since: float | None = None
        """Epoch ms of the daemon's clock."""
        self.known = False
        """Whether the devices of a daemon are known."""
        self._by_name: dict[str, ShownDevice] = {}
        """Every device with a message: a broker sends retained messages in any order."""
        self.ahead = 0.0
        """Seconds our clock is ahead of the daemon's."""

    # -- from MQTT

    def on_message(self, topic: str, payload: Any, *, old: bool, now: float, wall: float) -> None:  # noqa: ANN401 - parsed JSON
        """Take a message under B; `payload` is its JSON or its bare word, `old` that it was retained before."""
        match topic.split("/"):
            case ["devices"] if isinstance(payload, list):
                self._on_devices(payload)
            case ["line", "state" | "stats"] if isinstance(payload, dict):
                self.line.update(payload)
            case ["line", "error"] if isinstance(payload, dict):
                self._on_line_error(payload)
            case ["device", name, leaf]:
                self._on_device(self._device(name), leaf, payload, old=old, now=now, wall=wall)

    def _on_line_error(self, error: Mapping[str, Any]) -> None:
        """Take the line's error object; empty: there is none."""
        self.line_error = _active(error)
        self.line_error_code = str(error.get("code")) if self.line_error is not None else None
        self.line_error_since = _since(error)

    def _on_devices(self, entries: list[Any]) -> None:
        self.known = True
        self.devices = {}
        for name, entry in named(entries):
            self.devices[name] = device = self._device(name)
            _describe(device, entry, slave=entry.get("id"))

    def _device(self, name: str) -> ShownDevice:
        return self._by_name.setdefault(name, ShownDevice(name))

    def _on_device(self, device: ShownDevice, leaf: str, payload: Any, *, old: bool, now: float, wall: float) -> None:  # noqa: ANN401 - parsed JSON
        if leaf == "availability":
            self._on_availability(device, payload == "online", now=None if old else now)
        elif isinstance(payload, dict):
            if leaf == "stats":
                last = number(payload.get("last_good_ts"))
                if last is not None and (device.good_ts is None or last > device.good_ts):
                    device.good_ts = last
            elif leaf == "error":
                _error(device, payload)
            elif leaf == "wind":
                _wind(device, payload)
            elif leaf in {"state", "telemetry"}:
                self._on_sample(device, payload, old=old, now=now, wall=wall)

    def _on_sample(self, device: ShownDevice, sample: Mapping[str, Any], *, old: bool, now: float, wall: float) -> None:
        seq, boot, ts = sample.get("seq"), str(sample.get("boot")), number(sample.get("ts"))
        if not isinstance(seq, int) or ts is None or (boot == device.boot and seq <= device.seq):
            return  # the state repeats a sample of telemetry, or is no sample
        if not device.enabled and sample.get("error") != "disabled":
            return  # polled for a request alone
        values = {name: value for name, value in sample.items() if name not in RESERVED_NAMES}
        units = sample.get("units")
        if not isinstance(units, dict):
            units = dict.fromkeys(values, sample.get("unit") or "")
        if not old:
            self.ahead = wall - ts / 1000
        device.seq, device.boot, device.ts = seq, boot, ts
        _sample(device, sample, values, units)
        if device.good:
            device.good_ts = ts
        if not old:
            _trail(device, now)

    def _on_availability(self, device: ShownDevice, online: bool, *, now: float | None) -> None:  # noqa: FBT001 - what it says
        if now is not None and online is not device.online:
            device.turned = now, online
        device.online = online

    # -- from the status file

    def on_status(self, status: Mapping[str, Any], *, now: float) -> None:
        """Take the daemon's status as it was written, by the clock of this machine."""
        ts = number(status.get("ts")) or 0.0
        self.known = True
        line = status.get("line")
        if isinstance(line, dict):
            self.line = line
            self._on_line_error(mapping(line.get("error")))
        self.devices = {}
        for name, entry in named(status.get("devices")):
            known = name in self._by_name
            self.devices[name] = device = self._device(name)
            self._on_device_status(device, entry, ts, now=now if known else None)

    def _on_device_status(self, device: ShownDevice, entry: Mapping[str, Any], ts: float, *, now: float | None) -> None:
        _describe(device, entry, slave=entry.get("slave"))
        self._on_availability(device, entry.get("online") is True, now=now)
        seq = entry.get("seq")
        fresh = seq != device.seq
        device.seq = seq if isinstance(seq, int) else -1
        _sample(device, entry, mapping(entry.get("values")), mapping(entry.get("units")))
        _wind(device, mapping(entry.get("wind")))
        _error(device, mapping(entry.get("alarm")))
        age = number(entry.get("age_s"))
        device.good_ts = None if age is None else ts - age * 1000
        if fresh and now is not None:
            _trail(device, now)

    # -- what is shown

    @staticmethod
    def first_value(sample: Mapping[str, Any]) -> float | None:
        """Return the first value of a sample or of a device in the status file; None where it has none."""
        given = sample.get("values")
        values = given.items() if isinstance(given, dict) else sample.items()
        numbers = (number(value) for name, value in values if name not in RESERVED_NAMES)
        return next((number for number in numbers if number is not None), None)

    def mark(self, name: str) -> tuple[str, int]:
        """Return boot and number of the device's last sample, which differ once it has a newer one."""
        device = self._by_name.get(name)
        return ("", -1) if device is None else (device.boot, device.seq)

    def age(self, device: ShownDevice, wall: float) -> float | None:
        """Return how many s ago it gave its last good value; None: never as far as we know.

        A device that is shown as not polled yet has none since then, though statistics may know of one already.
        """
        if device.good_ts is None or (device.error == FaultCode.STARTING and device.good_ts >= device.ts):
            return None
        return max(0.0, wall - self.ahead - device.good_ts / 1000)

    def late(self, device: ShownDevice, wall: float) -> bool:
        """Whether its last good value is older than it should be."""
        age = self.age(device, wall)
        return age is None or age > 3 * device.interval + LATE_AFTER

    def movers(self, now: float) -> Iterator[ShownDevice]:
        """Yield the devices that just moved: of each unit the one that went farther than all others by much."""
        moved: dict[str, list[tuple[float, ShownDevice]]] = {}
        for device in self.devices.values():
            moved.setdefault(device.unit, []).append((device.moved(now), device))
        for ranking in moved.values():
            ranking.sort(key=lambda each: each[0], reverse=True)
            (farthest, device), second = ranking[0], ranking[1][0] if len(ranking) > 1 else 0.0
            if farthest > 0 and farthest >= STANDS_OUT * second and device.good:
                yield device


def _describe(device: ShownDevice, entry: Mapping[str, Any], *, slave: object) -> None:
    device.slave = slave if isinstance(slave, int) else None
    label = entry.get("label")
    device.label = label if isinstance(label, str) else None
    device.enabled = entry.get("enabled") is not False
    device.interval = number(entry.get("interval")) or 1.0


def _sample(
    device: ShownDevice, sample: Mapping[str, Any], values: Mapping[str, Any], units: Mapping[str, Any]
) -> None:
    error = sample.get("error")
    device.good = sample.get("quality") in ("good", "partial")  # of a partial one the values that are there are good
    device.error = error if isinstance(error, str) else None
    device.rtt_ms = number(sample.get("rtt_ms"))
    device.values = {str(name): value for name, value in values.items() if _is_value(value)}
    errors = mapping(sample.get("errors")) if device.good else {}
    device.errors = {str(name): code for name, code in errors.items() if isinstance(code, str)}
    device.units = {str(name): unit for name, unit in units.items() if isinstance(unit, str)}


def _error(device: ShownDevice, error: Mapping[str, Any]) -> None:
    """Take a device's error object; empty: there is none."""
    device.since = _since(error)
    device.alarm = str(error.get("code")) if error.get("active") is True else None


def _wind(device: ShownDevice, wind: Mapping[str, Any]) -> None:
    device.gust, device.mean = number(wind.get("gust_10m")), number(wind.get("mean_2m"))


def _trail(device: ShownDevice, now: float) -> None:
    if device.value is not None:
        device.trail.append((now, device.value))


def _is_value(value: object) -> TypeGuard[Value]:
    """Whether something is a finite number, a text or a boolean."""
    return isinstance(value, bool | str) or number(value) is not None


def _active(error: Mapping[str, Any]) -> str | None:
    """Return the words of an error object; None where there is no error."""
    if error.get("active") is not True:
        return None
    message = error.get("message")
    return message if isinstance(message, str) and message else str(error.get("code"))


def _since(error: Mapping[str, Any]) -> float | None:
    """Return when an error object's error rose, epoch ms; None where there is no error."""
    return number(error.get("since")) if error.get("active") is True else None
