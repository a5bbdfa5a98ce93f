"""`lfs10d read`: reads one sensor, and says what to check when it does not answer."""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Iterator, Mapping
from dataclasses import field
from pathlib import Path
from typing import Any

import click

from lfs10d.cli import EXIT_FAILED, EXIT_UNAVAILABLE, examples, json_option, print_lines
from lfs10d.cli.calibrated import NONE, Calibrations, calibration_option, calibrations_of
from lfs10d.cli.direct_line import DirectLine
from lfs10d.cli.local_time import clock_text, stamp
from lfs10d.cli.options import PORT, DurationType, LineOptions, SlaveId, baudrate, line_options, profile_names, take
from lfs10d.cli.port_holder import instead
from lfs10d.cli.render import troubleshooting
from lfs10d.errors import PortBusyError
from lfs10d.line.device import DeviceSpec, PollRules
from lfs10d.modbus.description import describe
from lfs10d.modbus.frames import Checksum, Codec
from lfs10d.profiles.library import load_profile
from lfs10d.profiles.profile import Profile
from lfs10d.reading import ALIVE_CODES, Exchanged, Fault, FaultCode, Reading, Value
from lfs10d.system.dataclass import dataclass
from lfs10d.system.logs import escape

ATTEMPTS = 3
"""Polls that are tried, with time-outs of 200, 400 and 1000 ms (`lfs10d.line.device.FIRST_TIMEOUTS`)."""
ONE_READING_INTERVAL = 0.5
"""Interval in s for a single reading: no second poll begins while the first is held back (`held_readings`)."""
SHORTEST_INTERVAL = 0.05
"""Seconds between two polls, at least."""
LOOK_EVERY = 0.1
WIDE_HEX = 40
"""Columns for bytes in hex; longer ones are not aligned."""
BAR_UNIT = 1.0
BAR_MOST = 40
"""Longest wind bar in columns; one column is one unit of the value."""

EXAMPLES = examples("""
  lfs10d read /dev/ttyUSB0 3                   the wind sensor with id 3
  lfs10d read /dev/ttyUSB0 3 --watch           every second, until Ctrl-C
  lfs10d read /dev/ttyUSB0 4 --baudrate 19200  another rate
  lfs10d read /dev/ttyUSB0 7 --profile ld-e    another device
""")


@click.command("read", epilog=EXAMPLES)
@click.argument("port", type=PORT)
@click.argument("slave", metavar="ID", type=SlaveId())
@click.option(
    "--profile",
    "profile_name",
    default="lfs10",
    metavar="NAME|FILE",
    shell_complete=profile_names,
    help="Kind of device.",
)
@click.option("--baudrate", callback=baudrate, default="9600", metavar="RATE", help="The sensor's rate.")
@click.option(
    "--checksum", type=click.Choice(["crc", "sum"]), default=None, help="Check of the rtu frames, if not the profile's."
)
@click.option("--watch", is_flag=True, help="Read again and again, until Ctrl-C.")
@click.option(
    "--interval",
    type=DurationType("250ms or 1s", least=SHORTEST_INTERVAL),
    default="1s",
    help="Time between two readings with --watch.",
)
@line_options
@calibration_option
@json_option
def command(**values: Any) -> int:  # noqa: ANN401  # twelve options; `_ReadOptions` names and types them
    """Read the sensor with slave id ID on the line at PORT, now.

    The port must be free. Exit code 1 if there is no value. A slave that is configured with `calibration` is shown
    raw and calibrated.
    """
    line = take(values)
    config, state_dir = values.pop("config"), values.pop("state_dir")
    profile = load_profile(values.pop("profile_name"), relative_to=Path())
    if line.framing.value not in profile.framings:
        raise click.UsageError(f"profile {profile.name} does not support {line.framing.value}")
    first, last = profile.ids
    if not first <= values["slave"] <= last:
        raise click.UsageError(f"profile {profile.name} has ids {first} to {last}, not {values['slave']}")
    calibrations = calibrations_of(line.port, config, state_dir)
    options = _ReadOptions(line=line, profile=profile, calibrations=calibrations, **values)
    try:
        return _read(options)
    except PortBusyError as error:
        click.echo(f"lfs10d: {error}", err=True)
        print_lines(instead(line.port, slave=options.slave), err=True)
        return EXIT_UNAVAILABLE


@dataclass(frozen=True, slots=True)
class _ReadOptions:
    """The options as given; `interval` in s."""

    line: LineOptions
    slave: int
    profile: Profile
    baudrate: int
    checksum: str | None
    watch: bool
    interval: float
    as_json: bool
    calibrations: Calibrations = NONE

    def calibrated(self, reading: Reading) -> Mapping[str, Value | None]:
        """Return the calibrated values of those that have a calibration."""
        return self.calibrations.of(self.slave, self.baudrate, self.profile, reading.values or {})

    @property
    def codec(self) -> Codec:
        return Codec(self.line.framing, Checksum(self.checksum or self.profile.checksum))

    @property
    def spec(self) -> DeviceSpec:
        """The device for the scheduler."""
        interval = self.interval if self.watch else ONE_READING_INTERVAL
        return DeviceSpec(
            name=f"slave-{self.slave}",
            slave=self.slave,
            profile=self.calibrations.read_as(self.slave, self.baudrate, self.profile),
            codec=self.codec,
            interval=max(interval, self.profile.min_interval),
            response_timeout=self.line.timeout,
            request_gap=self.profile.request_gap,
        )


@dataclass(slots=True)
class _Attempts:
    """The last exchanges, and how many polls in a row failed."""

    exchanges: list[Exchanged] = field(default_factory=list)
    failures: int = 0
    explained: bool = False


def _read(options: _ReadOptions) -> int:
    attempts = _Attempts()
    rules = PollRules(retries=int(options.watch), offline_after=ATTEMPTS, probe_interval_max=max(1.0, options.interval))
    try:
        with DirectLine(options.line.settings(options.baudrate)) as line:
            line.poll([options.spec], rules)
            while True:
                for event in line.events(LOOK_EVERY):
                    if isinstance(event, Exchanged):
                        attempts.exchanges = [*attempts.exchanges, event][-ATTEMPTS:]
                    elif isinstance(event, Reading):
                        over = _on_reading(options, attempts, event, line)
                        if over is not None:
                            return over
    except KeyboardInterrupt:
        return 0 if options.watch else EXIT_FAILED


def _on_reading(options: _ReadOptions, attempts: _Attempts, reading: Reading, line: DirectLine) -> int | None:
    """Show one reading unless it is a failure before the last try; return the exit code at the end, else None."""
    fault = reading.fault
    attempts.failures = 0 if fault is None else attempts.failures + 1
    final = fault is None or (fault.code in ALIVE_CODES and not fault.busy) or attempts.failures >= ATTEMPTS
    if options.as_json and (options.watch or final):
        click.echo(json.dumps(_json(options, reading), allow_nan=False))
        sys.stdout.flush()
    elif options.watch:
        click.echo(_watched(options, reading))
        sys.stdout.flush()
    elif fault is None:
        print_lines(_shown(options, reading))
    if fault is not None and final and not attempts.explained and not options.as_json:
        attempts.explained = True
        print_lines(_explanation(options, attempts, fault, line.framing_errors), err=True)
    if options.watch or not final:
        return None
    return EXIT_FAILED if fault is not None else 0


# -- in words


def _numbers(options: _ReadOptions, reading: Reading) -> Iterator[tuple[str, str]]:
    units = options.profile.units
    calibrated = options.calibrated(reading)
    for name, value in (reading.values or {}).items():
        if value is None:
            yield name, f"no value ({reading.value_errors[name]})"
            continue
        text = _with_unit(value, units.get(name, "1"))
        if name in calibrated:
            number = calibrated[name]
            text += f", calibrated {'out of range' if number is None else _with_unit(number, units[name])}"
        if name in reading.ages:
            text += f", {reading.ages[name]:.0f} s old"
        yield name, text


def _with_unit(value: Value, unit: str) -> str:
    shown = ("true" if value else "false") if isinstance(value, bool) else escape(str(value))
    return shown if unit == "1" else f"{shown} {unit}"


def _wall(reading: Reading) -> float:
    """Return the time of the reading in seconds since the epoch."""
    return time.time() - (time.monotonic() - reading.at)


def _milliseconds(reading: Reading) -> str:
    return "" if reading.rtt is None else f"{reading.rtt * 1e3:.1f} ms"


def _shown(options: _ReadOptions, reading: Reading) -> Iterator[str]:
    yield click.style(f"Slave {options.slave} answers: {options.profile.title}", bold=True)
    rows = [*_numbers(options, reading), ("answered in", _milliseconds(reading))]
    width = max(len(name) for name, _ in rows)
    for name, text in rows:
        yield f"  {name.ljust(width)}  {text}"


def _watched(options: _ReadOptions, reading: Reading) -> str:
    """Return a reading as one line."""
    terminal = sys.stdout.isatty()
    ts = _wall(reading) * 1000
    when = clock_text(ts) if terminal else stamp(ts)
    if reading.fault is not None:
        return f"{when}  {click.style(f'{reading.fault.code}: {reading.fault.message}', fg='red')}"
    text = "  ".join(f"{name} {number}" for name, number in _numbers(options, reading))
    bar = _bar(reading) if terminal else ""
    return f"{when}  {text:<24}  {_milliseconds(reading):>8}  {bar}".rstrip()


def _bar(reading: Reading) -> str:
    speed = (reading.values or {}).get("wind_speed")
    if not isinstance(speed, int | float):
        return ""
    block = "\N{BOX DRAWINGS HEAVY HORIZONTAL}" if (sys.stdout.encoding or "").lower().startswith("utf") else "#"
    return click.style(block * min(BAR_MOST, round(speed / BAR_UNIT)), fg="cyan")


def _explanation(options: _ReadOptions, attempts: _Attempts, fault: Fault, framing: int | None) -> Iterator[str]:
    """Yield the frames sent and received, what they mean and what to check."""
    how = f"{options.baudrate} baud {options.line.character}"
    tries = f"{attempts.failures} attempt{'s' * (attempts.failures > 1)}"
    yield f"lfs10d: no value from slave {options.slave} at {how} after {tries}: {fault.message}"
    yield ""
    frames = [pair for each in attempts.exchanges for pair in (("sent    ", each.sent), ("received", each.heard))]
    hexes = [frame.hex(" ").upper() or "nothing" for _, frame in frames]
    width = min(max(map(len, hexes)), WIDE_HEX)
    for (what, frame), text in zip(frames, hexes, strict=True):
        meaning = describe(frame, options.codec) if frame else ""
        yield f"  {what}  {text.ljust(width)}  {meaning}".rstrip()
    yield ""
    echoed = any(each.sent and each.heard.startswith(each.sent) for each in attempts.exchanges)
    seen = troubleshooting.Symptoms(fault.code, echoed, framing)
    yield from troubleshooting.lines(
        troubleshooting.meaning(seen), (*_rate_advice(options, fault), *troubleshooting.checks(seen))
    )


def _rate_advice(options: _ReadOptions, fault: Fault) -> Iterator[str]:
    if fault.code not in (FaultCode.TIMEOUT, FaultCode.MALFORMED, FaultCode.WRONG_SLAVE):
        return
    other = 19200 if options.baudrate != 19200 else 9600  # noqa: PLR2004  # the two rates of an LFS10
    yield f"Is it this id and this rate? `lfs10d scan {options.line.port}` tries them all; or try --baudrate {other}."


def _json(options: _ReadOptions, reading: Reading) -> dict[str, Any]:
    """Return a reading for JSON: a sample as the daemon publishes it, without what only a daemon knows."""
    fault = reading.fault
    names, units = options.profile.value_names, options.profile.units
    values = reading.values or {}
    calibrated = options.calibrated(reading)
    return {
        "slave": options.slave,
        "port": options.line.port,
        "baudrate": options.baudrate,
        "profile": options.profile.name,
        "ts": int(_wall(reading) * 1000),
        **{name: values.get(name) for name in names},
        **({"unit": units[names[0]]} if len(names) == 1 else {"units": units}),
        "quality": "bad" if fault is not None else "partial" if reading.value_errors else "good",
        "error": None if fault is None else fault.code.value,
        **(
            {"errors": {name: code.value for name, code in reading.value_errors.items()}}
            if reading.value_errors
            else {}
        ),
        **({"calibrated": calibrated} if calibrated else {}),
        **({"ages": {name: round(age, 3) for name, age in reading.ages.items()}} if reading.ages else {}),
        "message": None if fault is None else fault.message,
        "exception_code": None if fault is None else fault.exception_code,
        "heard": "" if fault is None else fault.heard.hex(" ").upper(),
        "rtt_ms": None if reading.rtt is None else round(reading.rtt * 1e3, 1),
    }
