"""`changes.yaml` in the state directory: readable YAML, replaced as a whole at each change.

A file that cannot be understood (damaged, foreign, of a newer lfs10d) is put aside and reported, and nothing is
changed by it. One that cannot be read at all stays where it is, and nothing is written in its place.
"""

from __future__ import annotations

import contextlib
from pathlib import Path
from typing import Annotated, Any

from pydantic import BeforeValidator, Field, ValidationError

from lfs10d.config.changes import OPTIONS, Changes, DeviceChange, Place, Rate, Values, Verified
from lfs10d.config.credentials import reason
from lfs10d.config.models import SlaveConfig, SlaveId
from lfs10d.config.sections import Section
from lfs10d.errors import ConfigError, StateError
from lfs10d.schema.document import LARGEST_FILE, decode, parse
from lfs10d.schema.fields import Choice, Name, Whole, plain_error
from lfs10d.schema.quantities import BAUDRATES, duration_text
from lfs10d.schema.yaml12 import render
from lfs10d.system.dataclass import dataclass
from lfs10d.system.disk import Disk

FILE_NAME = "changes.yaml"
VERSION = 1
"""Version of the format below."""
ASIDE = "changes.yaml.unreadable"
"""New name of a file that cannot be read; only the last one is kept."""
MODE = 0o640
"""Mode of the file: readable like the state directory."""

HEADING = """\
# Changes made by request to the configuration file, and the file's values then. Written by lfs10d.
# A change holds until the same key of the file is edited. `lfs10d config --merged` prints both as one file,
# the request config/reset takes a change back.
"""


@dataclass(frozen=True, slots=True)
class FoundChanges:
    """The content of the file; `missing` if there is none, `trouble` in words if it cannot be used."""

    changes: Changes
    missing: bool = False
    trouble: str | None = None


class ChangesFile:
    """The file in one state directory."""

    def __init__(self, directory: Path, disk: Disk) -> None:
        self.path = directory / FILE_NAME
        self._disk = disk
        self._unread: str | None = None

    def read(self) -> FoundChanges:
        """Read the file and leave it as it is; raises StateError if it exists and cannot be read."""
        content = self._content()
        if content is None:
            return FoundChanges(Changes(), missing=True)
        try:
            return FoundChanges(understood(content, str(self.path)))
        except ConfigError as error:
            return FoundChanges(Changes(), trouble=str(error.problems[0]))

    def _content(self) -> bytes | None:
        try:
            return self._disk.read(self.path)
        except FileNotFoundError:
            return None
        except OSError as error:
            raise StateError(f"{self.path} cannot be read: {reason(error)}") from None

    def take(self) -> FoundChanges:
        """Read the file for the daemon: one that cannot be read is put aside. Never fails."""
        try:
            found = self.read()
        except StateError as error:
            self._unread = str(error)
            return FoundChanges(Changes(), trouble=f"{error}; the changes made by request are not known")
        if found.trouble is None:
            return found
        aside = self.path.with_name(ASIDE)
        with contextlib.suppress(OSError):
            self._disk.put_aside(self.path, aside)
            return FoundChanges(
                Changes(), trouble=f"{found.trouble}; the file is now {aside}, and its changes do not hold"
            )
        self._unread = found.trouble
        return found

    def save(self, changes: Changes) -> None:
        """Save these changes to the disk; raises StateError and leaves the file as it was."""
        if self._unread is not None:
            raise StateError(self._unread)
        content = written(changes)
        if len(content) > LARGEST_FILE:
            raise StateError(
                f"{self.path} would be too large; move changes into the configuration file (lfs10d config --merged)"
            )
        before = self._content()
        try:
            self._disk.replace(self.path, content, mode=MODE)
        except OSError as error:
            self._restore(before, content)
            raise StateError(f"{self.path} cannot be written: {reason(error)}") from None

    def _restore(self, before: bytes | None, content: bytes) -> None:
        """Take back a write that may not have been synced."""
        with contextlib.suppress(OSError, StateError):
            if self._content() == content != before:
                if before is None:
                    self._disk.remove(self.path)
                else:
                    self._disk.replace(self.path, before, mode=MODE)


# -- the form

_Baudrate = Annotated[int, Choice(BAUDRATES)]


def _device_values(value: object, *, keys: tuple[str, ...], whole: bool) -> Values:
    """Return the values of a device from the keys of the configuration."""
    if not isinstance(value, dict) or not set(value) <= set(keys) or ("id" in value) is not whole:
        raise plain_error(f"must be a mapping of {', '.join(keys)}" + (" with an id" if whole else ""))
    slave = SlaveConfig.model_validate({"id": 1, **value})
    return {key: getattr(slave, key) for key in value}


_ENTRY = tuple(key for key in SlaveConfig.model_fields if key != "name")
_Entry = Annotated[dict[str, Any], BeforeValidator(lambda value: _device_values(value, keys=_ENTRY, whole=True))]
_Options = Annotated[dict[str, Any], BeforeValidator(lambda value: _device_values(value, keys=OPTIONS, whole=False))]


class _Place(Section):
    id: SlaveId
    baudrate: _Baudrate | None = None

    def place(self) -> Place:
        return Place(self.id, self.baudrate)


class _Verified(_Place):
    file: SlaveId | None = None


class _Device(Section):
    removed: _Entry | None = None
    added: _Entry | None = None
    added_at: _Place | None = None
    options: _Options = Field(default_factory=dict)
    instead_of: _Options = Field(default_factory=dict)
    verified: _Verified | None = None

    def change(self) -> DeviceChange:
        return DeviceChange(
            removed=self.removed,
            added=self.added,
            added_at=None if self.added_at is None else self.added_at.place(),
            options=self.options,
            instead_of=self.instead_of,
            verified=None if self.verified is None else Verified(self.verified.place(), self.verified.file),
        )


class _Rate(Section):
    file: _Baudrate
    now: _Baudrate


class _Line(Section):
    baudrate: _Rate | None = None


class _ChangesContent(Section):
    version: Annotated[int, Whole(VERSION, VERSION)]
    line: _Line = _Line()
    devices: dict[Annotated[str, Name()], _Device] = Field(default_factory=dict)


def understood(content: bytes, file: str) -> Changes:
    """Return the changes in a file's content; raises ConfigError for any other content."""
    document = parse(decode(content, file), file)
    if document.problems:
        raise ConfigError(document.problems)
    version = document.data.get("version") if isinstance(document.data, dict) else None
    if isinstance(version, int) and version > VERSION:
        raise ConfigError((document.problem(("version",), f"is {version}: a newer lfs10d wrote this file"),))
    try:
        known = _ChangesContent.model_validate(document.data)
    except ValidationError as error:
        raise ConfigError(document.problems_of(error)) from None
    rate = known.line.baudrate
    return Changes(
        devices={name: device.change() for name, device in known.devices.items()},
        baudrate=None if rate is None else Rate(rate.file, rate.now),
    )


def written(changes: Changes) -> bytes:
    """Return the file's content for these changes."""
    data: dict[str, Any] = {"version": VERSION}
    if changes.baudrate is not None:
        data["line"] = {"baudrate": {"file": changes.baudrate.file, "now": changes.baudrate.now}}
    data["devices"] = {name: _device(change) for name, change in changes.devices.items()}
    return (HEADING + render(data)).encode()


def _device(change: DeviceChange) -> dict[str, Any]:
    data: dict[str, Any] = {}
    for key in ("removed", "added", "options", "instead_of"):
        values = getattr(change, key)
        if values:
            data[key] = in_words(values)
    if change.added_at is not None:
        data["added_at"] = _place(change.added_at)
    if change.verified is not None:
        data["verified"] = _place(change.verified.place)
        if change.verified.file is not None:
            data["verified"]["file"] = change.verified.file
    return data


def _place(place: Place) -> dict[str, int]:
    return {"id": place.id} if place.baudrate is None else {"id": place.id, "baudrate": place.baudrate}


def in_words(values: Values) -> dict[str, Any]:
    """Return the values of a device as written in the file: durations with their unit, auto for None."""
    return {key: _word(key, value) for key, value in values.items()}


def _word(key: str, value: object) -> object:
    if key == "response_timeout" and value is None:
        return "auto"
    if key == "calibration" and isinstance(value, dict):
        return {name: entry.model_dump(exclude_unset=True) for name, entry in value.items()}
    if isinstance(value, float):
        return duration_text(value) if value else 0
    return value
