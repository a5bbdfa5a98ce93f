"""From the configuration and the profiles to what Home Assistant is told."""

from __future__ import annotations

from collections.abc import Mapping

from lfs10d import __version__
from lfs10d.config.models import Config
from lfs10d.profiles.profile import Profile
from lfs10d.profiles.values import Value
from lfs10d.telemetry.homeassistant.discovery import Announced, announcements
from lfs10d.telemetry.homeassistant.gateway import DiscoveredDevice, DiscoveredValue, Gateway

BARE_NUMBER = "1"
"""Unit in a profile of a number without one."""


def discovery_payloads(config: Config, profiles: Mapping[str, Profile]) -> dict[str, Announced]:
    """Return the payloads by full topic; none where discovery is off."""
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
    devices = (
        DiscoveredDevice(
            name=slave.name,
            label=slave.label,
            manufacturer=profiles[slave.profile].manufacturer,
            model=profiles[slave.profile].model or profiles[slave.profile].title,
            interval=slave.interval,
            values=tuple(_value(value) for value in profiles[slave.profile].values),
        )
        for slave in config.slaves
    )
    return announcements(gateway, devices)


def _value(value: Value) -> DiscoveredValue:
    unit = None if value.unit == BARE_NUMBER else value.unit
    return DiscoveredValue(value.name, unit, value.precision, value.device_class)
