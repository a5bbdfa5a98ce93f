"""Completes the configuration of a file: inherited values, default names, %H. Pure."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from lfs10d.config.models import (
    LONGEST_CLIENT_ID,
    TLS_PORT,
    Config,
    MqttConfig,
    PollConfig,
    SlaveConfig,
    default_line_name,
    device_name,
)
from lfs10d.schema.addresses import BaseTopic
from lfs10d.schema.fields import FieldError, FieldKind, Text, quoted
from lfs10d.schema.messages import KeyPath


def resolved(config: Config, *, stem: str, host: str) -> Config:
    """Return the complete configuration: names, inherited values, the broker's port, %H.

    `stem` is the file's name without suffix, `host` the host's name.
    """
    line = config.line.name or default_line_name(stem)
    return config.model_copy(
        update={
            "line": config.line.model_copy(update={"name": line}),
            "slaves": tuple(inherited(slave, config.poll) for slave in config.slaves),
            "mqtt": _named(config.mqtt, line, host),
        }
    )


def unfit(config: Config, complete: Config) -> Iterator[tuple[KeyPath, str]]:
    """Yield the problems that %H has with this host's name; `complete` is `config` resolved."""
    kinds: tuple[tuple[str, FieldKind], ...] = (("base_topic", BaseTopic()), ("client_id", Text(LONGEST_CLIENT_ID)))
    for key, kind in kinds:
        written, value = getattr(config.mqtt, key), getattr(complete.mqtt, key)
        if written is not None and "%H" not in written:
            continue
        try:
            kind.accept(value)
        except FieldError:
            yield (
                ("mqtt", key),
                f"is {quoted(value)} with the name of this host, and must be {kind.words}; write one without %H",
            )


def inherited(slave: SlaveConfig, poll: PollConfig) -> SlaveConfig:
    """Return a slave with its name, and with the values of `poll` for keys that it does not have."""
    update: dict[str, Any] = {"name": device_name(slave)}
    for key in ("interval", "response_timeout"):
        if key not in slave.model_fields_set:
            update[key] = getattr(poll, key)
    return slave.model_copy(update=update)


def _named(mqtt: MqttConfig, line: str, host: str) -> MqttConfig:
    client_id = mqtt.client_id or f"lfs10d-%H-{line}"
    update: dict[str, Any] = {
        "base_topic": mqtt.base_topic.replace("%H", host),
        "client_id": client_id.replace("%H", host),
    }
    if mqtt.tls is not None and "port" not in mqtt.model_fields_set:
        update["port"] = TLS_PORT
    return mqtt.model_copy(update=update)
