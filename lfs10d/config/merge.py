"""The three-way merge of the file, the file's values when a request changed something, and that change. Pure.

Rules
-----
1. A change holds as long as the file still has the value that it had when the change was made (`instead_of`,
   `removed`, `file`). An absent key counts as a value: writing the default into the file afterwards is an edit and
   wins. Keys are compared one by one, as values; devices go by their names.
2. Once a person edits such a key the file wins and the change is dropped; silently where both now say the same.
3. A slave id or a baud rate is a fact, not a wish: where the file was edited to another one than was last verified,
   neither has won before the line was asked. The file's place is then tried first, and the change is kept.
4. A device that a request added, and that the file now has too, is one of the file; its options stay changes.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, TypeAlias

from lfs10d.config.changes import OPTIONS, Changes, DeviceChange, FileValues, Place, Rate, Values, Verified, value_of
from lfs10d.system.dataclass import dataclass

_NOTHING: Values = {}
_UNSAID = object()


@dataclass(frozen=True, slots=True)
class DroppedChange:
    """A change that no longer holds, since the file was edited: the value `lost`, and the reason.

    `key` is as in `lfs10d.config.diff`: `slaves.mast-top.interval`, or `slaves.mast-top` for all of it. The file of
    changes that could not be understood is one without a device.
    """

    key: str
    device: str | None
    lost: Any
    message: str


@dataclass(frozen=True, slots=True)
class Merged:
    """The result: `devices` by name, in order, with their values; `changed` are the keys set by changes.

    `changes` are those left, `dropped` those a person should know of. `contested` are the places where the file and
    what was verified differ: the file's first. `baudrate` is the line's.
    """

    devices: Mapping[str, Values]
    changed: Mapping[str, frozenset[str]]
    baudrate: int
    changes: Changes
    dropped: tuple[DroppedChange, ...]
    contested: Mapping[str, tuple[Place, ...]]


def merge(file_values: FileValues, changes: Changes) -> Merged:
    """Merge the file and the changes by the rules above."""
    names = [*file_values.slaves, *(name for name in changes.devices if name not in file_values.slaves)]
    devices: dict[str, Values] = {}
    changed: dict[str, frozenset[str]] = {}
    left: dict[str, DeviceChange] = {}
    dropped: list[DroppedChange] = []
    contested: dict[str, tuple[Place, ...]] = {}
    rate, baudrate, rates = _merge_rate(file_values, changes.baudrate)
    for name in names:
        change, lost = _settle(name, file_values, changes.of(name))
        dropped += lost
        if change:
            left[name] = change
        entry, keys = _entry(file_values.slaves.get(name), change)
        if entry is None:
            continue
        devices[name], changed[name] = entry, keys
        places = _places(entry["id"], change, rates)
        if len(places) > 1:
            contested[name] = places
    return Merged(devices, changed, baudrate, Changes(left, rate), tuple(dropped), contested)


def _merge_rate(file_values: FileValues, rate: Rate | None) -> tuple[Rate | None, int, tuple[int, ...]]:
    """Return the remaining change, the rate to begin with, and all possible rates."""
    if rate is None or file_values.baudrate == rate.now:
        return None, file_values.baudrate, (file_values.baudrate,)
    if file_values.baudrate == rate.file:
        return rate, rate.now, (rate.now,)
    return rate, file_values.baudrate, (file_values.baudrate, rate.now)


def _places(slave: int, change: DeviceChange, rates: tuple[int, ...]) -> tuple[Place, ...]:
    """Return the possible places of a device: the expected one first, then the last verified one."""
    proven = change.proven
    if proven is None:
        return tuple(Place(slave, rate) for rate in rates)
    last = Place(proven.id, proven.baudrate or rates[-1])
    if slave == last.id and len(rates) == 1:
        return (last,)
    first = Place(slave, rates[0])
    return (first,) if first == last else (first, last)


def _entry(entry: Values | None, change: DeviceChange) -> tuple[Values | None, frozenset[str]]:
    """Return the values of a device (None: no device), and which keys come from changes."""
    if change.added is not None:
        return change.added, frozenset(change.added)
    if change.removed is not None or entry is None:
        return None, frozenset()
    facts = {}
    if change.verified is not None and change.verified.file == entry["id"]:
        facts["id"] = change.verified.place.id
    return {**entry, **change.options, **facts}, frozenset({*change.options, *facts})


# -- one device, three ways

_Settled: TypeAlias = tuple[DeviceChange, list[DroppedChange]]
"""The remaining changes of one device, and the dropped ones to report."""


def _settle(name: str, file_values: FileValues, change: DeviceChange) -> _Settled:
    """Return the remaining changes of one device, and the dropped ones to report."""
    entry = file_values.slaves.get(name)
    if change.removed is not None:
        if entry == change.removed:
            return change, []
        if entry is not None:
            return _unremoved(name, entry, file_values, change)
        change = replace(change, removed=None, verified=None)
    if change.added is not None:
        return (change, []) if entry is None else _adopted(name, entry, file_values, change)
    if entry is None:
        what = {**change.options, **({} if change.verified is None else {"id": change.verified.place.id})}
        gone = "the device is no longer in the file"
        return DeviceChange(), [_dropped(name, key, value, gone) for key, value in what.items()]
    return _kept(name, entry, file_values, change)


def _unremoved(name: str, entry: Values, file_values: FileValues, change: DeviceChange) -> _Settled:
    """Undo the removal of a device by request if its entry in the file was edited."""
    kept, lost = _kept(name, entry, file_values, DeviceChange(verified=change.verified))
    if entry != change.added:
        what = {"removed": True} if change.added is None else dict(change.added)
        lost.append(DroppedChange(f"slaves.{name}", name, what, "the file's entry of this device was edited"))
    return kept, lost


def _adopted(name: str, entry: Values, file_values: FileValues, change: DeviceChange) -> _Settled:
    """Treat a device that was added by request as one of the file, if it was put there (rule 4)."""
    added = change.added or _NOTHING
    options = {key: added[key] for key in OPTIONS if key in added}
    proof = None if change.added_at is None else Verified(change.added_at)
    kept, lost = _kept(name, entry, file_values, DeviceChange(options=options, verified=proof))
    for key in ("id", "profile", "checksum"):
        if key in added and added[key] != value_of(entry, key, file_values) and not (key == "id" and proof):
            lost.append(_dropped(name, key, added[key], _says(entry, key)))
    return kept, lost


def _kept(name: str, entry: Values, file_values: FileValues, change: DeviceChange) -> _Settled:
    """Compare the changes of a device of the file, key by key."""
    options: dict[str, Any] = {}
    lost: list[DroppedChange] = []
    for key, value in change.options.items():
        if entry.get(key, _UNSAID) == change.instead_of.get(key, _UNSAID):
            options[key] = value
        elif value_of(entry, key, file_values) != value:
            lost.append(_dropped(name, key, value, _says(entry, key)))
    verified = change.verified
    if verified is not None and entry["id"] == verified.place.id and verified.file != entry["id"]:
        # The file names the id that was verified; the rate it was verified at is the line's, or still a fact.
        verified = (
            None if verified.place.baudrate in (None, file_values.baudrate) else replace(verified, file=entry["id"])
        )
    base = {key: change.instead_of[key] for key in options if key in change.instead_of}
    return replace(change, options=options, instead_of=base, verified=verified), lost


def _says(entry: Values, key: str) -> str:
    return "the file has another value now" if key in entry else "the device was removed from the file"


def _dropped(name: str, key: str, lost: object, message: str) -> DroppedChange:
    return DroppedChange(f"slaves.{name}.{key}", name, lost, message)
