"""A place is read until it answers, and waited for longer each time."""

from __future__ import annotations

from lfs10d.reconfiguration.journal import Endpoint
from lfs10d.reconfiguration.procedures.identity_query import QUICK, SILENCE
from tests.support.sensors import Pretence

HERE = Endpoint(slave=3, baudrate=9600)


def test_a_patient_read_asks_three_times_and_longer_each_time(pretence: Pretence) -> None:
    query = pretence.query()
    query.timeout = 0.3
    assert pretence.carry_out(query.read_patiently(HERE)) == SILENCE
    assert [ask.timeout for ask in pretence.asked] == [0.3, 0.6, 1.0]


def test_a_patient_read_is_over_with_the_first_answer(pretence: Pretence) -> None:
    pretence.sensor(3)
    assert pretence.carry_out(pretence.query().read_patiently(HERE, register=4)).register == 1
    assert [ask.timeout for ask in pretence.asked] == [QUICK]
