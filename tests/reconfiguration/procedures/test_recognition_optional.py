"""A device of several values, some of which it may lack, is recognised and told from two."""

from __future__ import annotations

import pytest

from lfs10d.modbus.request import ReadRegisters
from lfs10d.profiles.library import parse_profile
from lfs10d.reconfiguration.journal import Endpoint
from lfs10d.reconfiguration.procedures.identity_query import IdentityReply
from lfs10d.reconfiguration.procedures.recognition import Look, Recognition, look_for_twins, recognise
from tests.support.sensors import Mimic, Pretence

HERE, SILENT = Endpoint(slave=3, baudrate=9600), Endpoint(slave=9, baudrate=9600)
SAYS_3 = IdentityReply(answers=True, register=3)
STATION = parse_profile(
    """
name: station
title: A station
values:
  - {name: rain, register: 0, type: uint16, unit: mm, range: [0, 100], optional: true}
  - {name: speed, register: 1, type: uint16, unit: m/s, range: [0, 60]}
  - {name: gust, register: 2, type: uint16, unit: m/s, range: [0, 60], optional: true}
slave_id: {register: 5}
""",
    "station.yaml",
)
RAIN = parse_profile(
    """
name: rain
title: A rain gauge
values:
  - {name: rain, register: 0, type: uint16, unit: mm, optional: true}
slave_id: {register: 5}
""",
    "rain.yaml",
)


class Registers(Mimic):
    """A device with these registers; it refuses a read of any other."""

    def hold(self, content: dict[int, int]) -> None:
        self._content = content

    def read(self, request: ReadRegisters) -> tuple[int, ...] | int:
        wanted = range(request.address, request.address + request.count)
        if all(register in self._content for register in wanted):
            return tuple(self._content[register] for register in wanted)
        return 2


def holding(pretence: Pretence, content: dict[int, int]) -> Pretence:
    sensor = Registers(3)
    sensor.hold(content)
    pretence.sensors.append(sensor)
    return pretence


@pytest.mark.parametrize(
    ("content", "why"),
    [
        ({0: 1, 1: 2, 2: 3}, None),
        ({1: 2, 2: 3}, None),
        ({1: 2}, None),
        ({1: 61}, "speed 61 m/s is outside 0..60 m/s"),
        ({0: 1, 2: 3}, "it refuses (exception 02) its values at 0x0001"),
    ],
)
def test_optional_registers_may_be_absent_and_the_others_must_be_there(
    pretence: Pretence, content: dict[int, int], why: str | None
) -> None:
    query = holding(pretence, content).query(STATION)
    assert pretence.carry_out(recognise(HERE, SAYS_3, query)) == Recognition(why)


def test_a_device_that_lacks_every_value_is_not_recognised(pretence: Pretence) -> None:
    query = holding(pretence, {}).query(RAIN)
    assert pretence.carry_out(recognise(HERE, SAYS_3, query)) == Recognition("it refuses all its values (exception 02)")


@pytest.mark.parametrize("content", [{0: 1, 1: 2, 2: 3}, {1: 2}])
def test_a_device_without_an_optional_register_can_be_told_from_two(
    pretence: Pretence, content: dict[int, int]
) -> None:
    """It was not answering before: a station whose rain gauge is not fitted could get no other id."""
    query = holding(pretence, content).query(STATION)
    assert pretence.carry_out(look_for_twins(HERE, SILENT, query)) == Look()


def test_a_device_that_refuses_what_it_must_have_is_not_looked_at_further(pretence: Pretence) -> None:
    query = holding(pretence, {0: 1}).query(STATION)
    assert pretence.carry_out(look_for_twins(HERE, SILENT, query)) == Look(answers=False, exception=2)


PARTS = parse_profile(
    """
name: parts
title: A station each of whose values is read alone, or may be absent
values:
  - {name: direction, register: 0, type: uint16, unit: "1", unavailable: [0xFFFF]}
  - {name: rain, register: 2, type: uint16, unit: mm, range: [0, 100], optional: true}
  - {name: snow, register: 3, type: uint16, unit: mm, optional: true}
  - {name: heat, register: 5, type: float32, word_order: high_first, unit: K, optional: true}
slave_id: {register: 9}
""",
    "parts.yaml",
)
NAN = {5: 0x7FC0, 6: 0}


@pytest.mark.parametrize(
    ("content", "why"),
    [
        ({0: 1}, None),
        ({0: 0xFFFF, 3: 1}, None),
        ({0: 0xFFFF, 2: 1} | NAN, None),
        ({0: 0xFFFF, 2: 101}, "rain 101 mm is outside 0..100 mm"),
        ({0: 0xFFFF}, "direction is not available: the device sent 0xFFFF"),
        ({0: 0xFFFF} | NAN, "heat is not a number (NaN): 0x7FC00000"),
    ],
)
def test_one_value_is_enough_where_the_others_are_absent_or_unavailable(
    pretence: Pretence, content: dict[int, int], why: str | None
) -> None:
    query = holding(pretence, content).query(PARTS)
    assert pretence.carry_out(recognise(HERE, SAYS_3, query)) == Recognition(why)


@pytest.mark.parametrize(
    ("content", "look"),
    [
        ({0: 0xFFFF}, Look()),
        ({}, Look(answers=False, exception=2)),
    ],
)
def test_a_value_that_is_unavailable_does_not_show_two_devices(
    pretence: Pretence, content: dict[int, int], look: Look
) -> None:
    query = holding(pretence, content).query(PARTS)
    assert pretence.carry_out(look_for_twins(HERE, SILENT, query)) == look


@pytest.mark.parametrize(
    ("content", "look"),
    [({2: 1}, Look()), ({1: 1}, Look()), ({}, Look(answers=False, exception=2))],
)
def test_of_optional_values_alone_the_one_that_is_there_is_read(
    pretence: Pretence, content: dict[int, int], look: Look
) -> None:
    both = RAIN.model_validate(
        RAIN.model_dump(by_alias=True, exclude_none=True)
        | {
            "values": [
                {"name": f"v{n}", "register": n, "type": "uint16", "unit": "mm", "optional": True} for n in (1, 2)
            ]
        }
    )
    query = holding(pretence, content).query(both)
    assert pretence.carry_out(look_for_twins(HERE, SILENT, query)) == look


IDENTIFIED = PARTS.model_validate(
    PARTS.model_dump(by_alias=True, exclude_none=True) | {"identify": [{"register": 7, "holds": [0x90, 0x91]}]}
)


@pytest.mark.parametrize(
    ("content", "why"),
    [
        ({7: 0x91}, None),
        ({7: 0x92}, "its register 0x0007 holds 0x0092, which is not this device"),
        ({}, "its register 0x0007 does not answer, which is not this device"),
    ],
)
def test_the_registers_that_identify_it_hold_what_the_profile_says(
    pretence: Pretence, content: dict[int, int], why: str | None
) -> None:
    query = holding(pretence, {0: 1} | content).query(IDENTIFIED)
    assert pretence.carry_out(recognise(HERE, SAYS_3, query)) == Recognition(why)
