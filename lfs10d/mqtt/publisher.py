"""The station's shell: events of the line and ticks of the clock come in, publications go out to the broker."""

from __future__ import annotations

import asyncio
from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any

from lfs10d.command import Command
from lfs10d.mqtt.uplink import Uplink
from lfs10d.reading import Event, FaultCode, LineFaultCode, Reading
from lfs10d.system.clock import Clock, Instant
from lfs10d.telemetry.first_burst import FirstBurst
from lfs10d.telemetry.info import DaemonInfo, DeviceInfo, LineInfo
from lfs10d.telemetry.line_state import PAUSED, POLLING, Requests
from lfs10d.telemetry.publication import EventType, Publication, event
from lfs10d.telemetry.station import NOTHING_WAITS, Station

TICK_SLACK = 0.03
"""Seconds that a tick waits for a sample to be sent with: at 9600 baud there is one every 26 ms."""
DUPLICATE_CLIENT = "another client has taken our client id; give every daemon an mqtt.client_id of its own"


class Publisher:
    """Used in the thread of the asyncio loop. `info` is what is published about the daemon itself."""

    def __init__(self, station: Station, info: DaemonInfo, uplink: Uplink, clock: Clock) -> None:
        self._station = station
        self._info = info
        self._uplink = uplink
        self._clock = clock
        self._first_burst = FirstBurst(station.burst(clock.now()))
        self._loop = asyncio.get_running_loop()
        self._timer: asyncio.TimerHandle | None = None
        self._paused = False

    def start(self) -> None:
        """Publish what is due, now and whenever something is."""
        self._tick()

    # -- what is published

    def on_event(self, event: Event, now: Instant) -> list[Publication]:
        """Take an event of the line; return its publications, for `publish`."""
        return self._station.on_event(event, now)

    def on_readings(self, readings: Iterable[Reading]) -> None:
        """Publish readings that did not come from the line."""
        now = self._clock.now()
        for reading in readings:
            self.publish(self._station.on_event(reading, now))

    def due(self, now: Instant) -> list[Publication]:
        """Return what is due by `now`: sent with a sample it shares the segment to the broker."""
        if self._station.due() > now.mono:
            return []
        backlog = self._uplink.backlog if self._station.stats_due <= now.mono else NOTHING_WAITS
        return self._station.tick(now, backlog)

    def publish(self, publications: Iterable[Publication]) -> None:
        """Publish these, except those that must wait until the broker has the first burst."""
        self._uplink.publish(self._first_burst.passing(publications))
        if self._timer is not None and self._station.due() + TICK_SLACK < self._timer.when():
            self._set_timer()

    def announce(self, kind: EventType, facts: Mapping[str, object]) -> None:
        """Publish an event of a kind."""
        self.publish([event(kind, self._clock.epoch_ms(), **facts)])

    def applied(self, request: str, command: Command, **facts: object) -> None:
        """Publish on `event` what a request changed."""
        self.announce("change_applied", {"request": request, "id": command.key, **facts})

    def act(self, activity: str | None) -> None:
        """Publish the line's activity; None: polling. Ignored while the port is freed."""
        if not self._paused:
            self.publish(self._station.on_activity(activity or POLLING, self._clock.now()))

    def set_paused(self, *, paused: bool) -> None:
        """Publish that the port is freed for another program, or that polling goes on."""
        self._paused = paused
        self.publish(self._station.on_activity(PAUSED if paused else POLLING, self._clock.now()))

    def set_line_error(self, code: LineFaultCode, message: str | None) -> None:
        """Raise an error of the line, or clear it (None)."""
        self.publish(self._station.set_line_error(code, message, self._clock.now()))

    def configure(self, line: LineInfo, devices: Iterable[DeviceInfo]) -> None:
        """Publish the changes of the line and its devices."""
        self.publish(self._station.configure(line, tuple(devices), self._clock.now()))

    def introduce(self, **changes: Any) -> None:  # noqa: ANN401 - the fields of `DaemonInfo`
        """Publish the changes of the daemon itself."""
        self._info = replace(self._info, **changes)
        self.publish(self._station.introduce(self._info, self._clock.now()))

    def republish(self) -> int:
        """Publish every retained topic again; return their number."""
        self._uplink.republish()
        return len(self._station.topics()) + 1 + self._uplink.discovery.republish()

    # -- what is asked

    def health(self) -> dict[str, object]:
        """Return the state of the daemon, the line and the devices, as in `status.json`."""
        backlog = self._uplink.backlog
        broker = {"connected": self._uplink.connected, "depth": backlog.depth, "dropped": backlog.dropped}
        return {**self._station.snapshot(self._clock.now()), "broker": broker}

    def summary(self) -> str:
        """Return one line for a person: `7 of 8 slaves online, line 78 % busy, broker connected`."""
        return f"{self._station.summary(self._clock.now())}, {self._uplink.summary}"

    # -- events of the uplink

    def burst(self) -> list[Publication]:
        """Return every retained topic as it is now, with nothing known of the devices in the first burst."""
        return self._first_burst.burst(self._station.burst(self._clock.now(), self._uplink.backlog))

    def topics(self) -> frozenset[str]:
        """Return the retained topics."""
        return self._station.topics()

    def on_announced(self) -> None:
        """Publish what had to wait for the first burst."""
        self._uplink.publish(self._first_burst.settle(self._station.burst(self._clock.now(), self._uplink.backlog)))

    def on_uplink_change(self) -> None:
        """Publish the version of MQTT, whether requests come through, and whether our client id is taken."""
        version = self._uplink.version
        if version is not None:
            self.introduce(mqtt={"version": str(version)})
            requests: Requests = "denied" if self._uplink.requests_denied else "ok"
            self.publish(self._station.on_requests(requests, self._clock.now()))
        self.set_line_error(FaultCode.DUPLICATE_CLIENT, DUPLICATE_CLIENT if self._uplink.duplicate else None)

    # -- time

    def _tick(self) -> None:
        self._uplink.publish(self._first_burst.passing(self.due(self._clock.now())))
        self._set_timer()

    def _set_timer(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
        self._timer = self._loop.call_at(self._station.due() + TICK_SLACK, self._tick)
