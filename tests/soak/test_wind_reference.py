"""The comparison of `wind` and `record` with a naive reference finds what is wrong, and nothing else."""

from __future__ import annotations

from collections.abc import Iterator
from math import sin
from typing import cast

import pytest

from soak.wind_reference import Comparison, Measured, compare_directions, compare_record, compare_wind
from tests.support.winds import SONIC, Weather, reading, weather


def speed(at: float) -> float:
    return round(9 + 3 * sin(at / 40) + sin(at / 2), 2) + (9 if at > 1000 else 0)


def direction(at: float) -> float:
    return round((350 + 40 * sin(at / 60)) % 360, 1)


@pytest.fixture(scope="module")
def line() -> Weather:
    """20 min with a gap and a discontinuity."""
    line = weather(SONIC)
    for second in range(1, 1250):
        at = second + 0.2
        line.run(at)
        if not 300 < second < 400:
            line.station.on_reading(
                reading("s", at, wind_speed=speed(at), wind_direction=direction(at)), line.instant(at)
            )
    return line


@pytest.fixture
def measured(line: Weather) -> tuple[Measured, Measured]:
    moments = [second + 0.2 for second in range(1, 1250) if not 300 < second < 400]
    columns = [[(line.instant(at).ts(), value(at), 2000) for at in moments] for value in (speed, direction)]
    return Measured(columns[0]), Measured(columns[1])


def test_what_the_daemon_publishes_is_the_reference_s(line: Weather, measured: tuple[Measured, Measured]) -> None:
    made = Comparison()
    for message in line.all("wind"):
        compare_wind(made, message, measured[0], undersampled=False)
        compare_directions(made, message, measured[1])
    for message in line.all("record"):
        compare_record(made, message, measured[0], undersampled=False)
    assert [str(each) for each in made.differences] == []
    assert made.figures > 100 * 20
    assert any(message["discontinuity"] for message in line.all("wind"))


def wrong(message: dict[str, object]) -> Iterator[tuple[str, dict[str, object]]]:
    """Yield the message with one figure wrong, for each figure."""
    said = {"v", "line", "device", "boot", "ts", "time", "clock", "unit", "seq", "from", "to", "discontinuity"}
    compared_elsewhere = {"direction_from", "direction_to", "direction", "direction_stddev"}
    for name, figure in message.items():
        if name in said | compared_elsewhere:
            continue
        change = (
            not figure if isinstance(figure, bool) else cast("float", figure) + (1 if isinstance(figure, int) else 0.2)
        )
        yield name, message | {name: change}


def test_every_wrong_figure_is_found(line: Weather, measured: tuple[Measured, Measured]) -> None:
    [message] = [each for each in line.all("wind") if round(cast("int", each["ts"]) / 1000 - line.shift) == 959]
    for name, broken in wrong(message):
        made = Comparison()
        compare_wind(made, broken, measured[0], undersampled=False)
        compare_directions(made, broken, measured[1])
        assert name in {each.name for each in made.differences}, name
    for name, broken in wrong(line.all("record")[0]):
        made = Comparison()
        compare_record(made, broken, measured[0], undersampled=False)
        assert name in {each.name for each in made.differences}, name
