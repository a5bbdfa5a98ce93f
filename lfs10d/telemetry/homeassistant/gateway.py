"""The facts about a line and its devices that discovery needs, and their names there. Pure values.

Every name here is made of names that are stable for life (base topic, line, device, value), never of a slave id.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Mapping
from typing import Final, Literal, TypeAlias

from lfs10d.system.dataclass import dataclass

ORIGIN: Final = "lfs10d"

ValueKind: TypeAlias = Literal["number", "text", "boolean"]

_PLAIN: Final = re.compile(r"[a-z0-9-]+/[a-z0-9-]+")
_DIGEST: Final = 6
"""Hex digits that distinguish base topics with the same object id."""


@dataclass(frozen=True, slots=True)
class DiscoveredValue:
    """A value of a device's profile; `unit` is None for a bare number, `options` are the texts it can be, if known."""

    name: str
    unit: str | None = None
    precision: int | None = None
    device_class: str | None = None
    kind: ValueKind = "number"
    options: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class DiscoveredDevice:
    """A device as configured; `interval` in s, `wind` is the speed that topic `wind` is about, if it has one."""

    name: str
    label: str | None
    manufacturer: str | None
    model: str
    interval: float
    values: tuple[DiscoveredValue, ...]
    wind: DiscoveredValue | None = None


@dataclass(frozen=True, slots=True)
class Gateway:
    """The daemon and its line: `base` is `B`, `commands` are the classes of requests obeyed, durations are in s."""

    base: str
    prefix: str
    version: str
    commands: frozenset[str]
    state_every: float
    wind_every: float

    def topic(self, relative: str) -> str:
        """Return the full topic of one under `B`."""
        return f"{self.base}/{relative}"


def object_id(base: str, device: str | None = None) -> str:
    """Return a unique name of the line `base`, or of a device on it: `[a-z0-9_-]` only.

    `lfs10d/line0` is `lfs10d_lfs10d_line0`, its mast-top `lfs10d_lfs10d_line0_mast-top`. Where that could be taken for
    another's (an underscore, a third level, a character that has no place in it), some digits of a hash follow.
    """
    text = re.sub(r"[^a-z0-9_-]", "-", base.lower().replace("/", "_"))
    if not _PLAIN.fullmatch(base):
        text += f"-{hashlib.sha256(base.encode('utf-8', 'replace')).hexdigest()[:_DIGEST]}"
    return f"{ORIGIN}_{text}" if device is None else f"{ORIGIN}_{text}_{device}"


def entity_id(platform: str, base: str, *names: str) -> str:
    """Return the proposed entity id: `sensor.lfs10d_line0_mast_top_wind_speed`."""
    return f"{platform}.{re.sub(r'[^a-z0-9]+', '_', '_'.join((base, *names)).lower()).strip('_')}"


def config_topic(prefix: str, identifier: str) -> str:
    """Return the full topic of a device's discovery payload."""
    return f"{prefix}/device/{identifier}/config"


def is_about(payload: Mapping[str, object], availability: str) -> bool:
    """Return whether a discovery payload belongs to the daemon with this availability topic (full)."""
    match payload.get("availability"):
        case [{"topic": topic}, *_]:
            return bool(topic == availability)
        case _:
            return False
