"""From what a file says to a configuration without gaps: inherited values, default names, %H. Pure."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from lfs10d.config import TLS_PORT, default_line_name, device_name

if TYPE_CHECKING:
    from lfs10d.config import Config, MqttConfig, PollConfig, SlaveConfig


def resolved(config: Config, *, stem: str, host: str) -> Config:
    """Return the configuration without gaps: names, inherited values, the broker's port, %H.

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


def inherited(slave: SlaveConfig, poll: PollConfig) -> SlaveConfig:
    """Return a slave as it is polled: with its name, and with what `poll` says where it says nothing itself."""
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
