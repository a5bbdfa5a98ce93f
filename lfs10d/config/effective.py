"""The effective configuration: the file with the changes made by request, every value with its origin.

Every start, reload and request takes this one path. Nothing here refuses: a change that cannot hold beside the file
as it is (its profile cannot be read, its id is out of the profile's range) is `suspended`, kept and reported; two
devices never poll one id.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any, TypeAlias

from lfs10d.config.changes import Changes, FileValues, Place
from lfs10d.config.changes_file import in_words
from lfs10d.config.defaults import inherited
from lfs10d.config.loader import DEFAULT, LoadedConfig, Origin, leaves
from lfs10d.config.merge import DroppedChange, Merged, merge
from lfs10d.config.models import Config, SlaveConfig
from lfs10d.config.validation import contradictions
from lfs10d.errors import ConfigError
from lfs10d.profiles.library import load_profile
from lfs10d.profiles.profile import Profile
from lfs10d.schema.document import path_text
from lfs10d.system.dataclass import dataclass

CHANGED = Origin("changes.yaml")
"""Origin of a value that a request changed."""

_STANDARD = SlaveConfig(id=1)


@dataclass(frozen=True, slots=True)
class Effective:
    """The effective configuration with its origins and conflicts.

    `file` is the file alone, `loaded` the same with the changes in its `config`, `profiles` and `origins`. `changes`
    are those left, `dropped` those a person overruled. `places` tells for each device where to look for it: one
    place, or, where the file and what was last verified differ, the file's first and then that; the line is to be
    asked before its first good sample. `conflicts` are devices that must not be polled, for another one was verified
    at their id, and why; `suspended` the devices of which not every change can hold, and why.
    """

    file: LoadedConfig
    loaded: LoadedConfig
    file_values: FileValues
    changes: Changes
    dropped: tuple[DroppedChange, ...]
    places: Mapping[str, tuple[Place, ...]]
    conflicts: Mapping[str, str]
    suspended: Mapping[str, str]

    @property
    def config(self) -> Config:
        """The effective configuration."""
        return self.loaded.config

    @property
    def polled(self) -> Config:
        """The configuration for the line: without devices that have a conflict."""
        slaves = tuple(slave for slave in self.config.slaves if slave.name not in self.conflicts)
        return self.config.model_copy(update={"slaves": slaves})

    def slave(self, name: str) -> SlaveConfig | None:
        """Return the device with this name, None if there is none."""
        return next((slave for slave in self.config.slaves if slave.name == name), None)


def file_values_of(file: LoadedConfig) -> FileValues:
    """Return the values of the file itself, by key."""
    config, document = file.config, file.document
    slaves: dict[str, dict[str, Any]] = {}
    for index, slave in enumerate(config.slaves):
        keys = (key for key in SlaveConfig.model_fields if document.holds(("slaves", index, key)) and key != "name")
        slaves[slave.name] = {"id": slave.id, **{key: getattr(slave, key) for key in keys}}
    usual = {key: getattr(_STANDARD, key) for key in ("enabled", "label", "profile", "checksum")}
    usual |= {key: getattr(config.poll, key) for key in ("interval", "response_timeout")}
    return FileValues(slaves, config.line.baudrate, usual)


def effective(file: LoadedConfig, changes: Changes) -> Effective:
    """Return the effective configuration of a valid file and the changes."""
    file_values = file_values_of(file)
    merged = merge(file_values, changes)
    builder = _Builder(file, merged)
    config = file.config.model_copy(
        update={
            "line": file.config.line.model_copy(update={"baudrate": merged.baudrate}),
            "slaves": builder.slaves(),
        }
    )
    places = {
        slave.name: merged.contested.get(slave.name, (Place(slave.id, merged.baudrate),)) for slave in config.slaves
    }
    return Effective(
        file=file,
        loaded=replace(file, config=config, profiles=builder.profiles, origins=_origins(file, config, merged)),
        file_values=file_values,
        changes=merged.changes,
        dropped=merged.dropped,
        places=places,
        conflicts=_conflicts(config, file_values, merged.changes),
        suspended=builder.suspended,
    )


class _Builder:
    """Builds the models of the merged values; a change that cannot hold is left out."""

    def __init__(self, file: LoadedConfig, merged: Merged) -> None:
        self._file = file
        self._merged = merged
        self._filed = {slave.name: slave for slave in file.config.slaves}
        self.profiles: dict[str, Profile] = dict(file.profiles)
        self.suspended: dict[str, str] = {}

    def slaves(self) -> tuple[SlaveConfig, ...]:
        built = (self._slave(name, values) for name, values in self._merged.devices.items())
        return tuple(slave for slave in built if slave is not None)

    def _slave(self, name: str, values: Mapping[str, Any]) -> SlaveConfig | None:
        changed = self._merged.changed[name]
        if self._merged.changes.of(name).added is not None:
            added = inherited(SlaveConfig.model_validate({"name": name, **in_words(values)}), self._file.config.poll)
            return added if self._can_hold(added) else None
        filed = self._filed[name]
        slave = filed.model_copy(update={key: values[key] for key in changed})
        if not changed or self._can_hold(slave):
            return slave
        # A fact stays one, whatever becomes of the wishes.
        return filed.model_copy(update={"id": values["id"]})

    def _can_hold(self, slave: SlaveConfig) -> bool:
        why = self._why_not(slave)
        if why is not None:
            self.suspended[slave.name] = why
        return why is None

    def _why_not(self, slave: SlaveConfig) -> str | None:
        """Return why a change cannot hold; None if it can."""
        try:
            if slave.profile not in self.profiles:
                folder = self._file.path.parent.absolute()
                self.profiles[slave.profile] = load_profile(slave.profile, relative_to=folder)
        except ConfigError as error:
            return str(error.problems[0])
        alone = self._file.config.model_copy(update={"slaves": (slave,)})
        found = next(contradictions(alone, self.profiles), None)
        return None if found is None else f"{found.path[-1]}: {found.message}"


def _conflicts(config: Config, file_values: FileValues, changes: Changes) -> dict[str, str]:
    """Return the devices that must give way where two have one id: the last verified one keeps it, else the file's."""
    holders: dict[int, str] = {}
    yielding: dict[str, str] = {}

    def rank(slave: SlaveConfig) -> tuple[bool, bool]:
        proven = changes.of(slave.name).proven
        return proven is None or proven.id != slave.id, slave.name not in file_values.slaves

    for slave in sorted(config.slaves, key=rank):
        holder = holders.setdefault(slave.id, slave.name)
        if holder != slave.name:
            yielding[slave.name] = f"slave id {slave.id} is taken by {holder}; change the id of one, or remove one"
    return yielding


def _origins(file: LoadedConfig, config: Config, merged: Merged) -> dict[str, Origin]:
    """Return the origins of all values; slaves of the file are found by their names."""
    places = {slave.name: index for index, slave in enumerate(file.config.slaves)}
    origins: dict[str, Origin] = {}
    for path, _ in leaves(config):
        key = path_text(path)
        if path[0] != "slaves" or len(path) == 1:
            origins[key] = file.origins.get(key, DEFAULT)
            continue
        slave = config.slaves[int(path[1])]
        filed = places.get(slave.name)
        added = merged.changes.of(slave.name).added is not None
        if path[-1] in merged.changed[slave.name] or (added and path[-1] == "name"):
            origins[key] = CHANGED
        elif added or filed is None:
            origins[key] = _inherited_origin(file, str(path[-1]))
        else:
            origins[key] = file.origins[path_text(("slaves", filed, path[-1]))]
    if merged.baudrate != file.config.line.baudrate:
        origins["line.baudrate"] = CHANGED
    return origins


def _inherited_origin(file: LoadedConfig, key: str) -> Origin:
    """Return the origin of a value that a device inherits."""
    if key not in {"interval", "response_timeout"}:
        return DEFAULT
    origin = file.origins[f"poll.{key}"]
    return origin if origin.kind == "default" else replace(origin, place=f"{origin.place} (poll.{key})")


def merged_data(now: Effective) -> Any:  # noqa: ANN401  # YAML
    """Return the data of a file that expresses the effective configuration without any change.

    What the file says itself is left in its own words.
    """
    data: Any = now.file.document.data
    if not now.changes.count:
        return data
    raw = dict(zip((slave.name for slave in now.file.config.slaves), data.get("slaves", ()), strict=True))
    merged = merge(now.file_values, now.changes)
    slaves: list[Any] = []
    for name, values in merged.devices.items():
        change = now.changes.of(name)
        if change.added is not None:
            if name in now.suspended:
                continue
            slaves.append(_named(name, in_words(values)))
        elif not merged.changed[name] or name in now.suspended:
            slaves.append(raw[name])
        else:
            entry = raw[name] if isinstance(raw[name], dict) else {"id": raw[name]}
            slaves.append(_named(name, {**entry, **in_words({key: values[key] for key in merged.changed[name]})}))
    line = data["line"]
    if merged.baudrate != now.file_values.baudrate:
        line = {**line, "baudrate": merged.baudrate}
    return {**data, "line": line, "slaves": slaves}


def _named(name: str, entry: dict[str, Any]) -> dict[str, Any]:
    """Return an entry with its name after its id, if the default would be another."""
    if name == f"slave-{entry['id']}" or "name" in entry:
        return entry
    return {"id": entry["id"], "name": name, **entry}


Edit: TypeAlias = "Callable[[Effective], Changes]"
"""Returns the changes after a request. Called in a thread of its own; raises what refuses the request."""
