"""The entities of a device and of the line, as components of Home Assistant's device discovery. Pure.

A value's component is named as the value; ours have a `-` in their names, which no value has. Templates hold nothing
but names of `[a-z0-9_-]`: a label never stands in one.

Entities of values and wind take the availability of their device; the others are there while the daemon is: a fault
is to be seen of a device that is offline, and a device that is not polled is to be switched on again.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping
from typing import Final, Literal, TypeAlias

from lfs10d.reading import FaultCode
from lfs10d.system.dataclass import dataclass
from lfs10d.telemetry.homeassistant.device_classes import MEASUREMENT, sensor_class
from lfs10d.telemetry.homeassistant.gateway import (
    DiscoveredDevice,
    DiscoveredValue,
    Gateway,
    entity_id,
    object_id,
)
from lfs10d.telemetry.publication import (
    AVAILABILITY,
    CONFIG,
    ERROR,
    INFO,
    LINE_ERROR,
    LINE_STATS,
    STATE,
    STATS,
    WIND,
    device_topic,
)

Component: TypeAlias = dict[str, object]
Platform: TypeAlias = Literal["sensor", "binary_sensor", "number", "switch", "button"]

EXPIRES_LEAST: Final = 30.0
"""Shortest time in s for which a value is shown."""

_LONGEST_INTERVAL: Final = 86_400
_NO_FAULT: Final = "none"
_TRUE, _FALSE = "True", "False"
"""How Home Assistant's templates write booleans; it takes `None` for unknown."""

_WIND: Final = (
    ("wind-gust", "gust_10m", "Wind gust"),
    ("wind-mean-2m", "mean_2m", "Wind mean 2 min"),
    ("wind-mean-10m", "mean_10m", "Wind mean 10 min"),
)


@dataclass(frozen=True, slots=True)
class _Owner:
    """The owner of entities: the line (no device), or a device."""

    gateway: Gateway
    device: str | None = None

    def entity(self, platform: Platform, key: str, name: str, **options: object) -> tuple[str, Component]:
        """Return a component by its key; options that are None are left out."""
        base, device = self.gateway.base, self.device
        names = (name,) if device is None else (device, name)
        component: Component = {
            "platform": platform,
            "unique_id": f"{object_id(base, device)}.{key}",
            "default_entity_id": entity_id(platform, base, *names),
            "name": name,
            **options,
        }
        return key, {option: value for option, value in component.items() if value is not None}

    def always(self, platform: Platform, key: str, name: str, **options: object) -> tuple[str, Component]:
        """Return a component that is available while the daemon is at the broker."""
        availability = [{"topic": self.gateway.topic(AVAILABILITY)}]
        return self.entity(platform, key, name, availability=availability, **options)

    def button(self, key: str, name: str, request: str, category: str) -> tuple[str, Component]:
        """Return a button that sends a request, about the device if there is one."""
        parameters = {} if self.device is None else {"device": self.device}
        return self.always(
            "button", key, name, entity_category=category,
            command_topic=self.gateway.topic(f"request/{request}"), payload_press=_json(parameters),
        )  # fmt: skip

    def fault(self, topic: str, key: str, name: str) -> Iterator[tuple[str, Component]]:
        """Yield whether an error is active, with the error object as attributes, and its code."""
        topic = self.gateway.topic(topic)
        yield self.always(
            "binary_sensor", f"{key}-state", name, device_class="problem", entity_category="diagnostic",
            state_topic=topic, value_template=_value("active"), payload_on=_TRUE, payload_off=_FALSE,
            json_attributes_topic=topic,
        )  # fmt: skip
        yield self.always(
            "sensor", f"{key}-code", f"{name} code", device_class="enum", entity_category="diagnostic",
            options=[_NO_FAULT, *(code.value for code in FaultCode)],
            state_topic=topic, value_template=f"{{{{ value_json['code'] or '{_NO_FAULT}' }}}}",
        )  # fmt: skip


def device_components(gateway: Gateway, device: DiscoveredDevice) -> dict[str, Component]:
    """Return the entities of a device: values, wind statistics, fault, controls, diagnostics."""
    owner = _Owner(gateway, device.name)
    components = dict(_values(owner, device))
    components.update(_wind(owner, device))
    components.update(owner.fault(device_topic(device.name, ERROR), "fault", "Fault"))
    if "polling" in gateway.commands:
        components.update(_controls(owner, device))
    components.update(_diagnostics(owner, device))
    return components


def line_components(gateway: Gateway) -> dict[str, Component]:
    """Return the entities of the line."""
    owner, stats = _Owner(gateway), gateway.topic(LINE_STATS)
    figure = {"state_topic": stats, "state_class": MEASUREMENT, "entity_category": "diagnostic"}
    components = dict([
        owner.entity(
            "binary_sensor", "mqtt-connection", "Connection", device_class="connectivity",
            entity_category="diagnostic", availability=[],
            state_topic=gateway.topic(AVAILABILITY), payload_on="online", payload_off="offline",
        ),
        *owner.fault(LINE_ERROR, "line-fault", "Line fault"),
        owner.entity(
            "sensor", "line-load", "Load", unit_of_measurement="%", suggested_display_precision=0,
            value_template=_value("load_pct"), **figure,
        ),
        owner.entity(
            "sensor", "poll-rate", "Polls per second", unit_of_measurement="polls/s", suggested_display_precision=1,
            value_template=_value("polls_per_s"), **figure,
        ),
        owner.entity(
            "sensor", "samples-waiting", "Samples waiting", unit_of_measurement="samples",
            value_template="{{ value_json['store']['depth'] }}", **figure,
        ),
        owner.entity(
            "sensor", "daemon-version", "Version", entity_category="diagnostic",
            state_topic=gateway.topic(INFO), value_template=_value("version"),
        ),
    ])  # fmt: skip
    if "sensors" in gateway.commands:
        components.update([owner.button("line-scan", "Scan", "line/scan", "config")])
    if "polling" in gateway.commands:
        components.update([owner.button("config-reload", "Reload", "config/reload", "config")])
    return components


def _values(owner: _Owner, device: DiscoveredDevice) -> Iterator[tuple[str, Component]]:
    topic = owner.gateway.topic(device_topic(device.name, STATE))
    expires = _expires(device.interval, owner.gateway.state_every)
    for value in device.values:
        shown = {"state_topic": topic, "value_template": _value(value.name), "expire_after": expires}
        name = value.name.replace("_", " ").capitalize()
        if value.kind == "boolean":
            yield owner.entity("binary_sensor", value.name, name, payload_on=_TRUE, payload_off=_FALSE, **shown)
        elif value.kind == "text":
            kind = {"device_class": "enum", "options": list(value.options)} if value.options else {}
            yield owner.entity("sensor", value.name, name, **kind, **shown)
        else:
            yield owner.entity("sensor", value.name, name, **_number(value), **shown)


def _wind(owner: _Owner, device: DiscoveredDevice) -> Iterator[tuple[str, Component]]:
    speed = device.wind
    if speed is None:
        return
    topic, expires = owner.gateway.topic(device_topic(device.name, WIND)), _expires(owner.gateway.wind_every)
    for key, field, name in _WIND:
        shown = {"state_topic": topic, "value_template": _value(field), "expire_after": expires}
        yield owner.entity("sensor", key, name, **_number(speed), **shown)


def _controls(owner: _Owner, device: DiscoveredDevice) -> Iterator[tuple[str, Component]]:
    """Yield the controls that send requests of class `polling`."""
    state = owner.gateway.topic(device_topic(device.name, CONFIG))
    options = owner.gateway.topic("request/device/options")
    # The device's name is of [a-z0-9_-]: nothing in it can be taken for a template.
    yield owner.always(
        "number", "poll-interval", "Poll interval", device_class="duration", entity_category="config",
        unit_of_measurement="s", mode="box", min=0, max=_LONGEST_INTERVAL, step=0.001,
        state_topic=state, value_template=_value("interval"), command_topic=options,
        command_template=_json({"device": device.name})[:-1] + ',"interval":{{ value }}}',
    )  # fmt: skip
    yield owner.always(
        "switch", "polling-switch", "Polling", entity_category="config",
        state_topic=state, value_template=_value("enabled"), state_on=_TRUE, state_off=_FALSE, command_topic=options,
        payload_on=_json({"device": device.name, "enabled": True}),
        payload_off=_json({"device": device.name, "enabled": False}),
    )  # fmt: skip
    yield owner.button("read-now", "Read now", "device/read", "diagnostic")


def _diagnostics(owner: _Owner, device: DiscoveredDevice) -> Iterator[tuple[str, Component]]:
    """Yield the diagnostic entities, which are disabled by default."""
    shown = {
        "state_topic": owner.gateway.topic(device_topic(device.name, STATS)),
        "entity_category": "diagnostic",
        "enabled_by_default": False,
    }
    yield owner.always(
        "sensor", "response-time", "Response time", device_class="duration", state_class=MEASUREMENT,
        unit_of_measurement="ms", suggested_display_precision=1, value_template="{{ value_json['rtt_ms']['p50'] }}",
        **shown,
    )  # fmt: skip
    yield owner.always(
        "sensor", "poll-success", "Poll success", state_class=MEASUREMENT, unit_of_measurement="%",
        suggested_display_precision=1,
        value_template="{{ 100 * value_json['good'] / value_json['polls'] if value_json['polls'] else None }}",
        **shown,
    )  # fmt: skip
    last = "value_json['last_good_ts']"
    yield owner.always(
        "sensor", "last-seen", "Last seen", device_class="timestamp",
        value_template=f"{{{{ ({last} / 1000) | as_datetime if {last} else None }}}}",
        **shown,
    )  # fmt: skip


def _number(value: DiscoveredValue) -> dict[str, object]:
    kind = sensor_class(value.device_class, value.unit)
    return {
        "device_class": kind.device_class,
        "state_class": kind.state_class,
        "unit_of_measurement": value.unit,
        "suggested_display_precision": value.precision,
    }


def _value(key: str) -> str:
    """Return the template of one key; by brackets, for `values` or `items` after a dot are methods."""
    return f"{{{{ value_json['{key}'] }}}}"


def _expires(*every: float) -> int:
    """Return after how many seconds without news a value is unavailable."""
    return math.ceil(max(EXPIRES_LEAST, *(3 * each for each in every)))


def _json(payload: Mapping[str, object]) -> str:
    return json.dumps(payload, separators=(",", ":"))
