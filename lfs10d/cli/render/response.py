"""A response in words, for people. Pure; everything in it came over the network and is escaped."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from datetime import tzinfo
from typing import Any

from lfs10d.cli.local_time import stamp
from lfs10d.cli.render.foreign import mapping
from lfs10d.profiles.facts import RESERVED_NAMES
from lfs10d.system.logs import escape

INDENT = "  "
SAMPLE = frozenset({"device", "seq", "quality", "error"})
"""Keys by which a sample is recognized."""
DEEPEST = 20
"""Levels that are indented; what lies deeper is shown as JSON."""


def status_line(response: Mapping[str, Any]) -> str:
    """Return how a request ended, in one line."""
    name, status = _plain(response.get("request")), _plain(response.get("status"))
    error = response.get("error")
    if not isinstance(error, dict):
        took = response.get("took_ms")
        return f"{name}: {status}" + (f", {took:.0f} ms" if isinstance(took, int | float) else "")
    return f"{name}: {status}: {_plain(error.get('code'))}: {_plain(error.get('message'))}"


def content_lines(response: Mapping[str, Any], zone: tzinfo | None = None) -> Iterator[str]:
    """Yield the content, line by line; the time of a sample is that of `zone` (None: this machine's)."""
    data = response.get("data")
    if isinstance(data, dict) and data.keys() >= SAMPLE:
        yield _sample(data, zone)
    elif data is not None:
        yield from _laid_out(data, 0)


def _sample(sample: Mapping[str, Any], zone: tzinfo | None) -> str:
    units, errors = sample.get("units"), mapping(sample.get("errors"))
    values = []
    for name, value in sample.items():
        if name in RESERVED_NAMES:
            continue
        unit = units.get(name) if isinstance(units, dict) else sample.get("unit")
        why = errors.get(name)
        missing = "no value" if why is None else f"no value ({_plain(why)})"
        shown = (
            _plain(value)
            if isinstance(value, bool | str) and unit in (None, "1")
            else f"{_plain(value)} {_plain(unit)}"
        )
        values.append(f"{_plain(name)} {missing if value is None else shown}")
    quality = _plain(sample["quality"]) + ("" if sample["error"] is None else f" ({_plain(sample['error'])})")
    rtt = sample.get("rtt_ms")
    answered = "" if rtt is None else f", answered in {_plain(rtt)} ms"
    ts = sample.get("ts")
    when = stamp(ts, zone) if isinstance(ts, int | float) else _plain(sample.get("time"))
    return f"{_plain(sample['device'])}: {', '.join(values)}, {quality}{answered}, at {when}"


def _laid_out(data: object, depth: int) -> Iterator[str]:
    """Yield keys and values, one a line, what belongs together indented."""
    indent = INDENT * depth
    if depth >= DEEPEST or not isinstance(data, dict | list):
        yield f"{indent}{_plain(data)}"
        return
    if isinstance(data, dict):
        entries = [(f"{escape(key)}:", value) for key, value in data.items()]
    else:
        entries = [("-", item) for item in data]
    for head, value in entries:
        if _is_leaf(value):
            yield f"{indent}{head} {_plain(value)}"
        else:
            yield f"{indent}{head}"
            yield from _laid_out(value, depth + 1)


def _is_leaf(value: object) -> bool:
    """Whether a value goes on one line: a plain one, nothing, or a list of plain ones."""
    if isinstance(value, list):
        return all(not isinstance(item, dict | list) for item in value)
    return not isinstance(value, dict) or not value


def _plain(value: object) -> str:
    match value:
        case str():
            return escape(value)
        case None:
            return "null"
        case bool():
            return "true" if value else "false"
        case list():
            return f"[{', '.join(_plain(item) for item in value)}]"
        case dict():
            return escape(json.dumps(value, ensure_ascii=False))
        case _:
            return str(value)
