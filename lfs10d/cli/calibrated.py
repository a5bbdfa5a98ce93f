"""The calibration of configured slaves, for the verbs that read a line themselves and show the raw values."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from dataclasses import field
from pathlib import Path
from typing import Any

import click

from lfs10d.cli import config_option, state_option
from lfs10d.cli.effective_file import with_changes
from lfs10d.config.credentials import DENIED
from lfs10d.config.effective import Effective
from lfs10d.config.loader import load
from lfs10d.config.models import SlaveConfig
from lfs10d.errors import ConfigError, StateError
from lfs10d.profiles.profile import Profile
from lfs10d.reading import Fault, Value
from lfs10d.system.dataclass import dataclass


def calibration_option(function: Callable[..., Any]) -> Callable[..., Any]:
    """Add `-c FILE` and `--state-dir`, passed on as `config: Path` and `state_dir`; `calibrations_of` takes them."""
    return config_option(state_option(function), "The configuration whose `calibration` is shown beside raw values.")


@dataclass(frozen=True, slots=True)
class Calibrations:
    """The configured slaves of a line, by the slave id that each has now, at the line's rate.

    `profiles` are the calibrated ones, `raw` the same that show values without calibration. `slaves` are all of them
    whose place is known.
    """

    profiles: Mapping[int, Profile]
    baudrate: int
    raw: Mapping[int, Profile] = field(default_factory=dict)
    slaves: Mapping[int, SlaveConfig] = field(default_factory=dict)

    def read_as(self, slave: int, baudrate: int, profile: Profile) -> Profile:
        """Return the profile with which raw values are judged as the daemon judges them.

        That is the contract's order: the calibration first, then the range.
        """
        known = self.raw.get(slave)
        return profile if known is None or baudrate != self.baudrate or known.plain != profile else known

    def of(
        self, slave: int, baudrate: int, profile: Profile | None, raw: Mapping[str, Value | None]
    ) -> dict[str, Value | None]:
        """Return the calibrated values by name, {} where the configuration has no calibration for this place.

        As the daemon would publish them: None where there is no raw value, or the calibrated one is out of range. The
        calibration is of a device of the configured profile: as another one nothing is calibrated.
        """
        calibrated = self.profiles.get(slave)
        if calibrated is None or baudrate != self.baudrate or calibrated.plain != profile:
            return {}
        values: dict[str, Value | None] = {}
        for value in calibrated.values:
            cell = value.cell(value.register)
            if cell.calibration is None:
                continue
            number = raw.get(value.name)
            believed = cell.believed(number) if isinstance(number, int | float) else None
            values[value.name] = None if isinstance(believed, Fault) else believed
        return values


NONE = Calibrations({}, 0)
UNFINISHED = "line.port"
"""The problems of a file without a port yet, such as the sample: it cannot be about this port."""


def calibrations_of(port: str, file: Path, state_dir: Path | None) -> Calibrations:
    """Return the calibrations that a configuration has for the line at `port`; called by a verb.

    `state_dir` is where a person says that the daemon keeps its state, None for the usual place.
    Raises ConfigError if a person named the file and it is not valid. Prints on standard error what cannot be known
    and why; then raw values alone are shown. A file that nobody named, and that is not there or does not name a port
    yet, has no calibration.
    """
    named = click.get_current_context().get_parameter_source("config") is click.core.ParameterSource.COMMANDLINE
    calibrations, trouble = _found(port, file, state_dir, named=named)
    if trouble is not None:
        click.echo(f"lfs10d: {trouble}; raw values alone are shown", err=True)
    return calibrations


def _found(port: str, file: Path, state_dir: Path | None, *, named: bool) -> tuple[Calibrations, str | None]:
    try:
        loaded = load(file, files=False)
    except ConfigError as error:
        if named:
            raise
        unfinished = _absent(file) or any(problem.path == UNFINISHED for problem in error.problems)
        return NONE, None if unfinished else str(error.problems[0])
    line = loaded.config.line
    if os.path.realpath(line.port) != os.path.realpath(port):
        return NONE, f"{file} is for another port, {line.port}" if named else None
    try:
        return _by_place(with_changes(loaded, state_dir))
    except StateError as error:
        if not any(slave.calibration for slave in loaded.config.slaves):
            return NONE, None
        remedy = " (call it as root)" if DENIED in str(error) else ""
        return NONE, f"{error}; so it is not known which slave id each sensor has now{remedy}"


def _by_place(now: Effective) -> tuple[Calibrations, str | None]:
    """Return the calibrations by slave id; a device that must be searched for first has none."""
    sure = {slave.id: slave for slave in now.polled.slaves if len(now.places[slave.name]) == 1}
    unsure = [slave.name for slave in now.polled.slaves if slave.calibration and slave.id not in sure]
    plain = {slave.id: (now.loaded.profiles[slave.profile], slave.certificates) for slave in sure.values()}
    plain = {each: known for each, known in plain.items() if known[1]}
    trouble = f"the daemon has not found out yet which slave id {', '.join(unsure)} has" if unsure else None
    profiles = {each: profile.calibrated(certificates) for each, (profile, certificates) in plain.items()}
    raw = {each: profile.calibrated(certificates, shows_raw=True) for each, (profile, certificates) in plain.items()}
    return Calibrations(profiles, now.config.line.baudrate, raw, sure), trouble


def _absent(file: Path) -> bool:
    try:
        file.stat()
    except FileNotFoundError:
        return True
    except OSError:
        return False
    return False
