"""One sensor of a profile is at a place and no other: recognised by what it answers, and told from two of one id."""

from __future__ import annotations

import pytest

from lfs10d.line.jobs.identification import rate_fits
from lfs10d.modbus.request import ReadRegisters
from lfs10d.reading import FaultCode
from lfs10d.reconfiguration.procedures.identity_query import IdentityReply
from lfs10d.reconfiguration.procedures.recognition import (
    READS,
    Recognition,
    recognise,
)
from tests.support.recognitions import HERE, VANE, spoil, words
from tests.support.sensors import LFS10, Pretence, outcome_of

SAYS_3 = IdentityReply(answers=True, register=3)


def recognition(pretence: Pretence, identity: IdentityReply = SAYS_3) -> Recognition:
    return pretence.carry_out(recognise(HERE, identity, pretence.query()))


# -- recognised


def test_a_sensor_is_recognised_by_its_id_its_values_and_the_register_of_its_rate(pretence: Pretence) -> None:
    pretence.sensor(3)
    assert recognition(pretence) == Recognition(rate_code=1)
    assert pretence.requests == [*READS * [ReadRegisters(3, 1, 2)], ReadRegisters(3, 4, 1)]


@pytest.mark.parametrize(
    ("identity", "why"),
    [
        (IdentityReply(answers=True, exception=2), "it refuses register 0x0005 (exception 02)"),
        (IdentityReply(answers=True, register=700), "its register 0x0005 says 700, not 3"),
    ],
)
def test_one_whose_id_register_says_otherwise_is_not_asked_more(
    pretence: Pretence, identity: IdentityReply, why: str
) -> None:
    pretence.sensor(3)
    assert recognition(pretence, identity) == Recognition(why)
    assert pretence.asked == []


@pytest.mark.parametrize("number", [1e6, -1.0, float("nan"), float("inf"), 2e-40])
def test_one_value_that_cannot_be_is_enough_to_be_another_device(pretence: Pretence, number: float) -> None:
    pretence.sensor(3, wind=words(number))
    why = recognition(pretence).why
    assert why is not None
    assert why.startswith("wind_speed")


def test_values_that_are_refused_or_not_answered_are_none_of_such_a_sensor(pretence: Pretence) -> None:
    pretence.sensor(3, exception=2)
    assert recognition(pretence) == Recognition("it refuses (exception 02) its values at 0x0001")
    pretence.sensors.clear()
    assert recognition(pretence) == Recognition("it does not answer for its values at 0x0001")


def test_values_that_collide_each_time_are_two_sensors(pretence: Pretence) -> None:
    pretence.noise.add((3, 9600))
    assert recognition(pretence) == Recognition(spoilt=True)


def test_one_answer_spoilt_by_noise_hides_no_sensor(pretence: Pretence, monkeypatch: pytest.MonkeyPatch) -> None:
    pretence.sensor(3)
    spoil(pretence, monkeypatch, {0: outcome_of(ReadRegisters(3, 1, 2), FaultCode.CRC)})
    assert recognition(pretence) == Recognition(rate_code=1)


@pytest.mark.parametrize(("content", "says"), [(7, "says 7, which is no rate"), (0, "says 0, which is no rate")])
def test_a_rate_register_that_holds_no_rate_is_another_devices(pretence: Pretence, content: int, says: str) -> None:
    pretence.sensor(3, stored={4: content})
    assert recognition(pretence) == Recognition(f"its register 0x0004 {says}")


def test_a_rate_register_that_does_not_answer_is_another_devices(
    pretence: Pretence, monkeypatch: pytest.MonkeyPatch
) -> None:
    pretence.sensor(3)
    refused = outcome_of(ReadRegisters(3, 4, 1), exception=2)
    spoil(pretence, monkeypatch, {3: refused})
    assert recognition(pretence) == Recognition("its register 0x0004 does not answer")
    silent = outcome_of(ReadRegisters(3, 4, 1), FaultCode.TIMEOUT)
    pretence.asked.clear()
    spoil(pretence, monkeypatch, dict.fromkeys(range(3, 9), silent))
    assert recognition(pretence) == Recognition("its register 0x0004 does not answer")


def test_without_a_register_of_the_rate_none_is_asked(pretence: Pretence) -> None:
    pretence.sensor(3, wind=(12, 40))
    found = pretence.carry_out(recognise(HERE, SAYS_3, pretence.query(VANE)))
    assert found == Recognition()
    assert rate_fits(VANE, None, 9600)


def test_a_rate_that_the_profile_has_no_code_for_may_have_any_content() -> None:
    assert rate_fits(LFS10, 77, 4800)
    assert not rate_fits(LFS10, None, 4800)
    assert not rate_fits(LFS10, 77, 9600)
    assert rate_fits(LFS10, 2, 9600)  # it may have stored another rate and not obeyed yet
