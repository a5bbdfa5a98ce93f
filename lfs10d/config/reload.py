"""Plans a reload: compares the running configuration with the files. Pure, apart from reading them."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from lfs10d.config.diff import difference
from lfs10d.config.loader import LoadedConfig, load
from lfs10d.config.models import MqttConfig
from lfs10d.system.dataclass import dataclass
from lfs10d.system.regular_file import read_regular


@dataclass(frozen=True, slots=True)
class ConfigFiles:
    """A valid configuration, and a digest of each file of the login, by key."""

    loaded: LoadedConfig
    login: Mapping[str, bytes]


@dataclass(frozen=True, slots=True)
class ReloadPlan:
    """The effects of a reload. `loaded` is the new configuration; keys that need a restart have their old values."""

    loaded: LoadedConfig
    applied: tuple[str, ...]
    restart_required: tuple[str, ...]
    line: bool
    """Settings of the port or the line differ."""
    realtime: bool
    polling: bool
    """Devices or their polling differ."""
    broker: bool
    """The connection to the broker must be made again."""
    publishing: bool
    """What is published, or how often, differs."""
    log: bool


def read(path: Path) -> ConfigFiles:
    """Read all files again; raises ConfigError with all problems."""
    loaded = load(path)
    return ConfigFiles(loaded, imprint(loaded))


def imprint(loaded: LoadedConfig) -> dict[str, bytes]:
    """Return a digest of the password and of each certificate, by key; unreadable ones are left out."""
    mqtt = loaded.config.mqtt
    digests: dict[str, bytes] = {}
    password = mqtt.password_file or loaded.credential
    if password is not None:
        digests["mqtt.password_file"] = _digest(Path(password))
    if mqtt.tls is not None:
        files = (file for file in (mqtt.tls.ca, mqtt.tls.cert, mqtt.tls.key) if file is not None)
        digests["mqtt.tls"] = b"".join(_digest(Path(file)) for file in files)
    return digests


def _digest(file: Path) -> bytes:
    try:
        return hashlib.sha256(read_regular(file)).digest()
    except OSError:
        return b""


def plan(running: ConfigFiles, found: ConfigFiles) -> ReloadPlan:
    """Return the plan from the running files to the new ones."""
    before, after = running.loaded, found.loaded
    changes = difference(before.config, after.config)
    target = changes.target
    keys = dict.fromkeys(changes.applied)
    stay = {slave.name for slave in before.config.slaves} - set(changes.removed)
    profiles = [
        f"slaves.{slave.name}.profile"
        for slave in target.slaves
        if slave.name in stay and before.profiles.get(slave.profile) != after.profiles[slave.profile]
    ]
    login = [key for key in {*running.login, *found.login} if running.login.get(key) != found.login.get(key)]
    keys.update(dict.fromkeys([*profiles, *sorted(login)]))
    silent = {"realtime": before.config.line.realtime}
    line = before.config.line != target.line.model_copy(update=silent)
    return ReloadPlan(
        loaded=replace(after, config=target),
        applied=tuple(keys),
        restart_required=changes.restart_required,
        line=line,
        realtime=before.config.line.realtime is not target.line.realtime,
        polling=bool(line or profiles or any(key.startswith(("slaves.", "poll.")) for key in changes.applied))
        or before.config.mqtt.hold != target.mqtt.hold,
        broker=bool(login) or _connection(before.config.mqtt) != _connection(target.mqtt),
        publishing=_publishing(before.config.mqtt) != _publishing(target.mqtt) or before.config.wind != target.wind,
        log=before.config.log != target.log,
    )


PUBLISHING = {"telemetry", "state_every"}
"""Keys of `mqtt` that do not affect the connection."""


def _connection(mqtt: MqttConfig) -> dict[str, object]:
    return mqtt.model_dump(exclude=PUBLISHING | {"hold"})


def _publishing(mqtt: MqttConfig) -> dict[str, object]:
    return mqtt.model_dump(include=PUBLISHING)
