"""Models of the topics `wind` and `record`, for `docs/mqtt.md` and for the tests, as `docs.generate.payloads` is."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from docs.generate.payloads import Clock, Milliseconds, Payload, Version

Speed = Annotated[float | None, Field(ge=0)]
Share = Annotated[float, Field(ge=0, le=1)]
Time = Annotated[str, Field(pattern=r"^\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d\.\d{3}Z$", description="`ts` in ISO 8601")]
Compass = Annotated[int | None, Field(ge=1, le=360)]


class WindHeader(Payload):
    """What both begin with."""

    v: Version
    line: str
    device: str
    boot: str = Field(min_length=8, max_length=8, description="one run of the daemon, sortable by start")
    ts: Milliseconds
    time: Time
    clock: Clock
    unit: str | None = Field(description="of the speeds; null: a vane alone")


class WindPayload(WindHeader):
    """The wind of the last 2 and 10 min; a vane adds the directions. See [wind.md](wind.md)."""

    mean_2m: Speed = Field(description="mean of the last 2 min; null: less than half of them covered, as of every mean")
    mean_10m: Speed = Field(description="mean of the last 10 min, or since a discontinuity")
    gust_3s: Speed = Field(description="the newest mean of 3 s; null: none is, or the value is old")
    gust_10m: Speed = Field(description="greatest mean of 3 s within the last 10 min, or since a discontinuity")
    gust_10m_ts: Milliseconds | None
    lull_10m: Speed = Field(description="least mean of 3 s within the same")
    lull_10m_ts: Milliseconds | None
    max_10m: Speed = Field(description="greatest single sample of the last 10 min")
    stddev_10m: Speed = Field(description="standard deviation about `mean_10m`")
    turbulence_10m: float | None = Field(ge=0, description="`stddev_10m` / `mean_10m`; null below 5 m/s")
    gust_reported: bool = Field(description="`gust_10m` exceeds `mean_10m` by 5 m/s or more")
    beaufort: int | None = Field(ge=0, le=12, description="of `mean_10m`")
    calm: bool | None = Field(description="`mean_10m` is below 0.5 m/s")
    discontinuity: bool = Field(description="the last 2 min differ from the 10 min before by 5 m/s or more")
    samples_10m: int = Field(ge=0, description="good samples of the last 10 min")
    coverage_2m: Share = Field(description="part of the last 2 min for which there is a value")
    coverage_10m: Share = Field(description="part of 10 min that `mean_10m` rests on")
    undersampled: bool = Field(description="the interval is above 1 s: no gust and no lull")
    direction_2m: Compass = Field(None, description="mean of the last 2 min; null too where directions cancel out")
    direction_10m: Compass = Field(None, description="mean of the last 10 min")
    direction_stddev_10m: float | None = Field(None, ge=0, description="in degrees, by Yamartino")
    variable: bool | None = Field(None, description="directions of the last 10 min differ by 60° or more")
    direction_from: Compass = Field(None, description="extreme directions, clockwise from here; null unless reported")
    direction_to: Compass = Field(None, description="to here")


class RecordPayload(WindHeader):
    """The wind of one whole span of UTC, [`from`, `to`); a vane adds the directions. See [wind.md](wind.md)."""

    ts: Milliseconds = Field(description="as `to`")
    seq: int = Field(ge=1, description="of the records, from 1 per device and boot, without gaps")
    from_: int = Field(alias="from", description="epoch milliseconds, UTC")
    to: Milliseconds
    mean: Speed = Field(description="null: less than half covered")
    gust: Speed = Field(description="greatest mean of 3 s")
    gust_ts: Milliseconds | None
    lull: Speed = Field(description="least mean of 3 s")
    lull_ts: Milliseconds | None
    max: Speed = Field(description="greatest single sample")
    stddev: Speed = Field(description="standard deviation about `mean`")
    samples: int = Field(ge=0, description="good samples")
    coverage: Share = Field(description="part for which there is a value")
    direction: Compass = Field(None, description="mean")
    direction_stddev: float | None = Field(None, ge=0, description="in degrees, by Yamartino")
    historical: Literal[True] | None = Field(None, description="set where it waited for the broker")
