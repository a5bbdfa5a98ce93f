"""Lines of other devices, and all that a daemon published of them, recorded once."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

from lfs10d.profiles.library import load_profile
from lfs10d.profiles.profile import Profile
from lfs10d.simulator.blueprint import blueprint_of
from lfs10d.simulator.judge import HeardRequest
from lfs10d.simulator.line import SimulatedLine
from lfs10d.simulator.pty import PtyLine
from lfs10d.simulator.sensor import Sensor
from lfs10d.simulator.wind import Unique
from lfs10d.simulator.wire import Check, Format, Framing, unseal
from tests.support import forked
from tests.support.brokers import Mosquitto
from tests.support.faulty_sensors import add_fault
from tests.support.sites import Site, View, good, tell

ROOT = Path(__file__).parents[2]
BAUDRATE = 19200
WELL_SAMPLES = 6
"""So many good samples of each device are waited for while all is well."""
TANK = """\
name: tank
title: Tank level sensor
framings: [rtu, ascii]
ascii_max_data: 10
values:
  - {name: level, register: 0x0100, type: float32, word_order: low_first, byte_order: little, unit: m, range: [0, 100]}
  - {name: volume, register: 0x0102, type: uint32, word_order: low_first, unit: l}
  - {name: trend, register: 0x0104, type: int32, word_order: high_first, scale: 0.001, offset: -50, unit: l/s}
  - {name: temperature, register: 0x0200, type: int16, scale: 0.1, offset: -40, unit: "°C", function: 4}
settings:
  - {name: filter, register: 0x0300, range: [0, 99], writable: true}
barrier: {register: 0x0300, count: 1}
"""
"""A user's own profile with all that the built-in ones leave out: every type, order and function, scale and offset."""


@dataclass(frozen=True)
class Unit:
    """One device on a line: its slave id, its profile as configured, the check of its RTU frames."""

    slave: int
    name: str
    profile: str
    check: Check = "crc"
    most: float = 100
    """Its values stay below this, so that all of them are believed."""


class Within:
    """Values that are unique for long, from 0 to below `most`."""

    def __init__(self, most: float) -> None:
        self._unique, self._most = Unique(), most

    def __call__(self, now: int) -> float:
        """Return the next one."""
        return round(self._unique(now) * self._most / 100, 4)


RTU = (
    Unit(2, "mast-top", "lfs10"),
    Unit(3, "mast-mid", "lfs10"),
    Unit(255, "mast-low", "lfs10"),
    Unit(10, "laser-a", "ld-e"),
    Unit(11, "laser-b", "ld-e"),
    Unit(20, "pump", "fuling-dzb"),
    Unit(21, "fan", "fuling-dzb"),
    Unit(30, "hoist", "eh600"),
    Unit(31, "belt", "eh600", "sum"),
    Unit(32, "mixer", "eh600", "sum"),
    Unit(40, "vane", str(ROOT / "config" / "profiles" / "wind-vane.yaml"), most=15),
    Unit(41, "tank", "profiles/tank.yaml"),
)


ASCII = (
    Unit(10, "laser-a", "ld-e"),
    Unit(11, "laser-b", "ld-e"),
    Unit(20, "pump", "fuling-dzb"),
    Unit(21, "fan", "fuling-dzb"),
    Unit(41, "tank", "profiles/tank.yaml"),
)


@dataclass
class Recording:
    """One line with what was heard of it. All is over but the simulated line, whose port is free."""

    site: Site
    units: Sequence[Unit]
    framing: Framing
    format: Format
    served: PtyLine
    view: View
    well: dict[str, list[dict[str, Any]]] = field(default_factory=dict)
    """The samples of each device while all was well."""
    watched: list[dict[str, Any]] = field(default_factory=list)
    """What `lfs10d watch --json` printed."""
    responses: dict[str, dict[str, Any]] = field(default_factory=dict)
    """The responses by the id of their request."""
    at_once: dict[str, dict[str, Any]] = field(default_factory=dict)
    """Those to requests that came at the same time."""
    daemon_log: str = ""

    def profile(self, unit: Unit) -> Profile:
        return load_profile(unit.profile, relative_to=self.site.folder)

    def unit(self, name: str) -> Unit:
        return next(unit for unit in self.units if unit.name == name)

    @cached_property
    def log(self) -> list[tuple[Unit, bytes, HeardRequest]]:
        """Every request as the line heard it: to whom, without its check."""
        by_slave = {unit.slave: unit for unit in self.units}
        entries = []
        for request in self.served.line.log:
            checks: tuple[Check, ...] = ("crc",) if self.framing == "ascii" else ("crc", "sum")
            bodies = [(check, unseal(request.frame, self.framing, check)) for check in checks]
            for check, body in bodies:
                unit = by_slave.get(body[0]) if body else None
                if body and unit and unit.check == check:
                    entries.append((unit, body, request))
        return entries

    def meant(self, unit: Unit) -> list[list[dict[str, float]]]:
        """Return for each read of a poll what the device meant to say in its answers, by the line's log, in order."""
        profile = self.profile(unit)
        meant = []
        for block in profile.reads():
            shape = bytes((block.function,)) + _words(block.address, block.count)
            names = [value.name for value in profile.values if value in block.values]
            told = (
                answer for to, body, each in self.log if to is unit and body[1:] == shape for answer in each.answers
            )
            meant.append([dict(zip(names, answer.values, strict=True)) for answer in told if answer.values])
        return meant

    def lfs10d(self, *arguments: str) -> subprocess.CompletedProcess[str]:
        """Call a verb at the free port."""
        return forked.run(arguments, cwd=self.site.folder)

    @property
    def line_options(self) -> list[str]:
        """How the verbs are told of the line's characters."""
        options = ["--framing", self.framing, "--parity", self.format.parity]
        return [*options, "--databits", str(self.format.databits)]


def _words(*numbers: int) -> bytes:
    return b"".join(number.to_bytes(2, "big") for number in numbers)


def simulated(unit: Unit, profile: Profile, shape: Format, framing: Framing) -> Sensor:
    """Return a device that plays its profile, with the check it is set to."""
    blueprint = replace(blueprint_of(profile), check=unit.check)
    source = Within(unit.most)
    return Sensor(unit.slave, blueprint=blueprint, format=shape, framing=framing, turnaround=0.003, source=source)


def record(folder: Path, broker: Mosquitto, units: Sequence[Unit], framing: Framing, shape: Format) -> Recording:
    """Run the daemon on a line of these devices: first all is well, then some are ill, then all is well again."""
    (folder / "profiles").mkdir()
    (folder / "profiles" / "tank.yaml").write_text(TANK)
    site = Site(folder, broker.port)
    sensors = [simulated(unit, load_profile(unit.profile, relative_to=folder), shape, framing) for unit in units]
    served = PtyLine(SimulatedLine(sensors, format=shape, framing=framing, keep_log=True), link=site.tty)
    site.lines.append(served)
    served.start()
    site.write(
        line={"framing": framing, "parity": shape.parity, "databits": shape.databits, "baudrate": shape.baudrate},
        poll={"interval": "300ms", "probe_interval_max": "1s"},
        slaves=[
            {"id": unit.slave, "name": unit.name, "profile": unit.profile}
            | ({"checksum": unit.check} if unit.check != "crc" else {})
            for unit in units
        ],
        commands=["polling", "registers"],
    )
    made = Recording(site, units, framing, shape, served, View(broker.subscribe()))
    run = site.run()
    try:
        for unit in units:
            made.view.wait_samples(unit.name, WELL_SAMPLES, good)
        made.well = {unit.name: made.view.samples(unit.name) for unit in units}
        _watch(made)
        _ask(made)
        _fall_ill(made)
        run.ends(signal.SIGTERM)
        made.daemon_log = run.log
    finally:
        if run.process.poll() is None:
            run.process.kill()
    return made


def _watch(made: Recording) -> None:
    """Have `watch` print a value of everybody."""
    command = [sys.executable, "-m", "lfs10d", "watch", "-c", str(made.site.file), "--json"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True) as watch:
        assert watch.stdout is not None
        missing = {unit.name for unit in made.units}
        until = time.monotonic() + 20
        for line in watch.stdout:
            made.watched.append(json.loads(line))
            if made.watched[-1].get("values"):  # none in a poll that found the simulator asleep
                missing.discard(made.watched[-1]["device"])
            if not missing or time.monotonic() > until:
                break
        watch.send_signal(signal.SIGINT)


def _ask(made: Recording) -> None:
    """Ask for registers, and try to write what may be written and what may not."""
    for number, (verb, parameters) in enumerate(REQUESTS[made.framing]):
        key = f"r{number}"
        topic = f"{made.view.base}/response/register/{verb}"
        before = len(made.view.listener.on(topic))
        made.view.listener.publish(f"{made.view.base}/request/register/{verb}", json.dumps({"id": key, **parameters}))
        answers = made.view.listener.wait_for(topic, before + 1)
        made.responses[key] = json.loads(answers[-1].payload)

    topic = f"{made.view.base}/response/register/write"
    before = len(made.view.listener.on(topic))
    for value in AT_ONCE:
        payload = json.dumps({"id": f"at-once-{value}", "device": "tank", "address": 0x0300, "value": value})
        made.view.listener.publish(f"{made.view.base}/request/register/write", payload, qos=0)
    for answer in made.view.listener.wait_for(topic, before + len(AT_ONCE))[before:]:
        response = json.loads(answer.payload)
        made.at_once[response["id"]] = response


AT_ONCE = (11, 12, 13)
"""Values written to one register by three requests at the same time."""
REQUESTS: dict[Framing, list[tuple[str, dict[str, Any]]]] = {
    "rtu": [
        ("read", {"device": "pump", "address": 0x3000, "count": 5}),
        ("read", {"device": "pump", "address": 0x3000, "count": 6}),
        ("read", {"device": "belt", "address": 0xF002, "count": 2}),
        ("read", {"slave": 2, "address": 0x0005}),
        ("read", {"device": "hoist", "address": 0x0001}),
        ("read", {"slave": 77, "address": 0}),
        ("write", {"device": "laser-a", "address": 0x1000, "value": 1}),
        ("write", {"device": "tank", "address": 0x0300, "value": 42}),
        ("write", {"device": "tank", "address": 0x0300, "value": 100}),
        ("write", {"device": "hoist", "address": 0x2000, "value": 1}),
        ("write", {"device": "pump", "address": 0x3000, "value": 5000}),
        ("write", {"device": "mast-top", "address": 0x0005, "value": 9}),
        ("write", {"slave": 0, "address": 0x0300, "value": 1}),
    ],
    "ascii": [
        ("read", {"device": "pump", "address": 0x3001, "count": 4}),
        ("write", {"device": "laser-b", "address": 0x1000, "value": 1}),
        ("write", {"device": "tank", "address": 0x0300, "value": 7}),
        ("write", {"device": "fan", "address": 0x1000, "value": 1}),
    ],
}


ILL = {"laser-a": "exception", "pump": "silent", "belt": "busy"}
"""What ails whom for a while; who is busy refuses with exception 06."""


def _fall_ill(made: Recording) -> None:
    view, line = made.view, made.served
    ill = {made.unit(name).slave: kind for name, kind in ILL.items() if any(unit.name == name for unit in made.units)}

    def ail(sensors: SimulatedLine) -> None:
        for slave, kind in ill.items():
            sensor = sensors.sensor(slave)
            add_fault(sensor, "exception", code=6) if kind == "busy" else add_fault(sensor, kind)

    def heal(sensors: SimulatedLine) -> None:
        for sensor in sensors.sensors:
            sensor.faults.clear()

    tell(line, ail)
    view.wait("device/laser-a/error", lambda error: error["active"])
    view.wait("device/pump/availability", "offline".__eq__)
    if "belt" in (unit.name for unit in made.units):
        view.wait_samples("belt", 4, lambda one: one["error"] == "exception")
    tell(line, heal)
    for name in ("laser-a", "pump"):
        view.wait(f"device/{name}/error", lambda error: not error["active"] and error["last_code"])
    for name in ILL:
        if any(unit.name == name for unit in made.units):
            view.wait(f"device/{name}/state", good)


LINES: dict[str, tuple[Sequence[Unit], Framing, Format]] = {
    "rtu": (RTU, "rtu", Format(BAUDRATE)),
    "ascii-7E1": (ASCII, "ascii", Format(BAUDRATE, 7, "even")),
    "ascii-8N1": (ASCII, "ascii", Format(BAUDRATE)),
}
