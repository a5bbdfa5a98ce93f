"""The configured devices of a line: who stays the same in another configuration, and what is learned of them."""

from __future__ import annotations

from dataclasses import replace

import pytest

from lfs10d.line.device import LEARNED_MOST, Health, PollRules
from lfs10d.line.devices import START_PATIENT, Devices
from lfs10d.modbus.outcome import LateAnswer
from lfs10d.modbus.request import ReadRegisters
from lfs10d.reading import Fault, FaultCode
from tests.support.outcomes import ended
from tests.support.schedules import spec

RULES = PollRules()
WIND = ReadRegisters(1, 0x0001, 2)
ELSEWHERE = ReadRegisters(9, 0x0001, 2)


@pytest.fixture
def devices() -> Devices:
    """Return slaves 1 and 2, of which the first learned that it needs 0.2 s of rest."""
    made = Devices()
    made.replace([spec(1), spec(2)], RULES, port_lost=False)
    made["slave-1"].gap.learned = 0.2
    return made


def test_new_devices_need_a_grid_and_are_found_by_slave_id() -> None:
    devices = Devices()
    fresh = devices.replace([spec(1), spec(2)], RULES, port_lost=False)
    assert [device.name for device in fresh] == ["slave-1", "slave-2"]
    assert devices.by_slave == {1: devices["slave-1"], 2: devices["slave-2"]}
    assert fresh[0].health is Health.UNHEARD


def test_what_stays_is_the_same_device_by_the_new_rules(devices: Devices) -> None:
    kept, rules = devices["slave-1"], PollRules(retries=5)
    assert devices.replace([replace(spec(1), request_gap=0.5)], rules, port_lost=False) == []
    assert list(devices.values()) == [kept]
    assert devices["slave-1"] is kept
    assert (kept.rules, kept.gap.configured) == (rules, 0.5)


def test_a_calibrated_device_is_the_same_and_read_by_its_new_profile(devices: Devices) -> None:
    kept = devices["slave-1"]
    profile = kept.spec.profile.calibrated({"wind_speed": (2, 0)})
    assert devices.replace([replace(spec(1), profile=profile), spec(2)], RULES, port_lost=False) == []
    assert devices["slave-1"] is kept
    (block,) = kept.reads.reads(0.0, 1.0)
    assert block.decode((0x4000, 0x0000)) == {"wind_speed": 4.0}


def test_another_interval_needs_another_grid_and_no_other_device(devices: Devices) -> None:
    kept = devices["slave-1"]
    (fresh,) = devices.replace([spec(1, 2.0), spec(2)], RULES, port_lost=False)
    assert fresh is kept


def test_a_device_that_moved_begins_anew_but_for_the_rest_it_needs(devices: Devices) -> None:
    before = devices["slave-1"]
    (fresh,) = devices.replace([spec(7, name="slave-1"), spec(2)], RULES, port_lost=False)
    assert fresh is not before
    assert fresh.gap is before.gap
    other = replace(spec(7, name="slave-1"), profile=before.spec.profile.model_copy(update={"name": "other"}))
    (fresh,) = devices.replace([other, spec(2)], RULES, port_lost=False)
    assert fresh.gap is not before.gap


def test_while_the_port_is_lost_a_new_device_is_offline() -> None:
    (fresh,) = Devices().replace([spec(1)], RULES, port_lost=True)
    assert fresh.health is Health.OFFLINE


def test_the_times_of_answers_are_learned_in_time_or_late(devices: Devices) -> None:
    late = (LateAnswer(WIND, 0.4), LateAnswer(ELSEWHERE, 0.4), LateAnswer(WIND, LEARNED_MOST + 0.1))
    foreign = (LateAnswer(WIND, 0.3, ours=False),)
    devices.learn(ended(WIND, fault=Fault(FaultCode.TIMEOUT, ""), late=late + foreign))
    assert len(devices["slave-1"].response_times) == 1
    devices.learn(ended(WIND, answer=(1, 2), turnaround=0.005))
    devices.learn(ended(ELSEWHERE, answer=(1, 2), turnaround=0.005))
    assert len(devices["slave-1"].response_times) == 2
    devices.forget_response_times()
    assert len(devices["slave-1"].response_times) == 0


@pytest.mark.parametrize(("silent", "hurried"), [(START_PATIENT, False), (START_PATIENT + 1, True)])
def test_where_many_are_silent_at_the_start_none_is_waited_for_long(silent: int, *, hurried: bool) -> None:
    devices = Devices()
    for device in devices.replace([spec(slave) for slave in range(1, silent + 1)], RULES, port_lost=False):
        device.silent = True
    devices.hurry()
    assert all(device.hurried is hurried for device in devices.values())
