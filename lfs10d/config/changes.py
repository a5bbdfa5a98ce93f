"""The changes made by request, each with the value that the file had then. Pure.

How the changes and the file as it is now are merged is in `lfs10d.config.merge`. The values of a device are a
mapping of keys of `SlaveConfig`, without its name, to values as the program uses them.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import field, replace
from typing import Any, TypeAlias

from lfs10d.system.dataclass import dataclass

OPTIONS = ("interval", "enabled", "label", "response_timeout")
"""Keys of a device that a request may change, in the order of the file."""

Values: TypeAlias = Mapping[str, Any]


@dataclass(frozen=True, slots=True)
class FileValues:
    """The values of the file: each slave by its name, in order; `usual` are the defaults of absent keys."""

    slaves: Mapping[str, Values]
    baudrate: int = 9600
    usual: Values = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Rate:
    """The line's rate: `now` was verified, `file` is the value of the file then."""

    file: int
    now: int


@dataclass(frozen=True, slots=True)
class Place:
    """Where a device answers: its slave id and its rate (None: the line's)."""

    id: int
    baudrate: int | None = None


@dataclass(frozen=True, slots=True)
class Verified:
    """The place where a device was last verified; `file` is its id in the file then, None if it was not there."""

    place: Place
    file: int | None = None


@dataclass(frozen=True, slots=True)
class DeviceChange:
    """What was changed of one name.

    `removed` are the file's values of a device that is polled no more, `added` the values of one that a request
    added (after the removal, if both are there), and `added_at` where that one answered. `options` hold of a device
    of the file, which had the values `instead_of` for these keys; a key missing there was not in the file. `verified`
    is of the device of the file, removed or not.
    """

    removed: Values | None = None
    added: Values | None = None
    added_at: Place | None = None
    options: Values = field(default_factory=dict)
    instead_of: Values = field(default_factory=dict)
    verified: Verified | None = None

    def __bool__(self) -> bool:
        return bool(self.count)

    @property
    def count(self) -> int:
        """The number of changes."""
        wholes = (self.removed, self.added, self.verified)
        return sum(whole is not None for whole in wholes) + len(self.options)

    @property
    def proven(self) -> Place | None:
        """The place where the present device was last verified, None if it never was."""
        if self.added is not None:
            return self.added_at
        return None if self.verified is None else self.verified.place


@dataclass(frozen=True, slots=True)
class Changes:
    """All changes made by request; `baudrate` is the line's."""

    devices: Mapping[str, DeviceChange] = field(default_factory=dict)
    baudrate: Rate | None = None

    @property
    def count(self) -> int:
        """The number of changes."""
        return sum(change.count for change in self.devices.values()) + (self.baudrate is not None)

    def of(self, name: str) -> DeviceChange:
        """Return the changes of a device, which may be none."""
        return self.devices.get(name, DeviceChange())

    def with_device(self, name: str, change: DeviceChange) -> Changes:
        """Return the changes with another change of this device; one without effect is left out."""
        devices = {**self.devices, name: change}
        return replace(self, devices={key: value for key, value in devices.items() if value})

    # -- what requests do

    def adding(self, name: str, entry: Values, verified: Place | None = None) -> Changes:
        """Return the changes with one more device, whose name is free."""
        return self.with_device(name, replace(self.of(name), added=entry, added_at=verified))

    def removing(self, name: str, file_values: FileValues) -> Changes:
        """Return the changes that remove this device, be it the file's or one that was added."""
        return self.with_device(
            name, DeviceChange(removed=file_values.slaves.get(name), verified=self.of(name).verified)
        )

    def moving(self, name: str, place: Place, file_values: FileValues) -> Changes:
        """Return the changes with another verified place for a present device."""
        change = self.of(name)
        if change.added is not None:
            moved = replace(change, added={**change.added, "id": place.id}, added_at=place)
            return self.with_device(name, moved)
        filed = file_values.slaves[name]["id"]
        verified = None if place == Place(filed) else Verified(place, file=filed)
        return self.with_device(name, replace(change, verified=verified))

    def setting(self, name: str, options: Values, file_values: FileValues) -> Changes:
        """Return the changes with other options of a present device.

        An option that is set to what the file gives anyway is no change any more.
        """
        change = self.of(name)
        if change.added is not None:
            return self.with_device(name, replace(change, added={**change.added, **options}))
        entry = file_values.slaves[name]
        wanted = {**change.options, **options}
        wanted = {key: value for key, value in wanted.items() if value != value_of(entry, key, file_values)}
        base = {key: entry[key] for key in wanted if key in entry}
        return self.with_device(name, replace(change, options=wanted, instead_of=base))

    def resetting(self, name: str, keys: frozenset[str] | None = None) -> Changes:
        """Return the changes without those of a device's options, or of these `keys` only; verified places stay.

        Without `keys` a device that was added goes and one that was removed comes back.
        """
        change = self.of(name)
        if keys is None:
            return self.with_device(name, DeviceChange(verified=change.verified))
        options = {key: value for key, value in change.options.items() if key not in keys}
        base = {key: value for key, value in change.instead_of.items() if key not in keys}
        return self.with_device(name, replace(change, options=options, instead_of=base))


def keys(changes: Changes) -> Iterator[str]:
    """Yield the changed keys, as in `lfs10d.config.diff`."""
    if changes.baudrate is not None:
        yield "line.baudrate"
    for name, change in changes.devices.items():
        if change.removed is not None or change.added is not None:
            yield f"slaves.{name}"
        yield from (f"slaves.{name}.{key}" for key in change.options)
        if change.verified is not None:
            yield f"slaves.{name}.id"


def value_of(entry: Values, key: str, file_values: FileValues) -> Any:  # noqa: ANN401  # any value of the configuration
    """Return what the file gives for a key of a slave, its default where it is absent."""
    return entry.get(key, file_values.usual.get(key))
