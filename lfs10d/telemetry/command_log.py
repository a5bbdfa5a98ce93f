"""The log entry of each request: what, which device, from, to, and its id. Pure.

One line for each, whatever it holds came over the network and is escaped.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping
from typing import Any

from lfs10d.command import Command, Result
from lfs10d.system.logs import escape

LONGEST = 300
"""Longest text of one value in the log, in characters."""
PLACE = ("device", "slave", "address")
OUTCOME = ("dry_run", "pending", "changed", "dropped", "applied", "restart_required", "added", "cancelled", "for")
"""Further keys of a result that are logged unless they are empty."""


def line(name: str, call: Command, answer: Result) -> str:
    """Return the line of a request that is over: `request device/options (id a1): ok: device mast, from ..., to ...`.

    `name` is the request's; what the answer does not say of the device is taken from the request itself.
    """
    which = "" if call.key is None else f" (id {_short(call.key)})"
    status = answer.status if answer.code is None else f"{answer.status} ({answer.code})"
    told = ", ".join(f"{key} {_short(value)}" for key, value in _facts(name, call.parameters, answer))
    words = [f"request {name}{which}", status, *([told] if told else []), *([answer.message] if answer.message else [])]
    return escape(": ".join(words))


def _facts(name: str, parameters: Mapping[str, Any], answer: Result) -> Iterator[tuple[str, object]]:
    data = answer.data if isinstance(answer.data, dict) else {}
    for key in PLACE:
        value = data.get(key, parameters.get(key))
        if value is not None and not (key == "slave" and name in _MOVES):
            yield key, value
    if answer.code is None and name in _CHANGES:
        before, after = _CHANGES[name](data)
        yield from (("from", before), ("to", after))
    elif "to" in parameters:
        yield "to", parameters["to"]
    for key in OUTCOME:
        if data.get(key):
            yield key, data[key]


def _polled(data: Mapping[str, Any]) -> dict[str, Any]:
    return {key: value for key, value in data.items() if key != "device"}


_CHANGES: Mapping[str, Callable[[Mapping[str, Any]], tuple[object, object]]] = {
    "device/add": lambda data: (None, _polled(data)),
    "device/remove": lambda data: (_polled(data), None),
    "device/options": lambda data: (data.get("from"), data.get("to")),
    "device/readdress": lambda data: (data.get("from"), data.get("to")),
    "line/baudrate": lambda data: (data.get("from"), data.get("to")),
    "line/adopt": lambda data: (data.get("from"), data.get("slave")),
    "register/write": lambda data: (data.get("before"), data.get("value")),
}
"""Keys of the result that say what a request changed: the value before, the value now."""
_MOVES = frozenset({"device/add", "device/remove", "line/adopt"})
"""Requests that changed a slave id."""


def _short(value: object) -> str:
    text = value if isinstance(value, str) else json.dumps(value, ensure_ascii=False, separators=(",", ":"))
    return text if len(text) <= LONGEST else text[: LONGEST - 3] + "..."
