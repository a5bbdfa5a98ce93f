"""Device classes of Home Assistant's sensors, with the units and the state class that each takes. Pure.

From homeassistant/components/sensor/const.py of Home Assistant 2026.11.0 (`DEVICE_CLASS_UNITS`,
`DEVICE_CLASS_STATE_CLASSES`), without Beaufort: with a device class Home Assistant would convert it to km/h. An entity
with a class that does not take its unit is refused there as a whole, so such a value goes without a class.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from lfs10d.system.dataclass import dataclass

MEASUREMENT: Final = "measurement"

_UNITS: Final[Mapping[str, str]] = {
    "absolute_humidity": "g/m³|mg/m³",
    "apparent_power": "VA|kVA|mVA",
    "aqi": "",
    "area": "ac|cm²|ft²|ha|in²|km²|mi²|mm²|m²|yd²",
    "atmospheric_pressure": "Pa|atm|bar|cbar|hPa|inHg|inH₂O|kPa|mPa|mbar|mmHg|psi",
    "battery": "%",
    "blood_glucose_concentration": "mg/dL|mmol/L",
    "carbon_dioxide": "ppm",
    "carbon_monoxide": "mg/m³|ppb|ppm|μg/m³",
    "conductivity": "S/cm|mS/cm|μS/cm",
    "current": "A|mA|μA",
    "data_rate": "B/s|GB/s|Gbit/s|GiB/s|KiB/s|MB/s|Mbit/s|MiB/s|bit/s|kB/s|kbit/s",
    "data_size": "B|EB|EiB|GB|Gbit|GiB|KiB|MB|Mbit|MiB|PB|PiB|TB|TiB|YB|YiB|ZB|ZiB|bit|kB|kbit",
    "distance": "cm|ft|in|km|m|mi|mm|nmi|yd",
    "duration": "d|h|min|ms|s|μs",
    "energy": "GJ|GWh|Gcal|J|MJ|MWh|Mcal|TWh|Wh|cal|kJ|kWh|kcal|mWh|thm",
    "energy_distance": "Wh/km|kWh/100km|km/kWh|mi/kWh",
    "energy_storage": "GJ|GWh|Gcal|J|MJ|MWh|Mcal|TWh|Wh|cal|kJ|kWh|kcal|mWh|thm",
    "frequency": "GHz|Hz|MHz|kHz|mHz",
    "gas": "CCF|L|MCF|ft³|m³",
    "humidity": "%",
    "illuminance": "lx",
    "irradiance": "BTU/(h⋅ft²)|W/m²",
    "moisture": "%",
    "nitrogen_dioxide": "ppb|ppm|μg/m³",
    "nitrogen_monoxide": "ppb|μg/m³",
    "nitrous_oxide": "μg/m³",
    "ozone": "ppb|ppm|μg/m³",
    "ph": "",
    "pm1": "μg/m³",
    "pm10": "μg/m³",
    "pm25": "μg/m³",
    "pm4": "μg/m³",
    "power": "GW|MW|TW|W|kW|mW",
    "power_factor": "|%",
    "precipitation": "cm|in|mm",
    "precipitation_intensity": "in/d|in/h|mm/d|mm/h",
    "pressure": "Pa|atm|bar|cbar|hPa|inHg|inH₂O|kPa|mPa|mbar|mmHg|psi",
    "radon": "Bq/m³|pCi/L",
    "reactive_energy": "kvarh|varh",
    "reactive_power": "kvar|mvar|var",
    "signal_strength": "dB|dBm",
    "sound_pressure": "dB|dBA",
    "speed": "ft/s|in/d|in/h|in/s|km/h|kn|m/min|m/s|mm/d|mm/h|mm/s|mph",
    "sulphur_dioxide": "ppb|μg/m³",
    "temperature": "K|°C|°F",
    "temperature_delta": "K|°C|°F",
    "volatile_organic_compounds": "mg/m³|μg/m³",
    "volatile_organic_compounds_parts": "ppb|ppm",
    "voltage": "MV|V|kV|mV|μV",
    "volume": "CCF|L|MCF|fl. oz.|ft³|gal|mL|m³",
    "volume_flow_rate": "L/h|L/min|L/s|ft³/min|gal/d|gal/h|gal/min|mL/s|m³/h|m³/min|m³/s",
    "volume_storage": "CCF|L|MCF|fl. oz.|ft³|gal|mL|m³",
    "water": "CCF|L|MCF|ft³|gal|m³",
    "weight": "g|kg|lb|mg|oz|st|μg",
    "wind_direction": "°",
    "wind_speed": "ft/s|in/s|km/h|kn|m/min|m/s|mm/s|mph",
}
"""Units of each class, separated by `|`; an empty one is no unit."""

_STATE_CLASSES: Final[Mapping[str, str]] = {
    "wind_direction": "measurement_angle",
    **dict.fromkeys(("energy", "gas", "reactive_energy", "volume", "water"), "total_increasing"),
}
"""Those that are no plain measurement."""


@dataclass(frozen=True, slots=True)
class SensorClass:
    """What kind of number a sensor shows; `device_class` is None where none fits."""

    device_class: str | None
    state_class: str = MEASUREMENT


def sensor_class(wanted: str | None, unit: str | None) -> SensorClass:
    """Return the class of a value in a unit (None: a bare number), as far as Home Assistant knows it."""
    if wanted is None or wanted not in _UNITS:
        return SensorClass(None)
    # Home Assistant writes the Greek letter mu, and takes the micro sign for it.
    if (unit or "").replace("\N{MICRO SIGN}", "\N{GREEK SMALL LETTER MU}") not in _UNITS[wanted].split("|"):
        return SensorClass(None)
    return SensorClass(wanted, _STATE_CLASSES.get(wanted, MEASUREMENT))
