"""Examines line and sensors: as the running daemon publishes them, or by reading each where none runs."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Final

from lfs10d.cli.direct_line import DirectLine
from lfs10d.cli.doctor.finding import Area, Finding
from lfs10d.cli.local_time import clock_text
from lfs10d.cli.render.live_state import LiveState, ShownDevice
from lfs10d.config.loader import LoadedConfig
from lfs10d.config.models import LineConfig
from lfs10d.errors import PortError
from lfs10d.line.device import DeviceSpec, PollRules
from lfs10d.line.settings import device_specs, line_rules, port_settings
from lfs10d.reading import Reading

LINE, SENSOR, SENSORS, PORT = Area("line"), Area("sensor"), Area("sensors"), Area("port")

ATTEMPTS: Final = 3
"""Tries to read a sensor that does not answer."""
PATIENCE: Final = 8.0
"""Most s for each sensor where the line is read directly; a silent one takes 2."""
ADVICE: Final[Mapping[str, str]] = {
    "timeout": "is it powered and wired (A, B)? does it have this id and rate? lfs10d scan",
    "crc": "noise or two sensors of one id: termination, shield, ground; unplug one and look again",
    "malformed": "noise or two sensors of one id: termination, shield, ground; unplug one and look again",
    "wrong_slave": "two sensors have this id, or the adapter mixes frames",
    "collision": "a second master, or another program, sends on this line",
    "duplicate_id": "two sensors have this id: unplug one, then lfs10d request device/readdress",
    "wrong_rate": "sensors answer at another rate: set line.baudrate to it",
    "config_conflict": "the file and the last verified place differ: lfs10d config",
    "exception": "is the profile right? lfs10d profiles show",
    "out_of_range": "is the profile right? is the register an integer? lfs10d read PORT ID",
    "port_lost": "see port, above",
    "port_busy": "see port, above",
    "storage_full": "see disk, above",
    "duplicate_client": "another client uses this client id: set mqtt.client_id",
}
"""What to do, by error code."""
OTHERWISE: Final = "docs/when-it-goes-wrong.md has every code"


def by_daemon(live: LiveState, wall: float) -> Iterator[Finding]:
    """Yield the findings that the daemon publishes of line and devices; `wall` is now, in s since the epoch."""
    if live.line_error is not None:
        code = live.line_error_code or ""
        yield LINE.fail(f"{code}: {live.line_error}{_since(live.line_error_since)}", ADVICE.get(code, OTHERWISE))
    activity = live.line.get("activity")
    if activity not in {None, "polling"}:
        yield LINE.warn(f"it is {activity} now: sensors are not polled as usual", "lfs10d request line/cancel ends it")
    silent = [device for device in live.devices.values() if device.enabled and not device.online]
    for device in live.devices.values():
        if device.enabled and (device.error is not None or device in silent):
            yield _bad(device)
        elif device.enabled and live.late(device, wall):
            yield SENSOR.warn(f"{device.name}: its last good value is old", "is the line overloaded? lfs10d check")
    well = [device for device in live.devices.values() if device.enabled and device.online and device.error is None]
    if well:
        yield SENSORS.ok(f"{len(well)} of {sum(each.enabled for each in live.devices.values())} answer well")
    if not live.devices:
        yield SENSORS.warn("none is configured", "lfs10d request line/scan, or line/adopt --repeat for new ones")


def _bad(device: ShownDevice) -> Finding:
    code = device.error or "timeout"
    id_ = "" if device.slave is None else f" (slave id {device.slave})"
    if code == "starting":
        return SENSOR.warn(f"{device.name}{id_}: not polled yet", "look again in a minute")
    level = SENSOR.fail if not device.online else SENSOR.warn
    state = "offline" if not device.online else "online, but bad"
    return level(f"{device.name}{id_}: {state}: {code}{_since(device.since)}", ADVICE.get(code, OTHERWISE))


def _since(ts: float | None) -> str:
    return "" if ts is None else f", since {clock_text(ts)}"


def by_asking(loaded: LoadedConfig) -> list[Finding]:
    """Read each enabled slave of a line that is free; return which answer."""
    config = loaded.config
    specs = [
        replace(spec, interval=max(0.5, spec.profile.min_interval), response_timeout=None)
        for spec in device_specs(config, loaded.profiles)
        if spec.enabled
    ]
    if not specs:
        return [SENSORS.warn("none is configured", f"lfs10d scan {config.line.port}")]
    try:
        readings = _polled(config.line, config.line.baudrate, specs)
        found = list(answers(specs, readings, config.line.port))
        if not any(reading.fault is None for reading in readings.values()):
            found += _at_another_rate(config.line, specs)
    except PortError as error:
        return [PORT.fail(str(error), "see port, above")]
    return found


def _at_another_rate(line: LineConfig, specs: Sequence[DeviceSpec]) -> Iterator[Finding]:
    """Read at the other rates of the profiles; yield the rates at which devices answer."""
    rates = {rate for spec in specs if spec.profile.baudrate is not None for rate in spec.profile.baudrate.codes}
    for rate in sorted(rates - {line.baudrate}):
        readings = _polled(line, rate, specs)
        names = [name for name, reading in readings.items() if reading.fault is None]
        if names:
            yield SENSORS.fail(
                f"{', '.join(names)} answer at {rate} baud, not at {line.baudrate}",
                f"set line.baudrate to {rate}; then lfs10d request line/baudrate can move them",
            )
            return


def _polled(line_config: LineConfig, baudrate: int, specs: Sequence[DeviceSpec]) -> dict[str, Reading]:
    """Read each until it answers, at most `ATTEMPTS` times: a reply may be lost, or slower than the first time-out."""
    readings: dict[str, Reading] = {}
    attempts = {spec.name: ATTEMPTS for spec in specs}
    rules = PollRules(retries=0, offline_after=ATTEMPTS, probe_interval_max=1.0)
    settings = replace(port_settings(line_config), baudrate=baudrate)
    with DirectLine(settings, line_rules(line_config)) as line:
        line.poll(specs, rules)
        until = time.monotonic() + PATIENCE * len(specs)
        while any(attempts.values()) and time.monotonic() < until:
            for event in line.events(0.1):
                if isinstance(event, Reading) and attempts[event.device]:
                    readings[event.device] = event
                    attempts[event.device] = 0 if event.fault is None else attempts[event.device] - 1
    return readings


def answers(specs: Sequence[DeviceSpec], readings: Mapping[str, Reading], port: str) -> Iterator[Finding]:
    """Yield which sensors answer, and the likely causes if none does."""
    good = [spec for spec in specs if (found := readings.get(spec.name)) is not None and found.fault is None]
    for spec in specs:
        reading = readings.get(spec.name)
        if spec in good:
            continue
        code = "timeout" if reading is None or reading.fault is None else str(reading.fault.code)
        message = "no answer" if reading is None or reading.fault is None else reading.fault.message
        yield SENSOR.fail(f"{spec.name} (slave id {spec.slave}): {code}: {message}", ADVICE.get(code, OTHERWISE))
    if good:
        yield SENSORS.ok(f"{len(good)} of {len(specs)} reply well (read now; no daemon runs)")
    else:
        yield SENSORS.fail(
            "none answers",
            f"at another rate? lfs10d scan {port}; else A and B swapped, no power, or the wrong adapter",
        )
