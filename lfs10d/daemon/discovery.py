"""From the configuration and the profiles to what Home Assistant is told."""

from __future__ import annotations

from collections.abc import Mapping

from lfs10d import __version__
from lfs10d.config.models import Config, SlaveConfig
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
    return announcements(gateway, (_device(slave, profiles[slave.profile]) for slave in config.slaves))


def _device(slave: SlaveConfig, profile: Profile) -> DiscoveredDevice:
    values = tuple(_value(value) for value in profile.values)
    return DiscoveredDevice(
        name=slave.name,
        label=slave.label,
        manufacturer=profile.manufacturer,
        model=profile.model or profile.title,
        interval=slave.interval,
        values=values,
        wind=next((value for value in values if value.device_class == "wind_speed" and value.unit == "m/s"), None),
    )


def _value(value: Value) -> DiscoveredValue:
    unit = None if value.unit == BARE_NUMBER else value.unit
    return DiscoveredValue(value.name, unit, value.precision, value.device_class)
