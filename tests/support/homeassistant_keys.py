"""The keys of a device discovery payload that Home Assistant 2026.11.0 takes, and what it says of their values.

Written down from homeassistant/components/mqtt of the wheel homeassistant==2026.11.0: `schemas.py`
(DEVICE_DISCOVERY_SCHEMA, MQTT_ENTITY_COMMON_SCHEMA) and the schema of each platform (`sensor.py`, `binary_sensor.py`,
`number.py`, `switch.py`, `button.py`), and from homeassistant/components/sensor/const.py. Unknown keys make it refuse a
whole payload (root) or are dropped (component). `object_id` is gone, `via_hub` and the topic of a single entity's
availability are deprecated or of no use here: all of them fail.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, Final

from tests.support.homeassistant_units import DEVICE_CLASS_UNITS

ROOT: Final = frozenset(
    [
        "availability",
        "availability_mode",
        "child_devices",
        "command_topic",
        "components",
        "device",
        "encoding",
        "message_expiry_interval",
        "origin",
        "payload_available",
        "payload_not_available",
        "qos",
        "state_topic",
    ]
)

REQUIRED: Final = frozenset({"device", "origin", "components"})

DEVICE: Final = frozenset(
    [
        "configuration_url",
        "connections",
        "hw_version",
        "identifiers",
        "manufacturer",
        "model",
        "model_id",
        "name",
        "serial_number",
        "suggested_area",
        "sw_version",
        "via_device",
    ]
)

ORIGIN: Final = frozenset(["name", "support_url", "sw_version"])

_COMMON: Final = frozenset(
    [
        "availability",
        "availability_mode",
        "default_entity_id",
        "device_class",
        "enabled_by_default",
        "encoding",
        "entity_category",
        "entity_picture",
        "group",
        "icon",
        "json_attributes_template",
        "json_attributes_topic",
        "message_expiry_interval",
        "name",
        "payload_available",
        "payload_not_available",
        "qos",
        "unique_id",
        "visible_by_default",
    ]
)
"""Those of every platform."""

PLATFORMS: Final[Mapping[str, frozenset[str]]] = {
    "sensor": _COMMON
    | frozenset(
        [
            "expire_after",
            "force_update",
            "last_reset_value_template",
            "options",
            "state_class",
            "state_topic",
            "suggested_display_precision",
            "unit_of_measurement",
            "value_template",
        ]
    ),
    "binary_sensor": _COMMON
    | frozenset(
        ["expire_after", "force_update", "off_delay", "payload_off", "payload_on", "state_topic", "value_template"]
    ),
    "number": _COMMON
    | frozenset(
        [
            "command_template",
            "command_topic",
            "max",
            "min",
            "mode",
            "optimistic",
            "payload_reset",
            "retain",
            "state_topic",
            "step",
            "unit_of_measurement",
            "value_template",
        ]
    ),
    "switch": _COMMON
    | frozenset(
        [
            "command_template",
            "command_topic",
            "optimistic",
            "payload_off",
            "payload_on",
            "retain",
            "state_off",
            "state_on",
            "state_topic",
            "value_template",
        ]
    ),
    "button": _COMMON | frozenset(["command_template", "command_topic", "payload_press", "retain"]),
}

NEEDED: Final[Mapping[str, str]] = {
    "sensor": "state_topic",
    "binary_sensor": "state_topic",
    "number": "command_topic",
    "switch": "command_topic",
    "button": "command_topic",
}

STATE_CLASSES: Final = frozenset({"measurement", "measurement_angle", "total", "total_increasing"})
BINARY_CLASSES: Final = frozenset({"problem", "connectivity"})
"""Those that the daemon uses, of 29."""


def complaints(payload: Mapping[str, Any]) -> Iterator[str]:
    """Yield what Home Assistant would refuse of a payload, drop of it or warn about."""
    yield from _unknown("root", payload, ROOT)
    yield from (f"root: {key} is missing" for key in REQUIRED - payload.keys())
    yield from _unknown("device", payload["device"], DEVICE)
    yield from _unknown("origin", payload["origin"], ORIGIN)
    if not payload["device"].get("identifiers") or "name" not in payload["origin"]:
        yield "a device has identifiers, an origin a name"
    if payload.get("availability_mode", "latest") not in {"all", "any", "latest"}:
        yield "availability_mode"
    for key, component in payload["components"].items():
        yield from (f"{key}: {words}" for words in _of_component(component))


def _of_component(component: Mapping[str, Any]) -> Iterator[str]:
    kind = str(component.get("platform"))
    if kind not in PLATFORMS:
        yield f"platform {kind}"
        return
    if component.keys() == {"platform"}:
        return  # it is to be removed
    yield from _unknown(kind, component, PLATFORMS[kind] | {"platform"})
    for needed in ("unique_id", NEEDED[kind]):
        if needed not in component:
            yield f"{needed} is missing"
    if not component.get("default_entity_id", f"{kind}.x").startswith(f"{kind}."):
        yield "the entity id is of another domain"
    if kind in {"sensor", "binary_sensor"} and component.get("entity_category") == "config":
        yield "what shows something is no setting"
    if kind == "sensor":
        yield from _of_sensor(component)
    if kind == "binary_sensor" and component.get("device_class", "problem") not in BINARY_CLASSES:
        yield f"device class {component['device_class']}"


def _of_sensor(sensor: Mapping[str, Any]) -> Iterator[str]:
    kind, unit, state = (sensor.get(key) for key in ("device_class", "unit_of_measurement", "state_class"))
    if state is not None and state not in STATE_CLASSES:
        yield f"state class {state}"
    if "options" in sensor and (kind != "enum" or unit is not None or state is not None or not sensor["options"]):
        yield "options are for an enum alone, which has neither unit nor state class"
    if kind in {"enum", "timestamp"}:
        if unit is not None or state is not None:
            yield f"{kind} with a unit or a state class"
    elif kind is not None:
        units = DEVICE_CLASS_UNITS.get(kind)
        if units is None or (unit or "") not in units:
            yield f"device class {kind} in {unit}"
    if (kind == "wind_direction") is not (state == "measurement_angle"):
        yield "a direction, and nothing else, is an angle"


def _unknown(where: str, given: Mapping[str, Any], known: frozenset[str]) -> Iterator[str]:
    yield from (f"{where}: {key} is no key of 2026.11" for key in given.keys() - known)
