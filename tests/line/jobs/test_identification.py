"""Who is at an id: recognition by profile, what counts as an answer, and when two devices are suspected."""

from __future__ import annotations

import pytest

from lfs10d.line.jobs.identification import (
    FoundDevice,
    rate_fits,
)
from lfs10d.modbus.outcome import Outcome
from lfs10d.modbus.request import ReadRegisters
from lfs10d.profiles.profile import Profile
from tests.support.identifications import (
    EH600,
    FULING,
    LD_E,
    LFS10,
    PROFILES,
    WIND,
    garbled,
    identify,
    lfs10,
    outcome,
    registers,
)

NOT_A_NUMBER = (0x7FC0, 0x0000)


def test_an_lfs10_is_recognised_by_its_id_its_value_and_its_rate() -> None:
    finding, asked = identify(lfs10())
    assert asked == [ReadRegisters(3, 5, 1), ReadRegisters(3, 1, 2), ReadRegisters(3, 4, 1)]
    assert finding == FoundDevice(
        3, 9600, answers=True, rtt=0.02, profile=LFS10, values={"wind_speed": 12.99}, id_register=3
    )


def test_what_is_known_already_is_not_asked_again() -> None:
    first = outcome(ReadRegisters(3, 5, 1), (3,))
    finding, asked = identify(lfs10(), first=first)
    assert asked == [ReadRegisters(3, 1, 2), ReadRegisters(3, 4, 1)]
    assert finding is not None
    assert finding.profile is LFS10


@pytest.mark.parametrize(
    "content",
    [
        {1: NOT_A_NUMBER[0], 2: NOT_A_NUMBER[1], 4: 1, 5: 3},
        {1: 225, 2: 0, 4: 1, 5: 3},
        {1: WIND[0], 2: WIND[1], 4: 9, 5: 3},
        {1: WIND[0], 2: WIND[1], 5: 3},
        {4: 1, 5: 3},
        {1: WIND[0], 2: WIND[1], 4: 1, 5: 700},
    ],
)
def test_where_id_value_and_rate_do_not_all_agree_it_is_an_unknown_device(content: dict[int, int]) -> None:
    # The right id alone was enough before: a device of integers that holds its id at 0x0005 was named an LFS10.
    finding, _ = identify(registers(content))
    assert finding is not None
    assert (finding.answers, finding.profile, dict(finding.values)) == (True, None, {})


def test_at_a_rate_without_a_code_the_content_of_its_register_says_nothing() -> None:
    assert rate_fits(LFS10, 9, 4800)
    assert not rate_fits(LFS10, 9, 9600)
    assert not rate_fits(LFS10, None, 4800)
    assert rate_fits(LD_E, None, 9600)


def test_two_lfs10_whose_values_collide_are_named_as_such() -> None:
    finding, _ = identify(garbled([True] * 5))
    assert finding is not None
    assert (finding.profile, finding.id_register, finding.duplicate) == (LFS10, 3, True)


def test_two_devices_whose_values_collide_and_whose_id_is_not_the_right_one_are_unknown() -> None:
    def device(request: ReadRegisters) -> Outcome:
        return lfs10(slave=2)(request) if request.address != 1 else garbled([True])(request)

    finding, _ = identify(device)
    assert finding is not None
    assert (finding.profile, finding.duplicate) == (None, True)


def test_another_possible_id_needs_a_believable_value() -> None:
    finding, _ = identify(lfs10(slave=2), slave=255)
    assert finding is not None
    assert (finding.profile, finding.id_register) == (LFS10, 2)
    finding, _ = identify(lfs10(slave=2, wind=NOT_A_NUMBER), slave=255)
    assert finding is not None
    assert finding.profile is None


def test_an_id_register_with_no_id_in_it_is_no_lfs10() -> None:
    finding, _ = identify(registers({1: WIND[0], 2: WIND[1], 5: 0}))
    assert finding is not None
    assert (finding.profile, finding.id_register) == (None, None)


@pytest.mark.parametrize(
    ("profile", "content"),
    [
        (LD_E, {0x1004: 0xD0F5, 0x1005: 0}),
        (FULING, dict.fromkeys(range(0x3001, 0x3005), 0)),
        (EH600, {0x1001: 5000}),
    ],
)
def test_other_devices_are_recognised_by_their_values(profile: Profile, content: dict[int, int]) -> None:
    finding, _ = identify(registers(content))
    assert finding is not None
    assert finding.profile is profile
    assert set(finding.values) <= set(profile.value_names)


def test_a_device_that_refuses_everything_is_there_but_unknown() -> None:
    finding, asked = identify(registers({}))
    assert finding == FoundDevice(3, 9600, answers=True, rtt=0.02, exception=2)
    assert {(read.address, read.count) for read in asked} == {
        (profile.slave_id.register, 1) if profile.slave_id else (profile.reads()[0].address, profile.reads()[0].count)
        for profile in PROFILES
    }
    assert len(asked) == len(set(asked)), "what was asked once is not asked again"


def test_profiles_whose_ids_it_cannot_have_are_not_tried() -> None:
    _, asked = identify(registers({}), slave=250)
    assert asked == [ReadRegisters(250, register, 1) for register in (5, 0x07D0, 0x1000)]
    finding, asked = identify(registers({0: 7}), slave=250, profiles=[LD_E])
    assert asked == [ReadRegisters(250, 0, 1)]
    assert finding == FoundDevice(250, 9600, answers=True, rtt=0.02)


def test_silence_is_asked_three_times_and_then_nobody_is_there() -> None:
    finding, asked = identify(outcome, profiles=[LFS10])
    assert finding is None
    assert asked == 3 * [ReadRegisters(3, 5, 1)]


def test_one_silence_hides_nobody() -> None:
    count = 0

    def device(request: ReadRegisters) -> Outcome:
        nonlocal count
        count += 1
        return outcome(request) if count == 1 else lfs10()(request)

    finding, _ = identify(device)
    assert finding is not None
    assert (finding.profile, finding.spoilt) == (LFS10, 0)
