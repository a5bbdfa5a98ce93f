"""`lfs10d simulate`: a simulated line on a pseudo terminal for any master; prints its figures at the end."""

from __future__ import annotations

import contextlib
import json
import signal
import threading
from dataclasses import replace
from pathlib import Path
from typing import Any

import click

from lfs10d.cli import examples, json_option
from lfs10d.cli.options import FRAMING, PARITY, STOPBITS, DurationType, id_list, profile_names
from lfs10d.profiles.library import load_profile
from lfs10d.schema.quantities import BAUDRATES
from lfs10d.simulator.blueprint import LFS10, blueprint_of
from lfs10d.simulator.builder import LinePlan, build
from lfs10d.simulator.fault_file import FaultFile, load_faults, profiles_of
from lfs10d.simulator.line import SimulatedLine
from lfs10d.simulator.pty import PtyLine
from lfs10d.simulator.recorded import load_recording
from lfs10d.simulator.wire import SECOND, Format, Framing, Parity
from lfs10d.system.dataclass import dataclass

DURATION = DurationType("5ms, 1s or 2m")

EXAMPLES = examples("""
  lfs10d simulate --link /tmp/line0                       eight sensors
  lfs10d simulate --link /tmp/line0 --slaves 1-4,255      these ids
  lfs10d simulate --link /tmp/line0 --faults faults.yaml  some of them faulty
  lfs10d simulate --link /tmp/line0 --wind wind.csv       recorded values
  lfs10d read /tmp/line0 3                                in another terminal

\b
A faults file:
  slaves:
    3: silent
    4: [{fault: noisy, rate: 0.1}]
    5: [{fault: silent, after: 10s, for: 5s}]

SIGUSR1 switches the power of all sensors off and on.
""")


@dataclass(frozen=True, slots=True)
class SimulateOptions:
    """The options as given; times in seconds."""

    link: Path | None
    slaves: tuple[int, ...]
    baudrate: str
    parity: Parity
    stopbits: str
    framing: Framing
    faults: Path | None
    profile: str | None
    turnaround: float
    jitter: float
    latency: float | None
    echo: bool
    values: str
    wind: Path | None
    seed: int
    interval: float | None
    as_json: bool

    @property
    def plan(self) -> LinePlan:
        """The line as asked for; raises ConfigError for a profile that cannot be read."""
        profile = None if self.profile is None else load_profile(self.profile, relative_to=Path())
        return LinePlan(
            self.slaves,
            Format(int(self.baudrate), 7 if self.framing == "ascii" else 8, self.parity, int(self.stopbits)),
            self.framing,
            LFS10 if profile is None else blueprint_of(profile),
            turnaround=self.turnaround,
            jitter=self.jitter,
            seed=self.seed,
            unique=self.values == "unique",
        )


@click.command("simulate", epilog=EXAMPLES)
@click.option("--link", type=click.Path(path_type=Path), metavar="PATH", help="A lasting name for the terminal.")
@click.option("--slaves", callback=id_list, default="1-8", metavar="IDS", help="Slave ids.")
@click.option("--baudrate", type=click.Choice([*map(str, BAUDRATES)]), default="9600", help="Bits per second.")
@PARITY
@STOPBITS
@FRAMING
@click.option("--faults", type=click.Path(path_type=Path), metavar="FILE", help="A faults file (YAML).")
@click.option(
    "--profile",
    metavar="NAME",
    shell_complete=profile_names,
    help="A profile's name or file, in place of lfs10.",
)
@click.option("--turnaround", type=DURATION, default="5ms", help="Time from a request to its answer.")
@click.option("--jitter", type=DURATION, default="0ms", help="Longest random time added to that.")
@click.option("--latency", type=DURATION, default=None, help="Interval at which the adapter delivers bytes.")
@click.option("--echo", is_flag=True, help="The adapter returns the master's own bytes.")
@click.option(
    "--values",
    type=click.Choice(["wind", "unique"]),
    default="wind",
    help="Wind that changes slowly, or each value once.",
)
@click.option("--wind", type=click.Path(path_type=Path), metavar="FILE", help="A recording (CSV) to play.")
@click.option("--seed", type=int, default=1, help="Seed of wind and faults.")
@click.option("--interval", type=DURATION, default=None, help="Print the counts at this interval.")
@json_option
def command(**values: Any) -> None:  # noqa: ANN401  # seventeen options; `SimulateOptions` names and types them
    """Run a line of simulated sensors on a pseudo terminal, and judge the master that polls it.

    A request that begins before 3.5 characters of silence, or has a pause of more than 1.5 characters inside, is
    ignored and counted. Ctrl-C ends it.
    """
    options = SimulateOptions(**values)
    plan = options.plan
    faults = FaultFile() if options.faults is None else load_faults(options.faults, plan.slaves)
    folder = Path() if options.faults is None else options.faults.parent
    blueprints = {slave: blueprint_of(each) for slave, each in profiles_of(faults, folder).items()}
    if options.wind is not None:
        names = {
            slave: [signal.name for signal in blueprints.get(slave, plan.blueprint).signals] for slave in plan.slaves
        }
        plan = replace(plan, recorded=load_recording(options.wind, names))
    latency = faults.line.latency if options.latency is None else options.latency
    port = PtyLine(
        build(plan, faults, blueprints),
        link=options.link,
        echo=options.echo or faults.line.echo,
        latency=latency,
        realtime=True,
    )
    with contextlib.suppress(KeyboardInterrupt), port:
        signal.signal(signal.SIGUSR1, lambda *_: port.tell(_power_cycle))
        _report_ready(options, port)
        while True:
            threading.Event().wait(options.interval or None)
            _report_figures(options, port, "figures")
    _report_figures(options, port, "end")


def _power_cycle(line: SimulatedLine) -> None:
    line.power_cut(line.now / SECOND)
    line.power_up()


def _report_ready(options: SimulateOptions, port: PtyLine) -> None:
    if options.as_json:
        _print({"event": "ready", "path": port.path, "terminal": port.terminal, "slaves": options.slaves})
        return
    shape = f"{options.baudrate} baud, {options.framing}"
    count = f"{len(options.slaves)} sensor{'s' if len(options.slaves) > 1 else ''}"
    click.echo(f"simulated line at {port.path}: {count}, {shape}; Ctrl-C ends it")


def _report_figures(options: SimulateOptions, port: PtyLine, event: str) -> None:
    figures = port.summary()
    if options.as_json:
        _print({"event": event, **figures})
        return
    gap = figures["min_gap_us"]
    words = ", ".join(
        f"{figures[key]} {text}"
        for key, text in (
            ("requests", "requests"),
            ("heard", "heard"),
            ("answers", "answers"),
            ("gap_violations", "begun too early"),
            ("t15_violations", "torn"),
            ("collisions", "collisions"),
            ("malformed", "malformed"),
        )
    )
    shortest = "" if gap is None else f", shortest gap {float(gap) / 1000:.3f} ms"
    click.echo(f"{float(figures['seconds']):.0f} s: {words}{shortest}")


def _print(data: dict[str, Any]) -> None:
    click.echo(json.dumps(data, allow_nan=False))
