"""The findings of a scan: a table for people, YAML to paste, JSON for programs."""

from __future__ import annotations

import json
import os
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lfs10d.cli.calibrated import NONE, Calibrations
from lfs10d.cli.options import LineOptions
from lfs10d.cli.render import table
from lfs10d.config.models import SlaveConfig
from lfs10d.modbus.frames import EXCEPTION_NAMES, Framing
from lfs10d.profiles.profile import Profile
from lfs10d.reading import NOTHING, Value
from lfs10d.schema.quantities import duration_text
from lfs10d.system.dataclass import dataclass

if TYPE_CHECKING:  # as in `lfs10d.commands.context`
    from lfs10d.line.jobs.identification import FoundDevice

HEAD = ("id", "baud", "answers in", "what it is", table.REMARK)
RIGHT = (0, 1, 2)

DEFAULT_PROFILE = "lfs10"
DEFAULT_BAUDRATE = 9600
DEFAULT_INTERVAL = 1.0
ILLEGAL_FUNCTION = 1
"""The exception of a device that does not know the function (Modbus Application Protocol V1.1b3, section 7)."""
BY_ID = Path("/dev/serial/by-id")


def row(finding: FoundDevice, calibrated: Mapping[str, Value | None] = NOTHING) -> tuple[str, ...]:
    """Return a finding as a row of the table, the first value calibrated too where it has a calibration."""
    answers_in = f"{finding.rtt * 1e3:.0f} ms" if finding.rtt is not None else "-"
    return str(finding.slave), str(finding.baudrate), answers_in, what(finding, calibrated), "; ".join(remarks(finding))


def show(rows: Iterable[tuple[str, ...]]) -> None:
    """Print what was found."""
    table.show([table.Table("", HEAD, tuple(rows), RIGHT)])


def what(finding: FoundDevice, calibrated: Mapping[str, Value | None] = NOTHING) -> str:
    """Return what it is, with what it measures just now."""
    profile = finding.profile
    if profile is not None:
        return profile.title if finding.duplicate else f"{profile.title}, {value_text(finding, calibrated)}"
    if not finding.answers:
        return "something that gives no valid reply"
    if finding.exception is not None:
        name = EXCEPTION_NAMES.get(finding.exception, "of its own")
        how = "refuses" if finding.exception == ILLEGAL_FUNCTION else "answers"
        return f"unknown device, {how} function 03 (exception {finding.exception:02X} {name})"
    return "unknown device, answers function 03"


def value_text(finding: FoundDevice, calibrated: Mapping[str, Value | None] = NOTHING) -> str:
    """Return its first value with its unit, and calibrated where it has a calibration."""
    profile = finding.profile
    if profile is None or profile.value_names[0] not in finding.values:
        return "no plausible value"
    first = profile.values[0]
    unit = "" if first.unit == "1" else f" {first.unit}"
    text = f"{finding.values[first.name]}{unit}"
    if first.name not in calibrated:
        return text
    number = calibrated[first.name]
    return f"{text}, calibrated {'out of range' if number is None else f'{number}{unit}'}"


def remarks(finding: FoundDevice) -> Iterator[str]:
    """Yield remarks about a device."""
    if finding.duplicate:
        yield f"DUPLICATE? {finding.spoilt} of {finding.tries} replies garbled: two sensors with this id?"
    elif finding.spoilt:
        yield f"{finding.spoilt} of {finding.tries} replies garbled"
    other = finding.id_register if finding.id_register != finding.slave else None
    if finding.suspect and other is not None:
        yield f"SUSPECT: probably sensor {other}, which answers {finding.slave} too"
    elif finding.suspect:
        yield "SUSPECT: others answer too, so it may be no sensor of its own"
    elif other is not None:
        yield f"its id register holds {other}{_lock(finding.profile)}"
    if is_factory_id(finding.slave, finding.profile):
        yield "the factory id"
    if finding.alternatives:
        yield may_also_be([profile.title for profile in finding.alternatives])


def _lock(profile: Profile | None) -> str:
    lock = None if profile is None or profile.slave_id is None else profile.slave_id.locked_by
    return "" if lock is None else f": is the {lock} set?"


def is_factory_id(slave: int, profile: Profile | None) -> bool:
    """Whether a device is where new ones of its profile are, so that the next one will share its id."""
    return profile is not None and profile.factory is not None and profile.factory.id == slave


def may_also_be(names: Sequence[str]) -> str:
    """Return the remark that a device answers as others do too."""
    return f"or {' or '.join(names)}: its answers do not tell which"


@dataclass(frozen=True, slots=True)
class ScanRequest:
    """How the line was scanned: the checksum, and the files of the user's own profiles, by their names."""

    checksum: str = "crc"
    files: Mapping[str, str] = field(default_factory=dict)


AS_USUAL = ScanRequest()


def snippet(
    findings: Sequence[FoundDevice],
    options: LineOptions,
    by_id: Path = BY_ID,
    asked: ScanRequest = AS_USUAL,
    known: Calibrations = NONE,
) -> Iterator[str]:
    """Yield a configuration file that polls what was found; what cannot be polled as it is stands in comments.

    What the configuration says already of a slave (`known`) is kept: its name, label, times and calibration.
    """
    baudrate = usual_rate(findings)
    yield "line:"
    yield f"  port: {lasting_name(options.port, by_id)}"
    if baudrate != DEFAULT_BAUDRATE:
        yield f"  baudrate: {baudrate}"
    for key, value, usual in (
        ("parity", options.parity, "none"),
        ("databits", options.databits, 8),
        ("stopbits", options.stopbits, 1),
        ("framing", options.framing.value, Framing.RTU.value),
    ):
        if value != usual:
            yield f"  {key}: {value}"
    usable = [finding for finding in findings if _obstacle(finding, baudrate) is None]
    yield "slaves:" if usable else "slaves: []"
    for finding in findings:
        obstacle = _obstacle(finding, baudrate)
        entry = _entry(finding, options, asked, known)
        if obstacle is not None:
            yield f"  # - {entry}    {obstacle}"
            continue
        others = ", ".join(_word(profile, asked) for profile in finding.alternatives)
        yield f"  - {entry}    # or profile {others}: look at the device" if others else f"  - {entry}"
    yield "mqtt: {host: localhost}"


def usual_rate(findings: Sequence[FoundDevice]) -> int:
    """Return the rate at which most were found."""
    rates = [finding.baudrate for finding in findings if finding.answers and not finding.suspect]
    return max(rates, key=lambda rate: (rates.count(rate), -rate), default=DEFAULT_BAUDRATE)


def lasting_name(port: str, by_id: Path = BY_ID) -> str:
    """Return the name of an adapter that stays its own when others are plugged in; the absolute one where none is."""
    try:
        links = sorted(by_id.iterdir())
    except OSError:
        links = []
    lasting = (str(link) for link in links if os.path.realpath(link) == os.path.realpath(port))
    return next(lasting, os.path.abspath(port))  # noqa: PTH100  # resolve() would follow links that may be meant


def _entry(finding: FoundDevice, options: LineOptions, asked: ScanRequest, known: Calibrations) -> str:
    slave = known.slaves.get(finding.slave) if finding.baudrate == known.baudrate else None
    fields = [f"id: {finding.slave}"]
    if slave is not None and slave.name != f"slave-{finding.slave}":
        fields.append(f"name: {slave.name}")
    if slave is not None and slave.label is not None:
        fields.append(f"label: {json.dumps(slave.label)}")
    profile = finding.profile
    if profile is not None and profile.name != DEFAULT_PROFILE:
        fields.append(f"profile: {_word(profile, asked)}")
    if profile is not None and options.framing is Framing.RTU and asked.checksum != profile.checksum:
        fields.append(f"checksum: {asked.checksum}")
    if slave is not None:
        fields.extend(_kept(slave, () if profile is None else profile.value_names))
    if options.timeout is not None:
        fields.append(f"response_timeout: {duration_text(options.timeout)}")
    elif slave is not None and slave.response_timeout is not None:
        fields.append(f"response_timeout: {duration_text(slave.response_timeout)}")
    return str(finding.slave) if len(fields) == 1 else f"{{{', '.join(fields)}}}"


def _kept(slave: SlaveConfig, values: Collection[str]) -> Iterator[str]:
    """Yield what is configured of a slave and holds for what was found there, which has these values."""
    if slave.interval != DEFAULT_INTERVAL:
        yield f"interval: {duration_text(slave.interval) if slave.interval else 0}"
    if slave.request_gap:
        yield f"request_gap: {duration_text(slave.request_gap)}"
    certificates = [
        f"{name}: {{scale: {entry.scale!r}, offset: {entry.offset!r}}}"
        for name, entry in slave.calibration.items()
        if name in values
    ]
    if certificates:
        yield f"calibration: {{{', '.join(certificates)}}}"


def _word(profile: Profile, asked: ScanRequest) -> str:
    """Return how a configuration names a profile: the built-in one's name, or the file in quotes."""
    file = asked.files.get(profile.name)
    return profile.name if file is None else json.dumps(file)  # JSON's text is YAML's too


def _obstacle(finding: FoundDevice, baudrate: int) -> str | None:
    """Return why a device cannot be polled as it is."""
    if finding.suspect:
        return "suspect"
    if finding.duplicate:
        return "give the two sensors different ids first"
    if finding.profile is None:
        return "needs a profile of its own"
    if finding.baudrate != baudrate:
        return f"answers at {finding.baudrate} baud; a line has one rate"
    return None


def plain(finding: FoundDevice, calibrated: Mapping[str, Value | None] = NOTHING) -> dict[str, Any]:
    """Return a finding for JSON; `calibrated` are its values of those that have a calibration."""
    profile = finding.profile
    return {
        "id": finding.slave,
        "baudrate": finding.baudrate,
        "answers": finding.answers,
        "rtt_ms": None if finding.rtt is None else round(finding.rtt * 1e3, 1),
        "profile": None if profile is None else profile.name,
        "title": None if profile is None else profile.title,
        "alternatives": [each.name for each in finding.alternatives],
        "values": dict(finding.values),
        "calibrated": dict(calibrated),
        "units": {} if profile is None else {name: profile.units[name] for name in finding.values},
        "id_register": finding.id_register,
        "exception_code": finding.exception if profile is None else None,
        "suspect": finding.suspect,
        "duplicate": finding.duplicate,
    }
