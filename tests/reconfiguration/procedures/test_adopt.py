"""A factory-new sensor is found, brought to the line's rate and given a free id, or nothing is written."""

from __future__ import annotations

from typing import Any

import pytest

from lfs10d.modbus.request import ReadRegisters, WriteRegister
from lfs10d.reconfiguration.journal import Endpoint
from lfs10d.reconfiguration.procedures.adopt import AdoptReport, AdoptWish, adopt
from lfs10d.reconfiguration.procedures.readdress import IdWrite, ReaddressEnding, ReaddressReport
from lfs10d.reconfiguration.procedures.recognition import READS
from tests.support.sensors import Mimic, Pretence

WISH = AdoptWish(1, (2, 3), 9600, (9600, 19200))
AT_9600, AT_19200 = Endpoint(slave=1, baudrate=9600), Endpoint(slave=1, baudrate=19200)


def adopted(pretence: Pretence, wish: AdoptWish = WISH, *, echo_known: bool = True) -> AdoptReport:
    return pretence.carry_out(adopt(wish, pretence.query(), lambda: echo_known))


def questions_before_the_first_write(pretence: Pretence) -> int:
    """Return how many questions are asked of this line before anything is written, and forget them."""
    pretence.answer = "not now"
    adopted(pretence)
    count = len(pretence.asked)
    pretence.asked.clear()
    pretence.answer = None
    return count


def test_one_at_the_lines_rate_gets_the_first_free_id(pretence: Pretence) -> None:
    pretence.sensor(1)
    assert adopted(pretence) == AdoptReport(ReaddressReport(ReaddressEnding.MOVED, 2), AT_9600, 2)
    assert pretence.writes == [WriteRegister(1, 5, 2)]
    assert pretence.awaited == [IdWrite(AT_9600, Endpoint(slave=2, baudrate=9600), 1)]


def test_one_at_another_rate_is_brought_to_the_lines_first(pretence: Pretence) -> None:
    pretence.sensor(1, baudrate=19200)
    assert adopted(pretence) == AdoptReport(ReaddressReport(ReaddressEnding.MOVED, 2), AT_19200, 2)
    assert pretence.writes == [WriteRegister(1, 4, 1), WriteRegister(1, 5, 2)]
    assert len(pretence.awaited) == 1


@pytest.mark.parametrize("rate", [9600, 19200])
def test_an_id_at_which_anything_is_heard_at_any_rate_is_passed_over(pretence: Pretence, rate: int) -> None:
    pretence.sensor(1)
    pretence.sensor(2, baudrate=rate)
    assert adopted(pretence).to == 3


def test_where_no_id_is_free_nothing_is_written(pretence: Pretence) -> None:
    pretence.sensor(1)
    pretence.noise.update({(2, 9600), (3, 19200)})
    assert adopted(pretence) == AdoptReport(ReaddressReport(ReaddressEnding.TAKEN, at=9600), AT_9600, 2)
    nobody = AdoptWish(1, (), 9600, (9600,))
    assert adopted(pretence, nobody) == AdoptReport(ReaddressReport(ReaddressEnding.TAKEN, at=9600), AT_9600, None)
    assert pretence.writes == []


def test_without_a_newcomer_there_is_nothing_to_do(pretence: Pretence) -> None:
    assert adopted(pretence) == AdoptReport(ReaddressReport(ReaddressEnding.ABSENT))


def test_two_newcomers_at_two_rates_are_left_alone(pretence: Pretence) -> None:
    pretence.sensor(1)
    pretence.sensor(1, baudrate=19200)
    assert adopted(pretence) == AdoptReport(ReaddressReport(ReaddressEnding.BOTH, at=9600), AT_9600)
    assert pretence.writes == []


def test_two_at_one_rate_are_told_by_their_winds(pretence: Pretence) -> None:
    pretence.sensor(1)
    pretence.sensor(1, wind=(0, 0))
    assert adopted(pretence) == AdoptReport(ReaddressReport(ReaddressEnding.BOTH, 1, at=9600), AT_9600)


def test_garbage_at_the_factory_id_is_no_newcomer(pretence: Pretence) -> None:
    pretence.noise.add((1, 19200))
    assert adopted(pretence) == AdoptReport(ReaddressReport(ReaddressEnding.BOTH, at=19200), AT_19200)


def test_without_knowing_how_the_adapter_echoes_nothing_is_written(pretence: Pretence) -> None:
    pretence.sensor(1)
    assert adopted(pretence, echo_known=False) == AdoptReport(ReaddressReport(ReaddressEnding.DEAF), AT_9600, 2)
    assert pretence.writes == []


def test_reads_that_teach_the_echo_are_enough(pretence: Pretence) -> None:
    pretence.sensor(1)
    before = questions_before_the_first_write(pretence)
    steps = adopt(WISH, pretence.query(), lambda: len(pretence.asked) >= before)
    assert pretence.carry_out(steps).readdress.ending is ReaddressEnding.MOVED


def test_a_newcomer_that_is_gone_meanwhile_is_not_written_to(pretence: Pretence) -> None:
    sensor = pretence.sensor(1)
    pretence.later.append((2.0, lambda: setattr(sensor, "silent", True)))
    assert adopted(pretence) == AdoptReport(ReaddressReport(ReaddressEnding.ABSENT), AT_9600, 2)
    assert pretence.writes == []


def test_nothing_is_written_where_the_intent_cannot_be_kept(pretence: Pretence) -> None:
    pretence.sensor(1)
    pretence.answer = "the disk is full"
    assert adopted(pretence) == AdoptReport(
        ReaddressReport(ReaddressEnding.UNWRITTEN, why="the disk is full"), AT_9600, 2
    )
    assert pretence.writes == []


def test_a_port_lost_before_the_write_is_told_as_that(pretence: Pretence) -> None:
    pretence.sensor(1)
    pretence.lost_at = 1
    assert adopted(pretence) == AdoptReport(ReaddressReport(ReaddressEnding.LOST_BEFORE))


def test_a_port_lost_after_the_write_leaves_the_change_open(pretence: Pretence) -> None:
    pretence.sensor(1)
    pretence.lost_at = questions_before_the_first_write(pretence) + 1
    assert adopted(pretence) == AdoptReport(ReaddressReport(ReaddressEnding.NOWHERE, stays_open=True), AT_9600, 2)


@pytest.mark.parametrize(
    ("manner", "report"),
    [
        ("stores", ReaddressReport(ReaddressEnding.PENDING)),
        ("vanishes", ReaddressReport(ReaddressEnding.NOWHERE, stays_open=True)),
        ("refuses", ReaddressReport(ReaddressEnding.REFUSED, exception=3)),
        ("refuses_and_stores", ReaddressReport(ReaddressEnding.REFUSED, exception=3)),
    ],
)
def test_one_that_does_not_come_to_the_lines_rate_keeps_its_id(
    pretence: Pretence, manner: str, report: ReaddressReport
) -> None:
    pretence.sensor(1, baudrate=19200, manner=manner)
    assert adopted(pretence) == AdoptReport(report, AT_19200, 2, at_rate=False)
    assert {write.address for write in pretence.writes} == {4}


def test_two_newcomers_that_part_when_brought_to_the_lines_rate_are_told(pretence: Pretence) -> None:
    sensors = [pretence.sensor(1, baudrate=19200), pretence.sensor(1, baudrate=19200, manner="stores")]
    found = adopted(pretence)
    assert (found.readdress.ending, found.readdress.stays_open, found.at_rate) == (ReaddressEnding.BOTH, False, False)
    assert [sensor.baudrate for sensor in sensors] == [19200, 19200]


@pytest.mark.parametrize(
    ("facts", "why"),
    [
        ({"exception": 2}, "it refuses register 0x0005 (exception 02)"),
        ({"exception": 11}, "it refuses register 0x0005 (exception 0B)"),
        ({"stored": {5: 700}}, "its register 0x0005 says 700, not 1"),
        ({"stored": {4: 9}}, "its register 0x0004 says 9, which is no rate"),
    ],
)
def test_a_device_that_is_not_recognised_is_not_written_to(pretence: Pretence, facts: dict[str, Any], why: str) -> None:
    pretence.sensor(1, baudrate=19200, **facts)
    found = adopted(pretence)
    assert (found.readdress.ending, found.readdress.why, found.readdress.at) == (
        ReaddressEnding.UNRECOGNISED,
        why,
        19200,
    )
    assert pretence.writes == pretence.awaited == []


class Changing(Mimic):
    """Its values become impossible after a few reads."""

    reads = 0

    def read(self, request: ReadRegisters) -> tuple[int, ...] | int:
        self.reads += request.address == 1
        return (0x4974, 0x2400) if request.address == 1 and self.reads > READS else super().read(request)


def test_two_that_show_only_after_one_was_recognised_are_not_written_to(pretence: Pretence) -> None:
    pretence.sensors.append(Changing(1))
    found = adopted(pretence)
    assert (found.readdress.ending, found.to) == (ReaddressEnding.TWINS, 2)
    assert pretence.writes == []


def test_a_newcomer_that_is_gone_before_the_write_is_not_written_to(pretence: Pretence) -> None:
    sensor = pretence.sensor(1)
    assert pretence.carry_out(adopt(WISH, pretence.query(), lambda: vanish(sensor))).readdress == ReaddressReport(
        ReaddressEnding.ABSENT
    )
    assert pretence.writes == []


def vanish(sensor: Mimic) -> bool:
    sensor.silent = True
    return True


def test_one_that_came_at_a_rate_without_a_code_is_brought_back_to_it(pretence: Pretence) -> None:
    sensors = [pretence.sensor(1, baudrate=4800), pretence.sensor(1, baudrate=4800, manner="stores")]
    for sensor in sensors:
        sensor.codes = {0: 4800, 1: 9600, 2: 19200}
    found = adopted(pretence, AdoptWish(1, (2,), 9600, (9600, 4800, 19200)))
    assert (found.readdress.ending, found.readdress.stays_open) == (ReaddressEnding.BOTH, False)
    assert [sensor.baudrate for sensor in sensors] == [4800, 4800]
    assert WriteRegister(1, 4, 0) in pretence.writes
