"""Several values, of which one may be missing or old."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import cast

from lfs10d.reading import NOTHING, Fault, FaultCode, Reading, Value
from lfs10d.telemetry.device_state import DeviceState
from lfs10d.telemetry.publication import Publication
from tests.support.device_states import Watched, fields, instant, leaves
from tests.support.stations import ONE_VALUE

STATION = replace(
    ONE_VALUE, value_names=("wind_speed", "rain", "weather"), units=dict.fromkeys(("wind_speed", "rain"), "1")
)


class Station(Watched):
    """A device of three values."""

    def __init__(self) -> None:
        self.device = DeviceState(STATION, line="line0", boot="k3f9a2c7", seq=0, now=instant(0))

    def partly(self, at: float, ages: Mapping[str, float] = NOTHING, **errors: str) -> list[Publication]:
        values: dict[str, Value | None] = {"weather": "dry", "wind_speed": 1.5, "rain": 0.2}
        values |= dict.fromkeys(errors)
        codes = {name: FaultCode(code) for name, code in errors.items()}
        reading = Reading("a", at, values, None, 0.01, True, 0.2, value_errors=codes, ages=ages)  # noqa: FBT003 - online
        return self.device.on_reading(reading, instant(at), masked=False)[0]


def test_of_several_values_one_may_be_missing_and_the_others_stay() -> None:
    station = Station()
    payload = station.partly(1, rain="exception")[0].payload
    assert isinstance(payload, dict)
    assert [*payload][8:] == ["wind_speed", "rain", "weather", "units", "quality", "error", "rtt_ms", "errors"]
    assert fields(payload, "wind_speed", "rain", "weather", "rtt_ms") == (1.5, None, "dry", 10.0)
    assert fields(payload, "quality", "error", "errors") == ("partial", None, {"rain": "exception"})
    assert station.shown["availability"] == "online"
    assert fields(station.shown["stats"], "polls", "good", "partial", "errors") == (1, 1, 1, {})
    snapshot = station.device.snapshot(instant(1))
    assert list(cast("Mapping[str, object]", snapshot["values"]).items()) == [
        ("wind_speed", 1.5), ("rain", None), ("weather", "dry"),
    ]  # fmt: skip
    assert fields(snapshot, "quality", "error", "errors", "age_s") == ("partial", None, {"rain": "exception"}, 0.0)


def test_another_missing_value_or_reason_is_shown_at_once() -> None:
    station = Station()
    station.partly(1.0)
    assert "state" in leaves(station.partly(1.1, rain="exception"))
    assert "state" not in leaves(station.partly(1.2, rain="exception"))
    assert "state" in leaves(station.partly(1.3, rain="unavailable"))
    assert "state" in leaves(station.partly(1.4, weather="unavailable"))
    assert "state" in leaves(station.partly(1.5))


def test_a_partial_sample_ends_an_error_and_no_value_at_all_is_bad() -> None:
    station = Station()
    none = Fault(FaultCode.UNAVAILABLE, "wind_speed is unavailable")
    for at in (1, 2, 3):
        told = station.publish(at, none, online=True)
        assert fields(told[0].payload, "quality", "error", "rain", "rtt_ms") == ("bad", "unavailable", None, None)
        assert "errors" not in cast("Mapping[str, object]", told[0].payload)
    assert fields(station.shown["error"], "active", "code") == (True, "unavailable")
    assert station.shown["availability"] == "online"
    station.partly(4, weather="unavailable")
    assert fields(station.shown["error"], "active", "last_code") == (False, "unavailable")


def test_the_age_of_a_value_asked_more_rarely_stands_in_its_sample() -> None:
    station = Station()
    assert "ages" not in cast("Mapping[str, object]", station.partly(1)[0].payload)
    payload = station.partly(2, {"rain": 34.21749})[0].payload
    assert fields(payload, "quality", "rain", "ages") == ("good", 0.2, {"rain": 34.217})
    assert station.device.snapshot(instant(2))["ages"] == {"rain": 34.217}
