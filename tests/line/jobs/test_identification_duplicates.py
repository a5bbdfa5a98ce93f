"""Two devices at one id, noise, and what is an answer."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from lfs10d.line.jobs.identification import (
    FoundDevice,
    first_read,
    speaks,
    spoilt,
    strangers,
)
from lfs10d.modbus.outcome import Outcome
from lfs10d.modbus.request import ReadRegisters
from lfs10d.reading import FaultCode
from tests.support.identifications import (
    CODEC,
    LD_E,
    LFS10,
    PROFILES,
    garbled,
    identify,
    lfs10,
    outcome,
)


@pytest.mark.parametrize(
    ("times", "spoilt_count", "duplicate"),
    [
        ([True] * 5, 5, True),
        ([True, False, True, False, True], 3, True),
        ([True, False, False, True, False], 2, False),
        ([False], 0, False),
    ],
)
def test_answers_garbled_three_times_of_five_are_two_devices(
    times: list[bool], spoilt_count: int, *, duplicate: bool
) -> None:
    finding, _ = identify(garbled(times))
    assert finding is not None
    assert (finding.profile, finding.spoilt, finding.duplicate) == (LFS10, spoilt_count, duplicate)
    assert finding.tries == (5 if spoilt_count else 0)


def test_a_second_frame_behind_the_right_one_is_another_device() -> None:
    def device(request: ReadRegisters) -> Outcome:
        answer = lfs10()(request).answer
        return outcome(request, answer, unsolicited=9 if request.address == 1 else 0)

    finding, _ = identify(device)
    assert finding is not None
    assert (finding.duplicate, dict(finding.values)) == (True, {"wind_speed": 12.99})


def noise(count: int) -> Callable[[ReadRegisters], Outcome]:
    """Return an empty id at which so many of the first answers are noise, the others silence."""
    left = iter(range(count))

    def device(request: ReadRegisters) -> Outcome:
        if next(left, None) is None:
            return outcome(request)
        return outcome(request, code=FaultCode.MALFORMED, heard=b"\x99")

    return device


def test_noise_alone_is_a_device_only_if_it_hardly_ever_fails_to_come() -> None:
    assert identify(noise(3), profiles=[LFS10])[0] is None
    finding, _ = identify(noise(4), profiles=[LFS10])
    assert finding == FoundDevice(3, 9600, spoilt=4, tries=5, duplicate=True)


def test_an_answer_that_may_be_an_older_ones_is_not_believed() -> None:
    def device(request: ReadRegisters) -> Outcome:
        return outcome(request, lfs10()(request).answer, ambiguous=True) if request.address == 5 else outcome(request)

    finding, _ = identify(device, profiles=[LFS10])
    assert finding is not None
    assert (finding.answers, finding.profile, finding.id_register) == (True, None, None)


def test_rtt_is_the_middle_one() -> None:
    times = iter([0.5, 0.02, 0.03])
    finding, _ = identify(lambda asked: outcome(asked, exception=2, rtt=next(times)), profiles=PROFILES[:3])
    assert finding is not None
    assert finding.rtt == 0.03


def test_a_wrong_frame_of_the_slave_is_an_answer_and_no_noise() -> None:
    request = ReadRegisters(3, 1, 2)
    longer = CODEC.wrap(bytes((3, 3, 6, 0, 0, 0, 0, 0, 0)))
    wrong = outcome(request, code=FaultCode.MALFORMED, heard=longer, unsolicited=11)
    assert speaks(wrong, CODEC)
    assert not spoilt(wrong, CODEC)
    finding, _ = identify(lambda asked: outcome(asked, code=FaultCode.MALFORMED, heard=longer), profiles=[LD_E])
    assert finding == FoundDevice(3, 9600, answers=True)


def test_our_own_echo_is_no_answer() -> None:
    request = ReadRegisters(3, 5, 1)
    assert not speaks(outcome(request, heard=CODEC.encode(request)), CODEC)


def test_strangers_are_other_slaves_whose_right_frames_came() -> None:
    request = ReadRegisters(3, 5, 1)
    other = CODEC.wrap(bytes((7, 3, 2, 0, 7)))
    assert strangers(outcome(request, code=FaultCode.WRONG_SLAVE, heard=other), CODEC) == {7}
    assert strangers(outcome(request, (3,)), CODEC) == frozenset()


def test_an_exception_with_a_frame_behind_it_is_spoilt() -> None:
    assert spoilt(outcome(ReadRegisters(3, 5, 1), exception=2, unsolicited=5), CODEC)
    assert not spoilt(outcome(ReadRegisters(3, 5, 1), exception=2, unsolicited=4), CODEC)


def test_without_an_id_register_the_first_values_are_the_first_read() -> None:
    assert first_read(LD_E, 4) == ReadRegisters(4, 0x1004, 2)
