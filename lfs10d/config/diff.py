"""The difference between two configurations, as effects: used by every reload and every request."""

from __future__ import annotations

from typing import Any

from lfs10d.config.loader import leaves
from lfs10d.config.models import Config, SlaveConfig
from lfs10d.system.dataclass import dataclass

RESTART_KEYS = frozenset({"line.name", "mqtt.base_topic"})
"""Keys that need a restart: they are part of every topic."""


@dataclass(frozen=True, slots=True)
class Change:
    """One key with another value: `line.baudrate`, `slaves.mast-top.interval`; devices go by their names."""

    key: str
    old: Any
    new: Any


@dataclass(frozen=True, slots=True)
class Difference:
    """The effects of a reload. `target` is the new configuration; keys that need a restart have their old values.

    `added` and `removed` are names of devices; `changed` holds keys of what stays.
    """

    target: Config
    added: tuple[str, ...]
    removed: tuple[str, ...]
    changed: tuple[Change, ...]
    restart_required: tuple[str, ...]

    @property
    def applied(self) -> tuple[str, ...]:
        """The keys that take effect, for the response to `config/reload`."""
        devices = (f"slaves.{name}" for name in (*self.added, *self.removed))
        return (*(change.key for change in self.changed), *devices)


def difference(old: Config, new: Config) -> Difference:
    """Return the difference from the running configuration `old` to another; both are resolved."""
    target, restart = _without_restart(old, new)
    before = {slave.name: slave for slave in old.slaves}
    after = {slave.name: slave for slave in target.slaves}
    changed = [
        Change(key, was, now) for (key, was), (_, now) in zip(_plain(old), _plain(target), strict=True) if was != now
    ]
    for name, slave in after.items():
        if name in before:
            changed += _changes(before[name], slave)
    return Difference(
        target=target,
        added=tuple(name for name in after if name not in before),
        removed=tuple(name for name in before if name not in after),
        changed=tuple(changed),
        restart_required=restart,
    )


def _without_restart(old: Config, new: Config) -> tuple[Config, tuple[str, ...]]:
    update: dict[str, Any] = {}
    restart: list[str] = []
    mqtt: dict[str, Any] = {}
    if new.line.name != old.line.name:
        restart.append("line.name")
        update["line"] = new.line.model_copy(update={"name": old.line.name})
        # The default client id holds the line's name; who we are follows the topics.
        if new.mqtt.client_id == (old.mqtt.client_id or "").replace(f"-{old.line.name}", f"-{new.line.name}"):
            mqtt["client_id"] = old.mqtt.client_id
    if new.mqtt.base_topic != old.mqtt.base_topic:
        restart.append("mqtt.base_topic")
        mqtt["base_topic"] = old.mqtt.base_topic
    if mqtt:
        update["mqtt"] = new.mqtt.model_copy(update=mqtt)
    return new.model_copy(update=update), tuple(restart)


def _plain(config: Config) -> list[tuple[str, Any]]:
    """Return every key except those of slaves; `mqtt.tls` and `line.rs485` are null or a whole section."""
    pairs: list[tuple[str, Any]] = []
    for section in type(config).model_fields:
        value = getattr(config, section)
        if section == "slaves":
            continue
        if isinstance(value, tuple):
            pairs.append((section, value))
        else:
            pairs += ((f"{section}.{key}", getattr(value, key)) for key in type(value).model_fields)
    return pairs


def _changes(before: SlaveConfig, after: SlaveConfig) -> list[Change]:
    return [
        Change(f"slaves.{after.name}.{path[-1]}", was, now)
        for (path, was), (_, now) in zip(leaves(before), leaves(after), strict=True)
        if was != now
    ]
