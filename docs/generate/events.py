"""The events of topic `event`: each type with the moment it is published and its keys."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from docs.generate.markdown import example, plain, table
from lfs10d.telemetry.publication import EventType

PACKAGE: Final = Path(__file__).resolve().parents[2] / "lfs10d"
COMMON: Final = frozenset({"v", "type", "ts"})
"""Keys of every event."""


@dataclass(frozen=True, slots=True)
class EventPage:
    """What a reader needs to know of one type; `keys` holds type and meaning of each key beside the common ones."""

    when: str
    keys: Mapping[str, tuple[str, str]]
    example: Mapping[str, object]


_DEVICE = ("text", "name of the device")
_SLAVE = ("whole number", "slave id")
_PLACE = "object: slave, baudrate"

EVENTS: Final[Mapping[EventType, EventPage]] = {
    "device_added": EventPage(
        "A device is polled that was not before: by a request or a reload.",
        {"device": _DEVICE, "slave": _SLAVE},
        {"device": "vane", "slave": 7},
    ),
    "device_removed": EventPage(
        "A device is no longer polled: by a request or a reload. Its retained topics are cleared.",
        {"device": _DEVICE, "slave": _SLAVE},
        {"device": "vane", "slave": 7},
    ),
    "readdressed": EventPage(
        "A sensor has another slave id, and answers there.",
        {"device": _DEVICE, "from": ("whole number", "old slave id"), "to": ("whole number", "new slave id")},
        {"device": "slave-3", "from": 3, "to": 9},
    ),
    "baudrate_changed": EventPage(
        "The line has another baud rate, and every sensor that answers has it too.",
        {"from": ("whole number", "old rate"), "to": ("whole number", "new rate")},
        {"from": 9600, "to": 19200},
    ),
    "change_applied": EventPage(
        "A request changed something. The other keys depend on the request.",
        {
            "request": ("text", "name of the request"),
            "id": ("text or whole number or null", "of the request"),
            "device": ("text or null", "name of the device"),
            "from": ("anything", "before; `null`: it did not exist"),
            "to": ("anything", "after; `null`: it is gone"),
            "slave": ("whole number", "slave id; of `register/write` only"),
            "address": ("whole number", "register; of `register/write` only"),
            "dropped": ("array of texts", "keys whose change was taken back; of `config/reset` only"),
            "changed": ("array of objects: key, from, to", "values that differ now; of `config/reset` only"),
        },
        {
            "request": "device/options",
            "id": "a1",
            "device": "mast-top",
            "from": {"interval": 1.0},
            "to": {"interval": 0.25},
        },
    ),
    "change_dropped": EventPage(
        "A change that a request made no longer holds: the file was edited since, or a physical change was undone.",
        {
            "key": ("text", "such as `slaves.mast-top.interval` or `line.baudrate`"),
            "device": ("text or null", "name of the device; absent where the whole line is meant"),
            "lost": ("anything", "the value that was dropped, where the file was edited"),
            "from": ("whole number", "slave id or rate that holds; of a physical change only"),
            "to": ("whole number", "slave id or rate that was not reached; of a physical change only"),
            "message": ("text", "for people"),
        },
        {
            "key": "slaves.mast-top.interval",
            "device": "mast-top",
            "lost": 0.25,
            "message": "the file has another value now",
        },
    ),
    "change_conflict": EventPage(
        "The slave id or rate of a device in the file is not the last verified one: it was searched for on the line.",
        {
            "device": _DEVICE,
            "file": (_PLACE, "what the file says"),
            "last": (_PLACE, "where the device last answered"),
            "used": (f"{_PLACE}, or null", "where it answers now; `null`: at neither, both are asked"),
        },
        {
            "device": "slave-3",
            "file": {"slave": 3, "baudrate": 9600},
            "last": {"slave": 9, "baudrate": 9600},
            "used": {"slave": 9, "baudrate": 9600},
        },
    ),
    "scan_progress": EventPage(
        "While `line/scan` runs, and once at its end.",
        {
            "percent": ("number", "share that is done"),
            "remaining_s": ("number", "estimated time left in s; 0 at the end"),
            "asked": ("whole number", "slave ids asked"),
            "total": ("whole number", "slave ids to ask, all rates together"),
            "slave": ("whole number or null", "slave id asked last"),
            "baudrate": ("whole number or null", "its rate"),
            "found": ("whole number", "devices found"),
        },
        {"percent": 42.0, "remaining_s": 7.5, "asked": 21, "total": 50, "slave": 21, "baudrate": 9600, "found": 3},
    ),
    "duplicate_id": EventPage(
        "Two sensors answer under one slave id, or a second answer comes to each request.",
        {
            "slave": _SLAVE,
            "device": ("text", "name of the device, where one is configured there"),
            "baudrate": ("whole number or null", "rate at which they answer; of a scan or `line/adopt` only"),
            "from": ("whole number", "slave id before the change; of a physical change only"),
            "message": ("text", "for people; where it was noticed while polling"),
        },
        {
            "device": "slave-3",
            "slave": 3,
            "message": "slave 3 is answered for twice, 37 ms apart: a second sensor with this id, or a repeater",
        },
    ),
    "dropped": EventPage(
        "Samples of a device are lost: there was no room for them, or the broker accepts them in no form.",
        {
            "device": _DEVICE,
            "boot": ("text", "of the samples"),
            "from_seq": ("whole number", "first `seq` of the range"),
            "to_seq": ("whole number", "last `seq` of the range"),
            "count": ("whole number", "samples lost in the range"),
            "topic": ("text", "`record`: records were lost, and `seq` is theirs; absent for samples"),
        },
        {"device": "mast-top", "boot": "k3f9a2c7", "from_seq": 9001, "to_seq": 9100, "count": 100},
    ),
    "store_put_aside": EventPage(
        "The backlog file was damaged. It was renamed, and an empty one begun.",
        {"file": ("text", "its new name in the state directory"), "reason": ("text", "for people")},
        {"file": "backlog.db.corrupt-k3f9a2c7", "reason": "is damaged"},
    ),
}
"""Every type of event the daemon publishes."""


def payloads(ts: int) -> Iterator[dict[str, object]]:
    """Yield an example of each type, published at `ts`, epoch milliseconds."""
    yield from ({"v": 1, "type": name, "ts": ts, **each.example} for name, each in EVENTS.items())


def sections(ts: int) -> Iterator[str]:
    """Yield the parts of one section for each type."""
    for payload, (name, each) in zip(payloads(ts), EVENTS.items(), strict=True):
        yield f"### Event `{name}`"
        yield each.when
        yield table(("key", "type", "meaning"), ((f"`{key}`", *map(plain, words)) for key, words in each.keys.items()))
        yield example(payload)


def published() -> Mapping[str, set[str]]:
    """Return the types that the code publishes, each with those of its keys that are written where that happens.

    A type is the first argument of a call of `event`, or of a call whose second argument is a mapping of facts.
    """
    found: dict[str, set[str]] = {}
    for file in sorted(PACKAGE.rglob("*.py")):
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Call) and (type_and_keys := _published(node)) is not None:
                name, keys = type_and_keys
                if re.fullmatch(r"[a-z_]+", name):
                    found.setdefault(name, set()).update(keys)
    return found


def _published(call: ast.Call) -> tuple[str, set[str]] | None:
    function = call.func.attr if isinstance(call.func, ast.Attribute) else getattr(call.func, "id", "")
    match call.args:
        case [ast.Constant(value=str(name)), *_] if function == "event":
            return name, {keyword.arg for keyword in call.keywords if keyword.arg is not None}
        case [ast.Constant(value=str(name)), ast.Dict(keys=keys)] if function not in {"get", "setdefault", "pop"}:
            return name, {key.value for key in keys if isinstance(key, ast.Constant) and isinstance(key.value, str)}
        case [ast.Constant(value=str(name)), ast.Name(id="facts")]:
            return name, set()
    return None
