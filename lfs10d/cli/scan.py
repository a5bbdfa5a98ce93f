"""`lfs10d scan`: finds the devices on a line and prints the configuration for them."""

from __future__ import annotations

import json
import os
import shlex
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import click

from lfs10d.cli import EXIT_FAILED, EXIT_UNAVAILABLE, examples, json_option, print_lines
from lfs10d.cli.calibrated import NONE, Calibrations, calibration_option, calibrations_of
from lfs10d.cli.direct_line import DirectLine
from lfs10d.cli.options import PORT, LineOptions, baudrate, id_list, line_options, take
from lfs10d.cli.port_holder import instead
from lfs10d.cli.render import scan_findings, troubleshooting
from lfs10d.cli.render.scan_progress import scan_view
from lfs10d.errors import FailedError, PortBusyError, PortError
from lfs10d.line.jobs.identification import FoundDevice, by_evidence
from lfs10d.line.jobs.scan import Scan
from lfs10d.line.jobs.scan_plan import FIRST_TIMEOUT, ScanPlan
from lfs10d.modbus.frames import Checksum, Codec, Framing
from lfs10d.profiles.library import builtin_names, load_profile
from lfs10d.reading import FaultCode, Value
from lfs10d.system.dataclass import dataclass

LOOK_EVERY = 0.1
"""Seconds between two updates of the progress."""

EXAMPLES = examples("""
  lfs10d scan /dev/ttyUSB0                    all ids at both rates, a minute
  lfs10d scan /dev/ttyUSB0 --ids 1-20         twenty ids, a few seconds
  lfs10d scan /dev/ttyUSB0 --baudrate 9600    one rate
  lfs10d scan /dev/ttyUSB0 --write site.yaml  keep what was found
""")


def _rates(context: click.Context, parameter: click.Parameter, value: str) -> tuple[int, ...]:
    return tuple(dict.fromkeys(baudrate(context, parameter, part) for part in value.split(",")))


def _new_file(context: click.Context, parameter: click.Parameter, value: Path | None) -> Path | None:
    if value is not None and value.exists():
        raise click.BadParameter(f"{value} exists already, and is not overwritten: name another", context, parameter)
    return value


def given(name: str) -> bool:
    """Whether this option was given on the command line."""
    source = click.get_current_context().get_parameter_source(name)
    return source is not None and source is not click.core.ParameterSource.DEFAULT


@click.command("scan", epilog=EXAMPLES)
@click.argument("port", type=PORT)
@click.option(
    "--ids",
    callback=id_list,
    default="1-255",
    metavar="IDS",
    help="Slave ids to ask, such as 1-20,255.",
)
@click.option(
    "--baudrate",
    "rates",
    callback=_rates,
    default="9600,19200",
    metavar="RATES",
    help="Rates to try.",
)
@click.option(
    "--profile",
    "profiles",
    multiple=True,
    metavar="NAME|FILE",
    help="Also recognise devices of this profile, and try its rates.",
)
@click.option("--checksum", type=click.Choice(["crc", "sum"]), default="crc", help="Check of the rtu frames.")
@click.option(
    "--write",
    type=click.Path(path_type=Path, dir_okay=False),
    callback=_new_file,
    metavar="FILE",
    help="Write a configuration for what was found; no file is overwritten.",
)
@line_options
@calibration_option
@json_option
def command(
    ids: tuple[int, ...],
    rates: tuple[int, ...],
    profiles: tuple[str, ...],
    write: Path | None,
    **options: Any,  # noqa: ANN401  # `take` types them
) -> int:
    """Find the devices on the line at PORT.

    Asks every id at every rate; nothing is ever written to a device. A device set to the other checksum does not
    answer: scan once with each. The port must be free. Exit code 1 if no device answers. Values of a slave that is
    configured with `calibration` are shown raw and calibrated.
    """
    as_json, checksum = options.pop("as_json"), options.pop("checksum")
    line = take(options)
    if line.framing is Framing.ASCII and checksum != "crc":
        raise click.UsageError("ascii frames always carry an LRC; leave --checksum out")
    own = {file: load_profile(file, relative_to=Path()) for file in profiles}
    if not given("rates"):
        rates = tuple(dict.fromkeys((*rates, *(rate for each in own.values() for rate in each.rates))))
    included = (load_profile(name, relative_to=Path()) for name in builtin_names())
    known = (*own.values(), *by_evidence(each for each in included if each not in own.values()))
    calibrations = calibrations_of(line.port, options["config"], options["state_dir"])
    search = ScanPlan(
        ids,
        tuple(line.timing(rate) for rate in rates),
        Codec(line.framing, Checksum(checksum)),
        tuple(each for each in known if line.framing.value in each.framings and checksum in each.checksums),
        timeout=line.timeout or FIRST_TIMEOUT,
        read_as=calibrations.read_as,
    )
    if not search.profiles:
        raise click.UsageError(f"none of these profiles supports {line.framing.value}")
    asked = scan_findings.ScanRequest(checksum, {profile.name: file for file, profile in own.items()})
    result = _Result(Scan(search), line, asked, calibrations)
    code = _scan(result, as_json=as_json)
    if not result.opened:
        return code
    if as_json:
        click.echo(json.dumps(result.report(), indent=2, allow_nan=False))
    else:
        result.show(written=write is not None)
    if write is not None and result.scan.found:
        _write(write, result)
    return code


def _write(file: Path, result: _Result) -> None:
    asked = replace(result.asked, files={name: _seen_from(file, each) for name, each in result.asked.files.items()})
    text = "\n".join(scan_findings.snippet(result.scan.found, result.line, asked=asked, known=result.calibrations))
    try:
        with file.open("x", encoding="utf-8") as new:
            new.write(f"# What lfs10d scan found.\n{text}\n")
    except OSError as error:
        raise FailedError(f"{file} cannot be written: {error.strerror}") from None
    click.echo(f"{file} written. Look at it, then: lfs10d check -c {shlex.quote(str(file))}", err=True)


def _seen_from(file: Path, profile: str) -> str:
    """Return the path of a profile as a configuration in `file` names it: relative to its folder."""
    return profile if profile in builtin_names() else os.path.relpath(profile, file.absolute().parent)


@dataclass(slots=True)
class _Result:
    scan: Scan
    line: LineOptions
    asked: scan_findings.ScanRequest
    calibrations: Calibrations = NONE
    framing_errors: int | None = None
    opened: bool = False

    def calibrated(self, finding: FoundDevice) -> Mapping[str, Value | None]:
        """Return the calibrated values of those that have a calibration."""
        return self.calibrations.of(finding.slave, finding.baudrate, finding.profile, finding.values)

    def report(self) -> dict[str, Any]:
        """Return everything for JSON."""
        progress = self.scan.progress
        return {
            "port": scan_findings.lasting_name(self.line.port),
            "complete": self.scan.complete,
            "asked": progress.asked,
            "total": progress.total,
            "found": [scan_findings.plain(finding, self.calibrated(finding)) for finding in self.scan.found],
            "noisy_ids": self.scan.noise.ids,
            "echo": self.scan.noise.echoed,
            "framing_errors": self.framing_errors,
        }

    def show(self, *, written: bool = False) -> None:
        """Print what was found and its configuration (unless that is `written`), or what to check if nothing was."""
        found = self.scan.found
        if found:
            scan_findings.show([scan_findings.row(finding, self.calibrated(finding)) for finding in found])
        if found and not written:
            click.echo()
            click.echo("# To poll them, save this as lfs10d.yaml, then: lfs10d run -c lfs10d.yaml")
            print_lines(scan_findings.snippet(found, self.line, asked=self.asked, known=self.calibrations))
        if found and not self.scan.noise.ids:
            return
        if found:
            click.echo()
        print_lines(self._explanation(), err=True)

    def _explanation(self) -> Iterator[str]:
        noise, asked = self.scan.noise, self.scan.progress.asked
        if noise.last is not None:
            yield f"At {noise.ids} of {asked} ids bytes were received that are no valid reply: {noise.last.message}."
            yield f"The last of them: {noise.last.heard.hex(' ').upper() or 'nothing'}"
        if self.scan.found or not self.scan.complete:
            return
        code = FaultCode.TIMEOUT if noise.last is None else noise.last.code
        seen = troubleshooting.Symptoms(code, noise.echoed, self.framing_errors)
        other = "Do the sensors use another rate, or parity? See --baudrate and --parity."
        yield from troubleshooting.lines(troubleshooting.meaning(seen), (*troubleshooting.checks(seen), other))


def _scan(result: _Result, *, as_json: bool) -> int:
    """Scan to the end, or until it is ended; return the exit code."""
    scan, port = result.scan, result.line.port
    first_rate = scan.plan.timings[0].baudrate
    try:
        with DirectLine(result.line.settings(first_rate)) as line:
            while not line.events(LOOK_EVERY):
                pass  # until the port is open
            result.opened = True
            with scan_view(scan, scan_findings.lasting_name(port), quiet=as_json) as update:
                line.submit(scan)
                while not scan.over:
                    line.events(LOOK_EVERY)
                    update()
            result.framing_errors = line.framing_errors
            while not scan.complete and line.events(LOOK_EVERY):
                pass  # the reason why it did not come to its end is among them
    except KeyboardInterrupt:
        progress = scan.progress
        click.echo(f"Stopped after {progress.asked} of {progress.total} ids; found so far:", err=True)
        return EXIT_FAILED
    except PortError as error:
        click.echo(f"lfs10d: {error}", err=True)
        if isinstance(error, PortBusyError):
            print_lines(instead(port, slave=None), err=True)
        return EXIT_UNAVAILABLE
    return 0 if scan.found else EXIT_FAILED
