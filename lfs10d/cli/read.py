"""`lfs10d read`: one sensor, now; and what to do when it does not answer."""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import click

from lfs10d.cli import EXIT_FAILED, EXIT_UNAVAILABLE, json_option
from lfs10d.cli.direct_line import DirectLine
from lfs10d.cli.local_time import clock_text, stamp
from lfs10d.cli.options import PORT, LineOptions, SlaveId, baudrate_of, line_options, profile_names, take
from lfs10d.cli.port_holder import instead
from lfs10d.cli.render import troubleshooting
from lfs10d.errors import PortBusyError
from lfs10d.line.device import DeviceSpec, PollRules
from lfs10d.modbus.frames import Checksum, Codec, describe
from lfs10d.profiles.library import load_profile
from lfs10d.profiles.profile import Profile
from lfs10d.reading import ALIVE_CODES, Exchanged, Fault, FaultCode, Reading, UartCounters
from lfs10d.schema.quantities import duration_text, seconds

ATTEMPTS = 3
"""So many polls are tried, with 200, 400, 1000 ms of patience (`lfs10d.line.device.FIRST_TIMEOUTS`)."""
AT_ONCE = 0.05
"""Seconds between two of them, at least."""
LOOK_EVERY = 0.1
WIDE_HEX = 40
"""Columns of hex that are aligned; longer ones stand out."""
BAR_UNIT = 1.0
BAR_MOST = 40
"""A column of the wind bar is one unit of the value; it has at most so many."""

EXAMPLES = """\b
Examples:
  lfs10d read /dev/ttyUSB0 3                   the wind sensor with id 3
  lfs10d read /dev/ttyUSB0 3 --watch           every second, until Ctrl-C
  lfs10d read /dev/ttyUSB0 4 --baudrate 19200  another rate
  lfs10d read /dev/ttyUSB0 7 --profile ld-e    another device
"""


def _rate(context: click.Context, parameter: click.Parameter, value: str) -> int:
    del context, parameter
    return baudrate_of(value)


def _interval(context: click.Context, parameter: click.Parameter, value: str) -> float:
    try:
        interval = seconds(value)
    except ValueError:
        raise click.BadParameter(f"{value!r} is no duration; write 250ms or 1s", context, parameter) from None
    if interval < AT_ONCE:
        raise click.BadParameter(f"must be {duration_text(AT_ONCE)} or more", context, parameter)
    return interval


@click.command("read", epilog=EXAMPLES)
@click.argument("port", type=PORT)
@click.argument("slave", metavar="ID", type=SlaveId())
@click.option(
    "--profile",
    "profile_name",
    default="lfs10",
    show_default=True,
    metavar="NAME|FILE",
    shell_complete=profile_names,
    help="Which device.",
)
@click.option(
    "--baudrate", callback=_rate, default="9600", show_default=True, metavar="RATE", help="The sensor's rate."
)
@click.option("--checksum", type=click.Choice(["crc", "sum"]), default=None, help="If not the profile's.")
@click.option("--watch", is_flag=True, help="Read again and again, until Ctrl-C.")
@click.option("--interval", callback=_interval, default="1s", show_default=True, metavar="DURATION", help="How often.")
@line_options
@json_option
def command(**options: Any) -> int:  # noqa: ANN401  # eleven options; `_Wanted` names and types them
    """Read the sensor with slave id ID on the line at PORT, now.

    The port must be free. Exit code 1 if there is no value.
    """
    line = take(options)
    profile = load_profile(options.pop("profile_name"), relative_to=Path())
    if line.framing.value not in profile.framings:
        raise click.UsageError(f"profile {profile.name} does not speak {line.framing.value}")
    wanted = _ReadOptions(line=line, profile=profile, **options)
    first, last = profile.ids
    if not first <= wanted.slave <= last:
        raise click.UsageError(f"profile {profile.name} has ids {first} to {last}, not {wanted.slave}")
    try:
        return _read(wanted)
    except PortBusyError as error:
        click.echo(f"lfs10d: {error}", err=True)
        for text in instead(line.port, slave=wanted.slave):
            click.echo(text, err=True)
        return EXIT_UNAVAILABLE


@dataclass(frozen=True, slots=True)
class _ReadOptions:
    """What is to be read, and how it is to be shown; `interval` in s."""

    line: LineOptions
    slave: int
    profile: Profile
    baudrate: int
    checksum: str | None
    watch: bool
    interval: float
    as_json: bool

    @property
    def codec(self) -> Codec:
        return Codec(self.line.framing, Checksum(self.checksum or self.profile.checksum))

    @property
    def spec(self) -> DeviceSpec:
        """The device for the scheduler."""
        interval = self.interval if self.watch else AT_ONCE
        return DeviceSpec(
            name=f"slave-{self.slave}",
            slave=self.slave,
            profile=self.profile,
            codec=self.codec,
            interval=max(interval, self.profile.min_interval),
            response_timeout=self.line.timeout,
            request_gap=self.profile.request_gap,
        )


@dataclass(slots=True)
class _Course:
    """What happened so far."""

    exchanges: list[Exchanged] = field(default_factory=list)
    failures: int = 0
    explained: bool = False


def _read(wanted: _ReadOptions) -> int:
    course = _Course()
    rules = PollRules(retries=int(wanted.watch), offline_after=ATTEMPTS, probe_interval_max=max(1.0, wanted.interval))
    try:
        with DirectLine(wanted.line.settings(wanted.baudrate)) as line:
            line.poll([wanted.spec], rules)
            while True:
                for event in line.events(LOOK_EVERY):
                    if isinstance(event, Exchanged):
                        course.exchanges = [*course.exchanges, event][-ATTEMPTS:]
                    elif isinstance(event, Reading):
                        over = _take(wanted, course, event, line)
                        if over is not None:
                            return over
    except KeyboardInterrupt:
        return 0 if wanted.watch else EXIT_FAILED


def _take(wanted: _ReadOptions, course: _Course, reading: Reading, line: DirectLine) -> int | None:
    """Show one reading if it is to be shown; return the exit code when all is done."""
    fault = reading.fault
    course.failures = 0 if fault is None else course.failures + 1
    final = fault is None or (fault.code in ALIVE_CODES and not fault.busy) or course.failures >= ATTEMPTS
    if wanted.as_json and (wanted.watch or final):
        click.echo(json.dumps(_plain(wanted, reading), allow_nan=False))
        sys.stdout.flush()
    elif wanted.watch:
        click.echo(_watched(wanted, reading))
        sys.stdout.flush()
    elif fault is None:
        for text in _shown(wanted, reading):
            click.echo(text)
    if fault is not None and final and not course.explained and not wanted.as_json:
        course.explained = True
        for text in _explained(wanted, course, fault, line.uart):
            click.echo(text, err=True)
    if wanted.watch or not final:
        return None
    return EXIT_FAILED if fault is not None else 0


# -- in words


def _numbers(wanted: _ReadOptions, reading: Reading) -> Iterator[tuple[str, str]]:
    units = wanted.profile.units
    for name, number in (reading.values or {}).items():
        unit = units[name]
        yield name, f"{number}" if unit == "1" else f"{number} {unit}"


def _wall(reading: Reading) -> float:
    """Return when it was read, in seconds since the epoch."""
    return time.time() - (time.monotonic() - reading.at)


def _milliseconds(reading: Reading) -> str:
    return "" if reading.rtt is None else f"{reading.rtt * 1e3:.1f} ms"


def _shown(wanted: _ReadOptions, reading: Reading) -> Iterator[str]:
    yield click.style(f"Slave {wanted.slave} answers: {wanted.profile.title}", bold=True)
    rows = [*_numbers(wanted, reading), ("answered in", _milliseconds(reading))]
    width = max(len(name) for name, _ in rows)
    for name, text in rows:
        yield f"  {name.ljust(width)}  {text}"


def _watched(wanted: _ReadOptions, reading: Reading) -> str:
    """Return a reading as one line."""
    terminal = sys.stdout.isatty()
    ts = _wall(reading) * 1000
    when = clock_text(ts) if terminal else stamp(ts)
    if reading.fault is not None:
        return f"{when}  {click.style(f'{reading.fault.code}: {reading.fault.message}', fg='red')}"
    text = "  ".join(f"{name} {number}" for name, number in _numbers(wanted, reading))
    bar = _bar(wanted, reading) if terminal else ""
    return f"{when}  {text:<24}  {_milliseconds(reading):>8}  {bar}".rstrip()


def _bar(wanted: _ReadOptions, reading: Reading) -> str:
    if "wind_speed" not in wanted.profile.value_names or reading.values is None:
        return ""
    block = "\N{BOX DRAWINGS HEAVY HORIZONTAL}" if (sys.stdout.encoding or "").lower().startswith("utf") else "#"
    return click.style(block * min(BAR_MOST, round(reading.values["wind_speed"] / BAR_UNIT)), fg="cyan")


def _explained(wanted: _ReadOptions, course: _Course, fault: Fault, uart: UartCounters | None) -> Iterator[str]:
    """Yield what was asked and heard, what it means and what to check."""
    how = f"{wanted.baudrate} baud {wanted.line.character}"
    attempts = f"{course.failures} attempt{'s' * (course.failures > 1)}"
    yield f"lfs10d: no value from slave {wanted.slave} at {how} after {attempts}: {fault.message}"
    yield ""
    told = [pair for each in course.exchanges for pair in (("sent ", each.sent), ("heard", each.heard))]
    hexes = [frame.hex(" ").upper() or "nothing" for _, frame in told]
    width = min(max(map(len, hexes)), WIDE_HEX)
    for (what, frame), text in zip(told, hexes, strict=True):
        yield f"  {what}  {text.ljust(width)}  {_meant(frame, wanted)}".rstrip()
    yield ""
    echoed = any(each.sent and each.heard.startswith(each.sent) for each in course.exchanges)
    framing = None if uart is None else uart.framing
    seen = troubleshooting.Symptoms(fault.code, echoed, framing)
    yield from troubleshooting.lines(
        troubleshooting.meaning(seen), (*_own_advice(wanted, fault), *troubleshooting.checks(seen))
    )


def _meant(frame: bytes, wanted: _ReadOptions) -> str:
    return describe(frame, wanted.codec) if frame else ""


def _own_advice(wanted: _ReadOptions, fault: Fault) -> Iterator[str]:
    if fault.code not in (FaultCode.TIMEOUT, FaultCode.MALFORMED, FaultCode.WRONG_SLAVE):
        return
    other = 19200 if wanted.baudrate != 19200 else 9600  # noqa: PLR2004  # the two rates of an LFS10
    yield f"Is it this id and this rate? `lfs10d scan {wanted.line.port}` tries them all; or try --baudrate {other}."


def _plain(wanted: _ReadOptions, reading: Reading) -> dict[str, Any]:
    """Return a reading for JSON: a sample of the contract, as far as there is one without a daemon."""
    fault = reading.fault
    names, units = wanted.profile.value_names, wanted.profile.units
    values = reading.values or {}
    return {
        "slave": wanted.slave,
        "port": wanted.line.port,
        "baudrate": wanted.baudrate,
        "profile": wanted.profile.name,
        "ts": int(_wall(reading) * 1000),
        **{name: values.get(name) for name in names},
        **({"unit": units[names[0]]} if len(names) == 1 else {"units": units}),
        "quality": "good" if fault is None else "bad",
        "error": None if fault is None else fault.code.value,
        "message": None if fault is None else fault.message,
        "exception_code": None if fault is None else fault.exception_code,
        "heard": "" if fault is None else fault.heard.hex(" ").upper(),
        "rtt_ms": None if reading.rtt is None else round(reading.rtt * 1e3, 1),
    }
