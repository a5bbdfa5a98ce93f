"""Sections of the configuration without references to others, and the base of all sections."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

from lfs10d.schema.addresses import TopicPrefix
from lfs10d.schema.fields import Choice, Duration, Flag, Size
from lfs10d.schema.steps import Steps

MINUTE, HOUR, DAY = 60.0, 3600.0, 86400.0

RECORD_LENGTHS = (60.0, 120.0, 300.0, 600.0, 900.0, 1200.0, 1800.0, 3600.0)
"""Seconds that divide an hour, so that records begin at full multiples."""


class Section(BaseModel):
    """Strict and frozen: no guessing of types, no unknown keys, no NaN, no change after loading."""

    model_config = ConfigDict(strict=True, extra="forbid", frozen=True, allow_inf_nan=False)


class StoreConfig(Section):
    """The backlog on disk while the broker is unreachable."""

    max_size: Annotated[int, Size(0, 10**13)] = Field(
        512 * 10**6, description="Largest size on disk; below 1MB the backlog is in memory only."
    )
    max_age: Annotated[float, Duration(1, 3650 * DAY)] = Field(7 * DAY, description="Older samples are dropped.")


class LogConfig(Section):
    """What is logged."""

    level: Annotated[Literal["debug", "info", "warning", "error"], Choice(("debug", "info", "warning", "error"))] = (
        Field("info", description="Lowest severity that is logged; debug logs every frame.")
    )
    format: Annotated[Literal["auto", "journal", "text"], Choice(("auto", "journal", "text"))] = Field(
        "auto", description="auto: journal priorities under systemd, coloured text on a terminal."
    )


class HomeassistantConfig(Section):
    """Home Assistant's MQTT discovery."""

    discovery: Annotated[bool, Flag()] = Field(
        default=False, description="Announce the line and its devices to Home Assistant; false takes it back."
    )
    prefix: Annotated[str, TopicPrefix()] = Field(
        "homeassistant", description="The discovery prefix set in Home Assistant's MQTT integration."
    )


class WindConfig(Section):
    """Wind statistics: means, gusts and records of every value that is a wind speed."""

    every: Annotated[float, Duration(1, HOUR)] = Field(
        10.0, description="Time between two `wind` of a device, the figures of the last 2 and 10 min."
    )
    records: Annotated[float, Steps(MINUTE, HOUR, zero="none", steps=RECORD_LENGTHS)] = Field(
        10 * MINUTE, description="Length of a `record`: the same figures for each such span of UTC."
    )
