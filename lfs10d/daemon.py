"""Builds everything, starts it in order and stops it in order. Knows everybody; decides nothing of the field.

The asyncio loop hosts MQTT, the station and the timers; the line thread owns the wire. What the line thread hears
comes here by one `call_soon_threadsafe` per exchange and goes through the station to the uplink.
"""

from __future__ import annotations

import asyncio
import logging
import signal
import socket
import sys
import threading
import time
from collections import deque
from typing import TYPE_CHECKING

from lfs10d import __version__, assembly, clock
from lfs10d.facts import DaemonFacts, Instant
from lfs10d.linethread import LineThread
from lfs10d.modbus.bus import Bus
from lfs10d.modbus.port import SerialPort
from lfs10d.modbus.realtime import sharpen_timers, take_precedence
from lfs10d.mqtt.settings import BrokerSettings
from lfs10d.mqtt.uplink import Uplink
from lfs10d.poller import Poller
from lfs10d.reading import Event, Exchanged, Fault, FaultCode, PortChanged
from lfs10d.schedule import Schedule
from lfs10d.station import Station

if TYPE_CHECKING:
    from lfs10d.boot import Boot
    from lfs10d.configfile import Loaded
    from lfs10d.mqtt.inbound import InboundRequest
    from lfs10d.secret import Secret

log = logging.getLogger(__name__)

SWITCH_INTERVAL = 1e-4
"""Seconds the interpreter lets one thread run on: at the default of 5 ms the line thread wakes up 5 ms late."""
LINE_STOPS_WITHIN = 0.8
"""How long the line thread is waited for at the end, in s."""
FEATURES = ("mqtt5", "history")


class Daemon:
    """One line, from the port to the broker. Built and run inside an asyncio loop."""

    def __init__(self, loaded: Loaded, boot: Boot) -> None:
        config = loaded.config
        self._loaded = loaded
        self._loop = asyncio.get_running_loop()
        self._over = asyncio.Event()
        self._failure: BaseException | None = None
        self._inbox: deque[list[Event]] = deque()
        self._clock: clock.ClockState = "unknown"
        self._boot = boot
        self._facts = DaemonFacts(
            version=__version__,
            host=socket.gethostname(),
            boot=boot.id,
            previous_boot=boot.previous,
            config_hash=assembly.config_hash(config),
            mqtt={"version": config.mqtt.version},
            features=FEATURES,
        )
        self._station = Station(
            self._facts,
            assembly.line_facts(config.line),
            assembly.device_facts(config, loaded.profiles),
            self._now(),
            backlog=lambda: self._uplink.backlog,
        )
        self._uplink = Uplink(
            BrokerSettings.of(config.mqtt, client_id=config.mqtt.client_id or "", password=self._password),
            base=f"{config.mqtt.base_topic}/{config.line.name}",
            line=config.line.name,
            burst=lambda: self._station.burst(self._now()),
            stands_behind=self._station.topics,
            requested=self._requested,
            epoch_ms=lambda: self._now().ts(),
            changed=self._uplink_changed,
        )
        self._port = SerialPort(assembly.port_settings(config.line))
        bus = Bus(self._port, assembly.line_rules(config.line), time.monotonic)
        schedule = Schedule(assembly.line_timing(config.line), time.monotonic())
        rules = assembly.poll_rules(config.poll)
        schedule.replace(assembly.device_specs(config, loaded.profiles), rules, time.monotonic())
        self._poller = Poller(bus, schedule, self._from_line, time.monotonic)
        self._line = LineThread(self._poller, prepare=self._prepare_line, failed=self._line_failed)

    def _password(self) -> Secret | None:
        return self._loaded.password()

    def _now(self) -> Instant:
        return Instant(time.monotonic(), time.time(), self._clock)

    async def run(self) -> int:
        """Measure and publish until SIGTERM or SIGINT; return the exit code."""
        for number in (signal.SIGTERM, signal.SIGINT):
            self._loop.add_signal_handler(number, self._over.set)
        switch_interval = sys.getswitchinterval()
        sys.setswitchinterval(SWITCH_INTERVAL)
        ticker = asyncio.create_task(self._tick(), name="tick")
        try:
            self._line.start()
            await self._uplink.start()
            await self._over.wait()
        finally:
            ticker.cancel()
            self._line.stop()
            await asyncio.to_thread(self._line.join, LINE_STOPS_WITHIN)
            await self._uplink.stop()
            sys.setswitchinterval(switch_interval)
        return 0 if self._failure is None else 1

    # -- the line thread

    def _prepare_line(self) -> None:
        """Make the line's thread wake up on time; runs in it, before its first turn."""
        if not sharpen_timers():
            log.debug("the timer slack of the line's thread cannot be set: gaps are 50 us longer than need be")
        if self._loaded.config.line.realtime and (refusal := take_precedence()) is not None:
            log.warning("%s", refusal)

    def _from_line(self, events: list[Event]) -> None:
        """Take what was heard, in the line's thread, over to the loop."""
        self._inbox.append(events)
        self._loop.call_soon_threadsafe(self._heard)

    def _heard(self) -> None:
        while self._inbox:
            now = self._now()
            for event in self._inbox.popleft():
                if isinstance(event, PortChanged):
                    self._tell_port(event)
                elif isinstance(event, Exchanged) and log.isEnabledFor(logging.DEBUG):
                    log.debug(
                        "slave %d: sent %s heard %s%s",
                        event.slave,
                        event.sent.hex(" "),
                        event.heard.hex(" ") or "nothing",
                        f": {event.fault}" if event.fault else "",
                    )
                self._uplink.publish(self._station.heard(event, now))

    def _tell_port(self, event: PortChanged) -> None:
        if event.fault is None:
            log.info("port %s is open", self._port.settings.path)
            for notice in self._port.notices:
                log.warning("%s", notice)
        else:
            log.warning("%s; tried again until it is back", event.fault.message)

    def _line_failed(self, error: BaseException) -> None:
        """End the daemon: the line's thread, in which this runs, ended by a mistake."""
        self._failure = error
        log.error("the line's thread ended: %s", error, exc_info=error)
        self._loop.call_soon_threadsafe(self._over.set)

    # -- time

    async def _tick(self) -> None:
        look_at = 0.0
        while True:
            now = time.monotonic()
            if now >= look_at:
                self._clock = await asyncio.to_thread(clock.look)
                look_at = now + clock.LOOK_AGAIN[self._clock]
            self._uplink.publish(self._station.tick(self._now()))
            await asyncio.sleep(min(max(self._station.due() - time.monotonic(), 0.0), 1.0))

    # -- the broker

    def _uplink_changed(self) -> None:
        version = self._uplink.version
        now = self._now()
        if version is not None:
            facts = self._facts = DaemonFacts(
                version=self._facts.version,
                host=self._facts.host,
                boot=self._facts.boot,
                previous_boot=self._facts.previous_boot,
                config_hash=self._facts.config_hash,
                changes=self._facts.changes,
                mqtt={"version": str(version)},
                features=self._facts.features,
            )
            self._uplink.publish(self._station.introduce(facts, now))
        if self._uplink.duplicate:
            message = "another client has taken our client id; give every daemon its own mqtt.client_id"
            self._uplink.publish(self._station.line_failed(Fault(FaultCode.DUPLICATE_CLIENT, message), now))

    def _requested(self, request: InboundRequest) -> None:
        log.debug("request %s", "/".join(request.levels).encode("unicode_escape").decode())


async def run(loaded: Loaded, boot: Boot) -> int:
    """Run the daemon of one configuration until it is told to end; return the exit code."""
    return await Daemon(loaded, boot).run()


def threads() -> list[threading.Thread]:
    """Return the threads of this process, for a stack dump."""
    return threading.enumerate()
