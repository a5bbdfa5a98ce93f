"""The wind statistics of all devices of a line: fed with readings, published by time. Pure: time is an argument."""

from __future__ import annotations

from collections.abc import Iterable
from math import inf

from lfs10d.reading import Reading
from lfs10d.system.clock import Instant
from lfs10d.telemetry.info import DeviceInfo
from lfs10d.telemetry.publication import WIND, Publication, device_topic, retained
from lfs10d.telemetry.wind.clock import WindClock, WindMoment
from lfs10d.telemetry.wind.device import DeviceWind


class WindStation:
    """One line named `line` in one `boot`; devices that measure no wind are passed over."""

    def __init__(self, line: str, boot: str, devices: Iterable[DeviceInfo], now: Instant) -> None:
        self._line_boot = (line, boot)
        self._clock = WindClock(now)
        self._last_seqs: dict[str, int] = {}
        """Number of the last record of each device that was removed."""
        self._devices: dict[str, DeviceWind] = {}
        self._dues: dict[str, float] = {}
        """When each device wants `tick`, in ms."""
        self._shift = 0
        self._due_at = inf
        self.due = inf
        """Monotonic time at which `tick` is wanted next."""
        self.configure(devices, now)

    def on_reading(self, reading: Reading, now: Instant) -> None:
        """Take one reading: its wind, if it is good and not older than the reading."""
        device = self._devices.get(reading.device)
        if device is None or reading.values is None or not device.info.enabled:
            return
        at = self._clock.at(reading.at, now)
        look_at = device.on_values(reading.values, reading.ages, at)
        if look_at < self._dues[reading.device]:
            self._dues[reading.device] = look_at
            if look_at < self._due_at:
                self._set_due(look_at, at, reading.at)

    def tick(self, now: Instant) -> list[Publication]:
        """Return what time alone makes due."""
        moment = self._clock.moment(now)
        if moment.shift != self._shift:  # the clock was set: records end at another time
            self._look(moment, now)
        at, dues, published = moment.at, self._dues, []
        for name in [name for name, due in dues.items() if due <= at]:
            device = self._devices[name]
            published += device.tick(moment)
            dues[name] = device.due(moment)
        self._set_due(min(dues.values(), default=inf), at, now.mono)
        return published

    def burst(self, device: str, now: Instant) -> list[Publication]:
        """Return the retained topic of a device; nothing where it measures no wind."""
        wind, moment = self._devices.get(device), self._clock.moment(now)
        if wind is None:
            return []
        published = wind.publication(moment)
        self._dues[device] = wind.due(moment)
        self._set_due(min(self._dues.values()), moment.at, now.mono)
        return [published]

    def topics(self) -> list[str]:
        """Return the retained topics."""
        return [device_topic(name, WIND) for name in self._devices]

    def configure(self, devices: Iterable[DeviceInfo], now: Instant) -> list[Publication]:
        """Take the devices as they are now; return what changed: what is no longer measured is cleared.

        A device is the same while its name and its profile are.
        """
        moment, published, staying = self._clock.moment(now), [], set()
        before, self._devices = self._devices, {}
        for info in devices:
            staying.add(info.name)
            if info.wind is None:
                continue
            device = before.pop(info.name, None)
            if device is not None and device.values == info.wind.values and device.info.profile == info.profile:
                published += device.reconfigure(info, info.wind, moment)
            else:
                seq = self._last_seqs.pop(info.name, 0) if device is None else device.seq
                device = DeviceWind(info, info.wind, self._line_boot, seq, moment.at)
                published.append(device.publication(moment))
            self._devices[info.name] = device
        for name, device in before.items():
            self._last_seqs[name] = device.seq
            if name in staying:
                published.append(retained(device_topic(name, WIND), None))
        self._look(moment, now)
        return published

    def snapshot(self, device: str) -> dict[str, object]:
        """Return what a live view shows of a device: `wind`, or nothing where it measures none."""
        wind = self._devices.get(device)
        return {} if wind is None else {"wind": wind.snapshot()}

    def _look(self, moment: WindMoment, now: Instant) -> None:
        self._dues = {name: device.due(moment) for name, device in self._devices.items()}
        self._shift = moment.shift
        self._set_due(min(self._dues.values(), default=inf), moment.at, now.mono)

    def _set_due(self, due_at: float, at: int, mono: float) -> None:
        """Take when `tick` is wanted, in ms; at the monotonic time `mono` it is `at`, rounded."""
        self._due_at = due_at
        self.due = mono + (due_at - at + 1) / 1000
