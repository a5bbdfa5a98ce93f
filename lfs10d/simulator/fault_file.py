"""The faults file in YAML: the faults of each sensor and of the line; errors have a line and column.

::

    line:
      echo: true                                  # the adapter returns the master's own bytes
      latency: 16ms                               # it delivers in pieces
      babble: [{after: 20s, for: 2s}]
      noise: [{rate: 0.02, bytes: 3, delay: 1ms}] # stray bytes after that share of the requests
      second_master: [{slave: 1, every: 3s}]
    all: [{fault: noisy, rate: 0.01}]             # of every sensor
    slaves:
      3: silent
      4: [nan, {fault: late, delay: 700ms, rate: 0.05}]
      5: {turnaround: 20ms, baudrate: 19200, copies: 2, faults: [{fault: silent, after: 10s, for: 5s}]}

The kinds of faults are those of `lfs10d.simulator.faults.FaultKind`.
"""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path
from typing import Annotated, Literal, TypeAlias

from pydantic import BeforeValidator, Field, ValidationError, model_validator

from lfs10d.errors import ConfigError, Problem
from lfs10d.profiles.facts import Facts
from lfs10d.profiles.library import load_profile
from lfs10d.profiles.profile import Profile
from lfs10d.schema.document import Document, decode, parse
from lfs10d.schema.fields import Choice, Duration, Flag, Text, Whole
from lfs10d.schema.quantities import BAUDRATES
from lfs10d.simulator.faults import DEFAULT_DELAYS, FaultKind, SensorFault, window
from lfs10d.simulator.wire import nanoseconds

DAY = 86400
MOST_COPIES = 8
LONGEST_NOISE = 256

Time: TypeAlias = Annotated[float, Duration(0, DAY)]
Share: TypeAlias = Annotated[float, Field(ge=0, le=1)]
Length: TypeAlias = Annotated[int, Whole(1, LONGEST_NOISE)]


class WindowEntry(Facts):
    """A window of time; without keys always."""

    after: Time = Field(0.0, description="When it begins, after the simulator's start.")
    lasts: Time | None = Field(None, alias="for", description="How long it lasts; without it, for ever.")
    every: Time | None = Field(None, description="How long from one beginning to the next.")

    @model_validator(mode="after")
    def _repeats_what_ends(self) -> WindowEntry:
        if self.every is not None and (self.lasts is None or not 0 < self.lasts < self.every):
            raise ValueError("`every` repeats what ends: give `for`, shorter than `every`")
        return self

    @property
    def last(self) -> float | None:
        """When it ends first (s)."""
        return None if self.lasts is None else self.after + self.lasts


class FaultEntry(WindowEntry):
    """One fault of a sensor."""

    fault: Annotated[str, Choice(tuple(kind.value for kind in FaultKind))] = Field(description="Kind of fault.")
    rate: Share = Field(1.0, description="Share of its answers that have the fault.")
    delay: Time | None = Field(
        None, description="For late, slow_bytes, slow_flash, needs_rest, sleeps, twin, repeated and gateway."
    )
    code: Annotated[int, Whole(1, 255)] | None = Field(None, description="For exception, dip_locked and gateway.")
    value: Annotated[int, Whole(0, 255)] | None = Field(None, alias="id", description="For wrong_id.")
    length: Length | None = Field(
        None, alias="bytes", description="For garbage, truncated, leading_noise and trailing_noise."
    )
    answer: Literal["echo", "exception"] = Field("echo", description="For dip_locked: how it answers a write.")
    reads: Literal["old", "new"] = Field("old", description="For dip_locked: what its id register holds then.")
    values: Annotated[tuple[str, ...], Field(strict=False)] = Field(
        (), description="Which values of its profile: for unavailable, absent, stuck, nan and the like; none means all."
    )

    @property
    def sensor_fault(self) -> SensorFault:
        """The fault as the simulator plays it."""
        kind = FaultKind(self.fault)
        delay = DEFAULT_DELAYS.get(kind, 0.0) if self.delay is None else self.delay
        particulars = self.model_dump(include={"code", "value", "length", "answer", "reads", "values"})
        when = window(self.after, self.last, self.every)
        return SensorFault(kind, self.rate, when, nanoseconds(delay), **particulars)


def _named(item: object) -> object:
    return {"fault": item} if isinstance(item, str) else item


Faults: TypeAlias = Annotated[
    tuple[Annotated[FaultEntry, BeforeValidator(_named)], ...],
    BeforeValidator(lambda item: (item,) if isinstance(item, str | dict) else item),
    Field(strict=False),
]


class SlaveEntry(Facts):
    """The faults of one sensor, and its own settings."""

    profile: Annotated[str, Text(4096)] | None = Field(
        None, description="Its profile: a name, or a file relative to this one."
    )
    faults: Faults = Field((), description="Its faults.")
    turnaround: Time | None = Field(
        None, description="Time from the last bit of a request to the first bit of its answer."
    )
    jitter: Time | None = Field(None, description="Longest random time added to that.")
    baudrate: Annotated[int, Choice(BAUDRATES)] | None = Field(None, description="Its rate, if not the line's.")
    copies: Annotated[int, Whole(1, MOST_COPIES)] = Field(1, description="Number of sensors with this id.")


def _slave(item: object) -> object:
    if isinstance(item, dict) and "fault" not in item:
        return item
    return {"faults": item}


class NoiseEntry(WindowEntry):
    """Stray bytes after requests."""

    rate: Share = Field(1.0, description="Share of requests that are followed by noise.")
    bytes: Length = Field(3, description="Number of bytes.")
    delay: Time = Field(0.001, description="Time after the request.")


class SecondMasterEntry(Facts):
    """Another master that does not listen before it speaks."""

    slave: Annotated[int, Whole(0, 255)] = Field(description="Slave id that it reads.")
    every: Annotated[float, Duration(0.01, DAY)] = Field(description="Time between two requests.")
    after: Time = Field(0.0, description="Time of its first request.")


class LineEntry(Facts):
    """The faults of the whole line."""

    echo: Annotated[bool, Flag()] = Field(default=False, description="The adapter returns the bytes of the master.")
    latency: Annotated[float, Duration(0, 1)] = Field(0.0, description="Interval at which the adapter delivers bytes.")
    babble: Annotated[tuple[WindowEntry, ...], Field(strict=False)] = Field(
        (), description="Times of bytes without a pause."
    )
    noise: Annotated[tuple[NoiseEntry, ...], Field(strict=False)] = Field((), description="Stray bytes after requests.")
    second_master: Annotated[tuple[SecondMasterEntry, ...], Field(strict=False)] = Field(
        (), description="Other masters on the line."
    )


class FaultFile(Facts):
    """The whole file."""

    line: LineEntry = Field(LineEntry(), description="Faults of the line.")
    all: Faults = Field((), description="Faults of every sensor.")
    slaves: dict[Annotated[int, Whole(1, 255)], Annotated[SlaveEntry, BeforeValidator(_slave)]] = Field(
        {}, description="Faults of single sensors, by slave id."
    )


def parse_faults(text: str, file: str, slaves: Collection[int]) -> FaultFile:
    """Read faults of sensors with these ids; raises ConfigError with every problem and its place."""
    document = parse(text, file)
    problems: tuple[Problem, ...] = document.problems
    faults = FaultFile()
    try:
        faults = FaultFile.model_validate(document.data)
    except ValidationError as error:
        problems += document.problems_of(error, FaultFile)
    if not problems:
        problems += _unknown(faults, document)
    problems += tuple(
        document.problem(("slaves", slave), "is not on this line; see --slaves", key=True)
        for slave in faults.slaves
        if slave not in slaves
    )
    if problems:
        raise ConfigError(tuple(sorted(problems)))
    return faults


def profiles_of(faults: FaultFile, folder: Path) -> dict[int, Profile]:
    """Return the profiles of slaves that have one of their own; raises ConfigError for one that cannot be read."""
    entries = faults.slaves.items()
    return {slave: load_profile(entry.profile, relative_to=folder) for slave, entry in entries if entry.profile}


def _unknown(faults: FaultFile, document: Document) -> tuple[Problem, ...]:
    """Return profiles that cannot be read, and names of values that their profiles do not have."""
    problems: list[Problem] = []
    for slave, entry in faults.slaves.items():
        if entry.profile is None:
            continue
        try:
            profile = load_profile(entry.profile, relative_to=Path(document.file).parent)
        except ConfigError as error:
            first = error.problems[0]
            place = "" if first.line == first.column == 1 else f"{first.file}:{first.line}:{first.column}: "
            problems.append(document.problem(("slaves", slave, "profile"), f"{place}{first.message}"))
            continue
        known = ", ".join(profile.value_names)
        problems += [
            document.problem(("slaves", slave, "faults"), f"{name} is no value of {profile.name}; it has {known}")
            for fault in entry.faults
            for name in fault.values
            if name not in profile.value_names
        ]
    return tuple(problems)


def load_faults(path: Path, slaves: Collection[int]) -> FaultFile:
    """Read a faults file; raises ConfigError, also if it cannot be read."""
    try:
        raw = path.read_bytes()
    except OSError as error:
        raise ConfigError((Problem(str(path), 1, 1, "", f"cannot be read: {error.strerror}"),)) from error
    return parse_faults(decode(raw, str(path)), str(path), slaves)
