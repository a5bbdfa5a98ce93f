"""The discovery payloads of a daemon, one for the line and one per device, and the steps from old to new. Pure.

Home Assistant keeps an entity that is merely left out of a newer payload. It goes when a payload names it with nothing
but its platform; after that it is left out. A payload that is cleared removes its device with all entities.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Final, TypeAlias

from lfs10d.system.dataclass import dataclass
from lfs10d.telemetry.homeassistant.entities import Component, device_components, line_components
from lfs10d.telemetry.homeassistant.gateway import (
    ORIGIN,
    DiscoveredDevice,
    Gateway,
    config_topic,
    object_id,
)
from lfs10d.telemetry.publication import AVAILABILITY, device_topic

CLICK_EXPIRES: Final = 30
"""Seconds after which the broker discards a command that the daemon did not receive."""

Announced: TypeAlias = dict[str, object]
"""A discovery payload."""
Platforms: TypeAlias = Mapping[str, str]
"""The components of a payload: the platform of each by its key."""


def announcements(gateway: Gateway, devices: Iterable[DiscoveredDevice]) -> dict[str, Announced]:
    """Return the payload for each full topic, the line's first: the devices refer to it by `via_device`."""
    line = object_id(gateway.base)
    about_line: dict[str, object] = {
        "identifiers": [line],
        "name": f"RS485 line {gateway.base}",
        "manufacturer": ORIGIN,
        "model": "RS485 to MQTT gateway",
        "sw_version": gateway.version,
    }
    found = {
        config_topic(gateway.prefix, line): _payload(gateway, about_line, line_components(gateway), (AVAILABILITY,))
    }
    for device in devices:
        identifier = object_id(gateway.base, device.name)
        about = {
            "identifiers": [identifier],
            "name": device.label or device.name,
            **({} if device.manufacturer is None else {"manufacturer": device.manufacturer}),
            "model": device.model,
            "sw_version": gateway.version,
            "via_device": line,
        }
        availability = (AVAILABILITY, device_topic(device.name, AVAILABILITY))
        found[config_topic(gateway.prefix, identifier)] = _payload(
            gateway, about, device_components(gateway, device), availability
        )
    return found


def _payload(
    gateway: Gateway, about: Mapping[str, object], components: Mapping[str, Component], availability: Iterable[str]
) -> Announced:
    return {
        "device": about,
        "origin": {"name": ORIGIN, "sw_version": gateway.version},
        "availability": [{"topic": gateway.topic(each)} for each in availability],
        "availability_mode": "all",
        "qos": 1,
        "message_expiry_interval": CLICK_EXPIRES,
        "components": components,
    }


def platforms(payload: Mapping[str, object]) -> dict[str, str]:
    """Return the platform of each component of a payload, whoever wrote it."""
    components = payload.get("components")
    found = components.items() if isinstance(components, Mapping) else ()
    return {
        str(key): component["platform"]
        for key, component in found
        if isinstance(component, Mapping) and isinstance(component.get("platform"), str)
    }


@dataclass(frozen=True, slots=True)
class Transition:
    """What to publish on full topics: `first`, and when that is out and taken in, `then`. None clears a topic."""

    first: dict[str, Announced | None]
    then: dict[str, Announced]


def transition(known: Mapping[str, Platforms], wanted: Mapping[str, Announced]) -> Transition:
    """Return what makes the `wanted` payloads known at these topics; those not wanted are cleared, the line's last.

    `known` are the components that a consumer may know.
    """
    gone = [topic for topic in known if topic not in wanted]
    first: dict[str, Announced | None] = {}
    then: dict[str, Announced] = {}
    for topic, payload in wanted.items():
        now = platforms(payload)
        ended = {key: kind for key, kind in known.get(topic, {}).items() if now.get(key) != kind}
        if ended:
            first[topic] = _ending(payload, ended)
            then[topic] = payload
        else:
            first[topic] = payload
    # The longer the topic, the further from the line's, which every device's begins with.
    return Transition({**dict.fromkeys(sorted(gone, key=len, reverse=True)), **first}, then)


def _ending(payload: Announced, ended: Platforms) -> Announced:
    """Return a payload with these components named by their platform alone."""
    components = payload["components"]
    stubs = {key: {"platform": kind} for key, kind in ended.items()}
    return {**payload, "components": {**(components if isinstance(components, Mapping) else {}), **stubs}}
