"""The units that each sensor device class of Home Assistant takes.

`DEVICE_CLASS_UNITS` and `DEVICE_CLASS_STATE_CLASSES` of homeassistant/components/sensor/const.py in the wheel
homeassistant==2026.11.0, as its interpreter printed them.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

DEVICE_CLASS_UNITS: Final[Mapping[str, frozenset[str]]] = {
    "absolute_humidity": frozenset(["g/m³", "mg/m³"]),
    "apparent_power": frozenset(["VA", "kVA", "mVA"]),
    "aqi": frozenset([""]),
    "area": frozenset(["ac", "cm²", "ft²", "ha", "in²", "km²", "mi²", "mm²", "m²", "yd²"]),
    "atmospheric_pressure": frozenset(
        ["Pa", "atm", "bar", "cbar", "hPa", "inHg", "inH₂O", "kPa", "mPa", "mbar", "mmHg", "psi"]
    ),
    "battery": frozenset(["%"]),
    "blood_glucose_concentration": frozenset(["mg/dL", "mmol/L"]),
    "carbon_dioxide": frozenset(["ppm"]),
    "carbon_monoxide": frozenset(["mg/m³", "ppb", "ppm", "μg/m³"]),
    "conductivity": frozenset(["S/cm", "mS/cm", "μS/cm"]),
    "current": frozenset(["A", "mA", "μA"]),
    "data_rate": frozenset(
        ["B/s", "GB/s", "Gbit/s", "GiB/s", "KiB/s", "MB/s", "Mbit/s", "MiB/s", "bit/s", "kB/s", "kbit/s"]
    ),
    "data_size": frozenset(
        [
            "B",
            "EB",
            "EiB",
            "GB",
            "Gbit",
            "GiB",
            "KiB",
            "MB",
            "Mbit",
            "MiB",
            "PB",
            "PiB",
            "TB",
            "TiB",
            "YB",
            "YiB",
            "ZB",
            "ZiB",
            "bit",
            "kB",
            "kbit",
        ]
    ),
    "distance": frozenset(["cm", "ft", "in", "km", "m", "mi", "mm", "nmi", "yd"]),
    "duration": frozenset(["d", "h", "min", "ms", "s", "μs"]),
    "energy": frozenset(
        ["GJ", "GWh", "Gcal", "J", "MJ", "MWh", "Mcal", "TWh", "Wh", "cal", "kJ", "kWh", "kcal", "mWh", "thm"]
    ),
    "energy_distance": frozenset(["Wh/km", "kWh/100km", "km/kWh", "mi/kWh"]),
    "energy_storage": frozenset(
        ["GJ", "GWh", "Gcal", "J", "MJ", "MWh", "Mcal", "TWh", "Wh", "cal", "kJ", "kWh", "kcal", "mWh", "thm"]
    ),
    "frequency": frozenset(["GHz", "Hz", "MHz", "kHz", "mHz"]),
    "gas": frozenset(["CCF", "L", "MCF", "ft³", "m³"]),
    "humidity": frozenset(["%"]),
    "illuminance": frozenset(["lx"]),
    "irradiance": frozenset(["BTU/(h⋅ft²)", "W/m²"]),
    "moisture": frozenset(["%"]),
    "nitrogen_dioxide": frozenset(["ppb", "ppm", "μg/m³"]),
    "nitrogen_monoxide": frozenset(["ppb", "μg/m³"]),
    "nitrous_oxide": frozenset(["μg/m³"]),
    "ozone": frozenset(["ppb", "ppm", "μg/m³"]),
    "ph": frozenset([""]),
    "pm1": frozenset(["μg/m³"]),
    "pm10": frozenset(["μg/m³"]),
    "pm25": frozenset(["μg/m³"]),
    "pm4": frozenset(["μg/m³"]),
    "power": frozenset(["GW", "MW", "TW", "W", "kW", "mW"]),
    "power_factor": frozenset(["", "%"]),
    "precipitation": frozenset(["cm", "in", "mm"]),
    "precipitation_intensity": frozenset(["in/d", "in/h", "mm/d", "mm/h"]),
    "pressure": frozenset(["Pa", "atm", "bar", "cbar", "hPa", "inHg", "inH₂O", "kPa", "mPa", "mbar", "mmHg", "psi"]),
    "radon": frozenset(["Bq/m³", "pCi/L"]),
    "reactive_energy": frozenset(["kvarh", "varh"]),
    "reactive_power": frozenset(["kvar", "mvar", "var"]),
    "signal_strength": frozenset(["dB", "dBm"]),
    "sound_pressure": frozenset(["dB", "dBA"]),
    "speed": frozenset(
        ["Beaufort", "ft/s", "in/d", "in/h", "in/s", "km/h", "kn", "m/min", "m/s", "mm/d", "mm/h", "mm/s", "mph"]
    ),
    "sulphur_dioxide": frozenset(["ppb", "μg/m³"]),
    "temperature": frozenset(["K", "°C", "°F"]),
    "temperature_delta": frozenset(["K", "°C", "°F"]),
    "volatile_organic_compounds": frozenset(["mg/m³", "μg/m³"]),
    "volatile_organic_compounds_parts": frozenset(["ppb", "ppm"]),
    "voltage": frozenset(["MV", "V", "kV", "mV", "μV"]),
    "volume": frozenset(["CCF", "L", "MCF", "fl. oz.", "ft³", "gal", "mL", "m³"]),
    "volume_flow_rate": frozenset(
        ["L/h", "L/min", "L/s", "ft³/min", "gal/d", "gal/h", "gal/min", "mL/s", "m³/h", "m³/min", "m³/s"]
    ),
    "volume_storage": frozenset(["CCF", "L", "MCF", "fl. oz.", "ft³", "gal", "mL", "m³"]),
    "water": frozenset(["CCF", "L", "MCF", "ft³", "gal", "m³"]),
    "weight": frozenset(["g", "kg", "lb", "mg", "oz", "st", "μg"]),
    "wind_direction": frozenset(["°"]),
    "wind_speed": frozenset(["Beaufort", "ft/s", "in/s", "km/h", "kn", "m/min", "m/s", "mm/s", "mph"]),
}
"""An empty one is no unit."""

STATE_CLASSES: Final[Mapping[str, frozenset[str]]] = {
    "absolute_humidity": frozenset(["measurement"]),
    "apparent_power": frozenset(["measurement"]),
    "aqi": frozenset(["measurement"]),
    "area": frozenset(["measurement", "measurement_angle", "total", "total_increasing"]),
    "atmospheric_pressure": frozenset(["measurement"]),
    "battery": frozenset(["measurement"]),
    "blood_glucose_concentration": frozenset(["measurement"]),
    "carbon_dioxide": frozenset(["measurement"]),
    "carbon_monoxide": frozenset(["measurement"]),
    "conductivity": frozenset(["measurement"]),
    "current": frozenset(["measurement"]),
    "data_rate": frozenset(["measurement"]),
    "data_size": frozenset(["measurement", "measurement_angle", "total", "total_increasing"]),
    "distance": frozenset(["measurement", "measurement_angle", "total", "total_increasing"]),
    "duration": frozenset(["measurement", "measurement_angle", "total", "total_increasing"]),
    "energy": frozenset(["total", "total_increasing"]),
    "energy_distance": frozenset(["measurement"]),
    "energy_storage": frozenset(["measurement"]),
    "frequency": frozenset(["measurement"]),
    "gas": frozenset(["total", "total_increasing"]),
    "humidity": frozenset(["measurement"]),
    "illuminance": frozenset(["measurement"]),
    "irradiance": frozenset(["measurement"]),
    "moisture": frozenset(["measurement"]),
    "nitrogen_dioxide": frozenset(["measurement"]),
    "nitrogen_monoxide": frozenset(["measurement"]),
    "nitrous_oxide": frozenset(["measurement"]),
    "ozone": frozenset(["measurement"]),
    "ph": frozenset(["measurement"]),
    "pm1": frozenset(["measurement"]),
    "pm10": frozenset(["measurement"]),
    "pm25": frozenset(["measurement"]),
    "pm4": frozenset(["measurement"]),
    "power": frozenset(["measurement"]),
    "power_factor": frozenset(["measurement"]),
    "precipitation": frozenset(["measurement", "measurement_angle", "total", "total_increasing"]),
    "precipitation_intensity": frozenset(["measurement"]),
    "pressure": frozenset(["measurement"]),
    "radon": frozenset(["measurement"]),
    "reactive_energy": frozenset(["total", "total_increasing"]),
    "reactive_power": frozenset(["measurement"]),
    "signal_strength": frozenset(["measurement"]),
    "sound_pressure": frozenset(["measurement"]),
    "speed": frozenset(["measurement"]),
    "sulphur_dioxide": frozenset(["measurement"]),
    "temperature": frozenset(["measurement"]),
    "temperature_delta": frozenset(["measurement"]),
    "volatile_organic_compounds": frozenset(["measurement"]),
    "volatile_organic_compounds_parts": frozenset(["measurement"]),
    "voltage": frozenset(["measurement"]),
    "volume": frozenset(["total", "total_increasing"]),
    "volume_flow_rate": frozenset(["measurement"]),
    "volume_storage": frozenset(["measurement"]),
    "water": frozenset(["total", "total_increasing"]),
    "weight": frozenset(["measurement", "total", "total_increasing"]),
    "wind_direction": frozenset(["measurement_angle"]),
    "wind_speed": frozenset(["measurement"]),
}
"""`DEVICE_CLASS_STATE_CLASSES` of the same file."""
