"""Builds a simulated line from its plan: ids, rate, framing, device, faults."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import field, replace

from lfs10d.simulator.blueprint import LFS10, Blueprint
from lfs10d.simulator.fault_file import FaultFile, SlaveEntry
from lfs10d.simulator.faults import window
from lfs10d.simulator.line import SimulatedLine
from lfs10d.simulator.line_faults import babble, second_master, stray
from lfs10d.simulator.recorded import Recording
from lfs10d.simulator.sensor import Sensor
from lfs10d.simulator.signals import READ_HOLDING
from lfs10d.simulator.wind import Wind
from lfs10d.simulator.wire import Format, Framing
from lfs10d.system.dataclass import dataclass

LAST_ID = 255


@dataclass(frozen=True, slots=True)
class LinePlan:
    """The plan of a line; times in seconds."""

    slaves: Sequence[int]
    format: Format = field(default_factory=Format)
    framing: Framing = "rtu"
    blueprint: Blueprint = LFS10
    turnaround: float = 0.005
    jitter: float = 0.0
    seed: int = 1
    unique: bool = False
    """Values unique in the run, in place of moving wind."""
    recorded: Recording | None = None
    """Values from a file, where it has them, in place of both."""


def build(
    plan: LinePlan,
    faults: FaultFile | None = None,
    blueprints: Mapping[int, Blueprint] | None = None,
    *,
    keep_log: bool = False,
) -> SimulatedLine:
    """Return the line with its sensors and all faults, except echo and latency.

    `blueprints` has the devices of single slave ids, where they differ from the plan's. Echo and latency are the
    adapter's: hand `faults.line.echo` and `.latency` to the port or the `PtyLine`.
    """
    faults = faults or FaultFile()
    line = SimulatedLine(format=plan.format, framing=plan.framing, seed=plan.seed, keep_log=keep_log)
    for slave in plan.slaves:
        entry = faults.slaves.get(slave, SlaveEntry())
        for copy in range(entry.copies):
            sensor = line.add(
                _sensor(plan, slave, entry, plan.seed + copy, (blueprints or {}).get(slave, plan.blueprint))
            )
            if plan.recorded is not None:
                sensor.memory.recorded = plan.recorded.of_slave(slave)
            sensor.faults += [fault.sensor_fault for fault in (*faults.all, *entry.faults)]
    for spell in faults.line.babble:
        babble(line, spell.after, spell.last, spell.every)
    for noise in faults.line.noise:
        when = window(noise.after, noise.last, noise.every)
        stray(line, noise.rate, length=noise.bytes, delay=noise.delay, window=when)
    for other in faults.line.second_master:
        signal = plan.blueprint.signals[0]
        words = signal.address.to_bytes(2, "big") + signal.count.to_bytes(2, "big")
        second_master(line, bytes((other.slave, READ_HOLDING)) + words, other.after, other.every)
    return line


def _sensor(plan: LinePlan, slave: int, entry: SlaveEntry, seed: int, blueprint: Blueprint) -> Sensor:
    shape = plan.format if entry.baudrate is None else replace(plan.format, baudrate=entry.baudrate)
    return Sensor(
        slave,
        blueprint=blueprint,
        format=shape,
        framing=plan.framing,
        turnaround=plan.turnaround if entry.turnaround is None else entry.turnaround,
        jitter=plan.jitter if entry.jitter is None else entry.jitter,
        source=None if plan.unique else Wind(seed * (LAST_ID + 1) + slave),
        seed=seed,
    )
