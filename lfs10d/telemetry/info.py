"""Configured facts about the daemon, the line and the devices, as they are published."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field

from lfs10d.reading import NOTHING
from lfs10d.system.clock_step import ClockState
from lfs10d.system.dataclass import dataclass
from lfs10d.telemetry.publication import VERSION


@dataclass(frozen=True, slots=True)
class DaemonInfo:
    """The content of `info`; `boot` stays the same during one run of the daemon, `mqtt` is any JSON object."""

    version: str
    host: str
    boot: str
    previous_boot: str | None
    config_hash: str
    changes: int = 0
    mqtt: Mapping[str, object] = field(default_factory=dict)
    features: tuple[str, ...] = ()

    def payload(self, *, started: int, clock: ClockState) -> dict[str, object]:
        """Return the object for `info`; `started` is epoch milliseconds."""
        return {
            "v": VERSION,
            "version": self.version,
            "host": self.host,
            "boot": self.boot,
            "previous_boot": self.previous_boot,
            "started": started,
            "config_hash": self.config_hash,
            "changes": self.changes,
            "mqtt": dict(self.mqtt),
            "features": list(self.features),
            "clock": clock,
        }


@dataclass(frozen=True, slots=True)
class LineInfo:
    """The line as configured; `gap_required` in s is the silence kept before every request."""

    name: str
    port: str
    baudrate: int
    parity: str
    databits: int
    stopbits: int
    framing: str
    gap_required: float

    def payload(self, *, is_open: bool, activity: str, requests: str) -> dict[str, object]:
        """Return the object for `line/state`."""
        return {
            "v": VERSION,
            "port": self.port,
            "baudrate": self.baudrate,
            "parity": self.parity,
            "databits": self.databits,
            "stopbits": self.stopbits,
            "framing": self.framing,
            "open": is_open,
            "activity": activity,
            "requests": requests,
        }


@dataclass(frozen=True, slots=True)
class WindValues:
    """The names of a device's first wind speed, in `unit`, and first wind direction; None where it has none."""

    speed: str | None
    direction: str | None
    unit: str | None


@dataclass(frozen=True, slots=True)
class WindInfo:
    """Wind statistics as configured: of which values, published every `every` s, with records of `records` s.

    `records` is 0 where there are none. `hold` is how long in s a reading may wait for others to go with it.
    """

    values: WindValues
    every: float
    records: float
    hold: float = 0.0


@dataclass(frozen=True, slots=True)
class DeviceInfo:
    """A device as configured; durations in s; `response_timeout` is None where it is learned.

    `request_gap` is the rest that it is given between two exchanges, where no longer one was learned.
    """

    name: str
    slave: int
    label: str | None
    profile: str
    interval: float
    enabled: bool
    response_timeout: float | None
    value_names: tuple[str, ...]
    units: Mapping[str, str]
    offline_after: int
    request_gap: float = 0.0
    calibration: Mapping[str, Mapping[str, float]] = field(default_factory=lambda: NOTHING)
    """`scale` and `offset` of its calibration certificate, by value name."""
    state_every: float = 1.0
    """Seconds from one state of the same quality and error to the next, at least."""
    wind: WindInfo | None = None
    """Its wind statistics; None where it measures no wind."""

    def entry(self) -> dict[str, object]:
        """Return the device's place in the array `devices`."""
        return {
            "name": self.name,
            "id": self.slave,
            "label": self.label,
            "profile": self.profile,
            "enabled": self.enabled,
            "interval": self.interval,
        }

    def payload(self, learned_gap: float = 0.0) -> dict[str, object]:
        """Return the object for `device/<name>/config`; a learned time-out is `auto`, as in the YAML."""
        return {
            "v": VERSION,
            "slave": self.slave,
            "label": self.label,
            "profile": self.profile,
            "interval": self.interval,
            "enabled": self.enabled,
            "response_timeout": "auto" if self.response_timeout is None else self.response_timeout,
            "request_gap": max(self.request_gap, learned_gap),
            "calibration": {name: dict(entry) for name, entry in self.calibration.items()},
        }
