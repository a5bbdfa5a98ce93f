"""One sensor alone, told from two of one id by its answers and values."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import chain, cycle, repeat
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lfs10d.modbus.duplicates import TELLING
from lfs10d.modbus.request import ReadRegisters
from lfs10d.reading import FaultCode
from lfs10d.reconfiguration.procedures.identity_query import QUICK
from lfs10d.reconfiguration.procedures.recognition import (
    CROSSINGS,
    LEAST,
    MORE_READS,
    READS,
    Look,
    jumps,
    look_for_twins,
)
from tests.support.recognitions import HERE, SILENT, VANE, spoil, words
from tests.support.sensors import CODEC, LFS10, Mimic, Pretence, outcome_of

WIND = LFS10.values[0]
DIRECTION, BARE = VANE.values


class Blowing(Mimic):
    """A sensor whose value is another one at each read."""

    def blow(self, numbers: Iterable[float]) -> None:
        self._numbers: Iterator[float] = iter(numbers)

    def read(self, request: ReadRegisters) -> tuple[int, ...] | int:
        return words(next(self._numbers)) if request.address == 1 else super().read(request)


def look(pretence: Pretence) -> Look:
    return pretence.carry_out(look_for_twins(HERE, SILENT, pretence.query()))


def blowing(pretence: Pretence, numbers: Iterable[float]) -> Look:
    sensor = Blowing(3)
    sensor.blow(numbers)
    pretence.sensors.append(sensor)
    return look(pretence)


def test_one_sensor_is_read_three_times_and_the_line_is_listened_to_behind_each_read(pretence: Pretence) -> None:
    pretence.sensor(3)
    assert look(pretence) == Look()
    assert [(ask.request.slave, ask.at_once) for ask in pretence.asked] == READS * [(3, False), (9, True)]
    assert [ask.timeout for ask in pretence.asked[1::2]] == [0.2, 0.2, 0.6]


def test_answers_that_collide_are_of_two(pretence: Pretence) -> None:
    pretence.sensor(3)
    pretence.sensor(3, wind=(0, 0))
    assert look(pretence) == Look(twins="answers collide there")


@pytest.mark.parametrize("number", [0, 2, 4])
def test_one_collision_in_three_reads_is_enough(
    pretence: Pretence, monkeypatch: pytest.MonkeyPatch, number: int
) -> None:
    pretence.sensor(3)
    spoil(pretence, monkeypatch, {number: outcome_of(ReadRegisters(3, 1, 2), FaultCode.CRC)})
    assert look(pretence) == Look(twins="answers collide there")


@pytest.mark.parametrize("number", [1, 3, 5])
def test_a_second_answer_behind_the_first_is_of_another(
    pretence: Pretence, monkeypatch: pytest.MonkeyPatch, number: int
) -> None:
    pretence.sensor(3)
    frame = CODEC.wrap(bytes((3, 3, 4, 0, 0, 0, 0)))
    extra = outcome_of(ReadRegisters(9, 1, 2), FaultCode.WRONG_SLAVE, heard=frame, unsolicited=len(frame))
    spoil(pretence, monkeypatch, {number: extra})
    assert look(pretence) == Look(twins="a second answer came behind the first")


def test_a_late_answer_to_an_older_question_is_its_own(pretence: Pretence, monkeypatch: pytest.MonkeyPatch) -> None:
    pretence.sensor(3)
    frame = CODEC.wrap(bytes((3, 3, 4, 0, 0, 0, 0)))
    late = outcome_of(ReadRegisters(9, 1, 2), FaultCode.LATE, heard=frame, late=(late_answer(),))
    spoil(pretence, monkeypatch, {1: late})
    assert look(pretence) == Look()


def late_answer() -> Any:  # noqa: ANN401 - the package's own type, built here alone
    from lfs10d.modbus.outcome import LateAnswer  # noqa: PLC0415 - beside its one use

    return LateAnswer(ReadRegisters(3, 1, 2), 0.3)


@pytest.mark.parametrize(("slave", "noise"), [(9, False), (9, True)])
def test_anything_received_from_the_new_id_means_that_it_is_taken(
    pretence: Pretence, slave: int, *, noise: bool
) -> None:
    pretence.sensor(3)
    if noise:
        pretence.noise.add((slave, 9600))
    else:
        pretence.sensor(slave)
    assert look(pretence) == Look(taken=True)


def test_bytes_that_come_behind_a_read_only_are_of_another(pretence: Pretence, monkeypatch: pytest.MonkeyPatch) -> None:
    pretence.sensor(3)
    spoil(pretence, monkeypatch, {1: outcome_of(ReadRegisters(9, 1, 2), FaultCode.MALFORMED)})
    assert look(pretence) == Look(twins="something is received behind its answer")


def test_a_value_that_cannot_be_is_of_two(pretence: Pretence) -> None:
    pretence.sensor(3, wind=words(1e6))
    found = look(pretence)
    assert found.twins is not None
    assert found.twins.startswith("its values are impossible: wind_speed")


def test_one_that_gives_no_value_is_not_there(pretence: Pretence) -> None:
    assert look(pretence) == Look(answers=False)
    pretence.sensor(3, exception=4)
    assert look(pretence) == Look(answers=False, exception=4)
    assert pretence.asked[-1].timeout > QUICK


def test_one_silence_is_asked_again(pretence: Pretence, monkeypatch: pytest.MonkeyPatch) -> None:
    pretence.sensor(3)
    spoil(pretence, monkeypatch, {0: outcome_of(ReadRegisters(3, 1, 2), FaultCode.TIMEOUT)})
    assert look(pretence) == Look()


# -- values of two


@pytest.mark.parametrize(
    "numbers",
    [
        [5.0, 5.0, 5.0],
        [5.0, 9.0, 14.0],  # a gust that rises
        [5.0, 9.0, 5.1, *repeat(5.2, 6)],  # one that came and went
        [5.0, 9.0, 5.1, 7.0, 8.0, 6.0, 5.5, 9.5, 5.0],  # turbulence
        [0.0, 0.7, 0.0, 0.7, 0.0, 0.7, 0.0, 0.7, 0.0],  # the last digit flickers
    ],
)
def test_the_wind_of_one_sensor_may_vary_as_it_likes(pretence: Pretence, numbers: list[float]) -> None:
    assert blowing(pretence, numbers) == Look()


def test_values_that_take_turns_are_of_two(pretence: Pretence) -> None:
    found = blowing(pretence, cycle([3.0, 12.5, 3.1, 12.4]))
    assert found == Look(twins="its values jump back and forth between 3 and 12.5 m/s")
    assert len(pretence.asked) == 2 * READS + MORE_READS


def test_a_collision_among_the_further_reads_is_of_two(pretence: Pretence, monkeypatch: pytest.MonkeyPatch) -> None:
    spoil(pretence, monkeypatch, {7: outcome_of(ReadRegisters(3, 1, 2), FaultCode.CRC)})
    assert blowing(pretence, chain([3.0, 12.5, 3.1], repeat(3.0))).twins == "answers collide there"


def test_a_vane_around_north_is_one(pretence: Pretence) -> None:
    del pretence
    assert jumps(DIRECTION, [359.0, 1.0, 359.0]) == 0
    assert jumps(DIRECTION, [90.0, 270.0, 90.0]) == 2


def test_values_without_a_range_are_not_judged() -> None:
    assert jumps(BARE, [0.0, 60000.0, 0.0]) == 0


@given(st.lists(st.floats(0, 100), min_size=2, max_size=9), st.floats(0, 1))
def test_what_only_rises_or_falls_never_takes_turns(numbers: list[float], tip: float) -> None:
    assert jumps(WIND, sorted(numbers)) < CROSSINGS - 1
    assert jumps(WIND, sorted(numbers, reverse=True)) < CROSSINGS - 1
    assert jumps(WIND, [50 + each / 100 * LEAST * 100 * tip for each in numbers]) == 0


def test_a_second_answer_to_earlier_requests_shows_two() -> None:
    """The slave rests until that one has come, so that no read is followed by it."""
    pretence = Pretence()
    pretence.sensor(3)
    assert look(pretence) == Look()
    for _ in range(TELLING):
        pretence.pending.duplicates.answered(3, pretence.clock.now)
        pretence.pending.duplicates.second(3, pretence.clock.now + 0.75)
        pretence.clock.now += 2.0
    assert look(pretence).twins == "a second answer comes to each request"
