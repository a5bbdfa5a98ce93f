"""Builds the discovery payloads for Home Assistant from configuration and profiles."""

from __future__ import annotations

import contextlib
from collections.abc import Mapping
from pathlib import Path

from lfs10d import __version__
from lfs10d.config.models import Config, SlaveConfig
from lfs10d.daemon.settings import wind_info
from lfs10d.profiles.profile import Profile
from lfs10d.profiles.values import Value
from lfs10d.schema.addresses import TopicPrefix
from lfs10d.schema.fields import FieldError
from lfs10d.system.disk import Disk
from lfs10d.telemetry.homeassistant.discovery import Announced, announcements
from lfs10d.telemetry.homeassistant.gateway import DiscoveredDevice, DiscoveredValue, Gateway

FILE_NAME = "homeassistant"
"""In the state directory: the prefixes under which something may be announced, one a line."""

BARE_NUMBER = "1"
"""Unit in a profile of a number without one."""


def discovery_payloads(config: Config, profiles: Mapping[str, Profile]) -> dict[str, Announced]:
    """Return the payloads by full topic; none if discovery is off."""
    if not config.homeassistant.discovery:
        return {}
    gateway = Gateway(
        base=f"{config.mqtt.base_topic}/{config.line.name}",
        prefix=config.homeassistant.prefix,
        version=__version__,
        commands=frozenset(config.commands),
        state_every=config.mqtt.state_every,
        wind_every=config.wind.every,
    )
    return announcements(gateway, (_device(config, slave, profiles[slave.profile]) for slave in config.slaves))


def _device(config: Config, slave: SlaveConfig, profile: Profile) -> DiscoveredDevice:
    values = tuple(_value(value) for value in profile.values)
    wind = wind_info(config, profile)
    return DiscoveredDevice(
        name=slave.name,
        label=slave.label,
        manufacturer=profile.manufacturer,
        model=profile.model or profile.title,
        interval=slave.interval,
        values=values,
        wind=next((value for value in values if wind is not None and value.name == wind.values.speed), None),
    )


def _value(value: Value) -> DiscoveredValue:
    if value.map is not None:
        return DiscoveredValue(value.name, kind="text", options=tuple(dict.fromkeys(value.map.values())))
    if value.is_text:
        return DiscoveredValue(value.name, kind="boolean" if value.type == "bool" else "text")
    unit = None if value.unit == BARE_NUMBER else value.unit
    return DiscoveredValue(value.name, unit, value.precision, value.device_class)


class AnnouncedPrefixes:
    """The discovery prefixes in use, saved for the next run; best effort if the disk fails."""

    def __init__(self, directory: Path, disk: Disk) -> None:
        self._path = directory / FILE_NAME
        self._disk = disk

    def load(self) -> frozenset[str]:
        """Return the prefixes that earlier runs used."""
        try:
            lines = self._disk.read(self._path).decode().splitlines()
        except (OSError, UnicodeError):
            return frozenset()
        kind = TopicPrefix()
        found = set()
        for line in lines:
            with contextlib.suppress(FieldError):
                found.add(kind.accept(line))
        return frozenset(found)

    def save(self, prefixes: frozenset[str]) -> None:
        """Save the prefixes; no file means none."""
        with contextlib.suppress(OSError):
            if prefixes:
                self._disk.replace(self._path, "".join(f"{each}\n" for each in sorted(prefixes)).encode())
            else:
                self._disk.remove(self._path)
