"""Which device class a value is announced with."""

from __future__ import annotations

import pytest

from lfs10d.telemetry.homeassistant.device_classes import SensorClass, sensor_class
from tests.support.homeassistant_units import DEVICE_CLASS_UNITS, STATE_CLASSES


@pytest.mark.parametrize(
    ("wanted", "unit", "found"),
    [
        ("wind_speed", "m/s", SensorClass("wind_speed")),
        ("wind_speed", "Beaufort", SensorClass(None)),  # it would be shown in km/h
        ("wind_speed", "furlong/fortnight", SensorClass(None)),
        ("wind_speed", None, SensorClass(None)),
        ("wind_direction", "°", SensorClass("wind_direction", "measurement_angle")),
        ("energy", "kWh", SensorClass("energy", "total_increasing")),
        ("ph", None, SensorClass("ph")),
        ("current", "\N{MICRO SIGN}A", SensorClass("current")),
        ("timestamp", "s", SensorClass(None)),
        ("no_such_class", "m/s", SensorClass(None)),
        (None, "m/s", SensorClass(None)),
    ],
)
def test_a_class_is_announced_where_home_assistant_takes_it_with_the_unit(
    wanted: str | None, unit: str | None, found: SensorClass
) -> None:
    assert sensor_class(wanted, unit) == found


def test_every_class_is_taken_with_each_of_its_units_and_with_no_other() -> None:
    every = {unit for units in DEVICE_CLASS_UNITS.values() for unit in units}
    for name, units in DEVICE_CLASS_UNITS.items():
        for unit in every - {"Beaufort"}:
            found = sensor_class(name, unit or None)
            assert (found.device_class == name) is (unit in units), (name, unit)
            if unit in units:
                assert found.state_class in STATE_CLASSES[name]
