"""Who is at an id: recognition by profile, what counts as an answer, and when two devices are suspected."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import pytest

from lfs10d.line.jobs.identification import (
    FoundDevice,
    Identification,
    first_read,
    rate_fits,
    speaks,
    spoilt,
    strangers,
)
from lfs10d.modbus.frames import Codec, Framing
from lfs10d.modbus.outcome import Outcome
from lfs10d.modbus.request import ReadRegisters
from lfs10d.profiles.library import builtin_names, load_profile
from lfs10d.profiles.profile import Profile
from lfs10d.reading import Fault, FaultCode
from tests.support.outcomes import ended

CODEC = Codec(Framing.RTU)
PROFILES = tuple(load_profile(name, relative_to=Path()) for name in builtin_names()[:4])
LFS10, LD_E, FULING, EH600 = PROFILES
WIND = (0x414F, 0xD70A)
"""12.99 m/s."""
NOT_A_NUMBER = (0x7FC0, 0x0000)


def outcome(
    request: ReadRegisters,
    answer: tuple[int, ...] | None = None,
    code: FaultCode = FaultCode.TIMEOUT,
    *,
    exception: int | None = None,
    heard: bytes = b"",
    unsolicited: int = 0,
    ambiguous: bool = False,
    rtt: float | None = 0.02,
) -> Outcome:
    """Return how an exchange ended: with an answer, an exception, or the fault `code`."""
    fault = None
    if exception is not None:
        fault = Fault(FaultCode.EXCEPTION, "refused", exception)
    elif answer is None:
        fault, rtt = Fault(code, "failed", heard=heard), None
    return ended(
        request,
        answer=answer,
        fault=fault,
        rtt=rtt,
        answered=fault is None,
        sent=CODEC.encode(request),
        heard=heard,
        unsolicited=unsolicited,
        ambiguous=ambiguous,
    )


def interview(
    device: Callable[[ReadRegisters], Outcome],
    *,
    slave: int = 3,
    profiles: Sequence[Profile] = PROFILES,
    first: Outcome | None = None,
) -> tuple[FoundDevice | None, list[ReadRegisters]]:
    """Hold an interview with a device; return what was found, and what was asked."""
    asked: list[ReadRegisters] = []
    steps = Identification(FoundDevice(slave, 9600), profiles, CODEC, first).steps()
    try:
        request = next(steps)
        while True:
            asked.append(request)
            request = steps.send(device(request))
    except StopIteration as end:
        return end.value, asked


def registers(content: dict[int, int]) -> Callable[[ReadRegisters], Outcome]:
    """Return a device that has these registers and refuses others."""

    def device(request: ReadRegisters) -> Outcome:
        wanted = range(request.address, request.address + request.count)
        if all(register in content for register in wanted):
            return outcome(request, tuple(content[register] for register in wanted))
        return outcome(request, exception=2)

    return device


def lfs10(slave: int = 3, wind: tuple[int, int] = WIND) -> Callable[[ReadRegisters], Outcome]:
    return registers({1: wind[0], 2: wind[1], 4: 1, 5: slave})


def test_an_lfs10_is_recognised_by_its_id_its_value_and_its_rate() -> None:
    finding, asked = interview(lfs10())
    assert asked == [ReadRegisters(3, 5, 1), ReadRegisters(3, 1, 2), ReadRegisters(3, 4, 1)]
    assert finding == FoundDevice(
        3, 9600, answers=True, rtt=0.02, profile=LFS10, values={"wind_speed": 12.99}, id_register=3
    )


def test_what_is_known_already_is_not_asked_again() -> None:
    first = outcome(ReadRegisters(3, 5, 1), (3,))
    finding, asked = interview(lfs10(), first=first)
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
    finding, _ = interview(registers(content))
    assert finding is not None
    assert (finding.answers, finding.profile, dict(finding.values)) == (True, None, {})


def test_at_a_rate_without_a_code_the_content_of_its_register_says_nothing() -> None:
    assert rate_fits(LFS10, 9, 4800)
    assert not rate_fits(LFS10, 9, 9600)
    assert not rate_fits(LFS10, None, 4800)
    assert rate_fits(LD_E, None, 9600)


def test_two_lfs10_whose_values_collide_are_named_as_such() -> None:
    finding, _ = interview(garbled([True] * 5))
    assert finding is not None
    assert (finding.profile, finding.id_register, finding.duplicate) == (LFS10, 3, True)


def test_two_devices_whose_values_collide_and_whose_id_is_not_the_right_one_are_unknown() -> None:
    def device(request: ReadRegisters) -> Outcome:
        return lfs10(slave=2)(request) if request.address != 1 else garbled([True])(request)

    finding, _ = interview(device)
    assert finding is not None
    assert (finding.profile, finding.duplicate) == (None, True)


def test_another_possible_id_needs_a_believable_value() -> None:
    finding, _ = interview(lfs10(slave=2), slave=255)
    assert finding is not None
    assert (finding.profile, finding.id_register) == (LFS10, 2)
    finding, _ = interview(lfs10(slave=2, wind=NOT_A_NUMBER), slave=255)
    assert finding is not None
    assert finding.profile is None


def test_an_id_register_with_no_id_in_it_is_no_lfs10() -> None:
    finding, _ = interview(registers({1: WIND[0], 2: WIND[1], 5: 0}))
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
    finding, _ = interview(registers(content))
    assert finding is not None
    assert finding.profile is profile
    assert set(finding.values) <= set(profile.value_names)


def test_a_device_that_refuses_everything_is_there_but_unknown() -> None:
    finding, asked = interview(registers({}))
    assert finding == FoundDevice(3, 9600, answers=True, rtt=0.02, exception=2)
    assert len(asked) == len(PROFILES)


def test_profiles_whose_ids_it_cannot_have_are_not_tried() -> None:
    _, asked = interview(registers({}), slave=250)
    assert asked == [ReadRegisters(250, 5, 1)]
    finding, asked = interview(registers({0: 7}), slave=250, profiles=[LD_E])
    assert asked == [ReadRegisters(250, 0, 1)]
    assert finding == FoundDevice(250, 9600, answers=True, rtt=0.02)


def test_silence_is_asked_three_times_and_then_nobody_is_there() -> None:
    finding, asked = interview(outcome, profiles=[LFS10])
    assert finding is None
    assert asked == 3 * [ReadRegisters(3, 5, 1)]


def test_one_silence_hides_nobody() -> None:
    count = 0

    def device(request: ReadRegisters) -> Outcome:
        nonlocal count
        count += 1
        return outcome(request) if count == 1 else lfs10()(request)

    finding, _ = interview(device)
    assert finding is not None
    assert (finding.profile, finding.spoilt) == (LFS10, 0)


def garbled(times: Sequence[bool]) -> Callable[[ReadRegisters], Outcome]:
    """Return an LFS10 whose value is garbled in these of the reads."""
    course = iter(times)

    def device(request: ReadRegisters) -> Outcome:
        if request.address == 1 and next(course):
            return outcome(request, code=FaultCode.CRC, heard=b"\x03\x03\x04garbled", unsolicited=0)
        return lfs10()(request)

    return device


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
    finding, _ = interview(garbled(times))
    assert finding is not None
    assert (finding.profile, finding.spoilt, finding.duplicate) == (LFS10, spoilt_count, duplicate)
    assert finding.tries == (5 if spoilt_count else 0)


def test_a_second_frame_behind_the_right_one_is_another_device() -> None:
    def device(request: ReadRegisters) -> Outcome:
        answer = lfs10()(request).answer
        return outcome(request, answer, unsolicited=9 if request.address == 1 else 0)

    finding, _ = interview(device)
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
    assert interview(noise(3), profiles=[LFS10])[0] is None
    finding, _ = interview(noise(4), profiles=[LFS10])
    assert finding == FoundDevice(3, 9600, spoilt=4, tries=5, duplicate=True)


def test_an_answer_that_may_be_an_older_ones_is_not_believed() -> None:
    def device(request: ReadRegisters) -> Outcome:
        return outcome(request, lfs10()(request).answer, ambiguous=True) if request.address == 5 else outcome(request)

    finding, _ = interview(device, profiles=[LFS10])
    assert finding is not None
    assert (finding.answers, finding.profile, finding.id_register) == (True, None, None)


def test_rtt_is_the_middle_one() -> None:
    times = iter([0.5, 0.02, 0.03])
    finding, _ = interview(lambda asked: outcome(asked, exception=2, rtt=next(times)), profiles=PROFILES[:3])
    assert finding is not None
    assert finding.rtt == 0.03


def test_a_wrong_frame_of_the_slave_is_an_answer_and_no_noise() -> None:
    request = ReadRegisters(3, 1, 2)
    longer = CODEC.wrap(bytes((3, 3, 6, 0, 0, 0, 0, 0, 0)))
    wrong = outcome(request, code=FaultCode.MALFORMED, heard=longer, unsolicited=11)
    assert speaks(wrong, CODEC)
    assert not spoilt(wrong, CODEC)
    finding, _ = interview(lambda asked: outcome(asked, code=FaultCode.MALFORMED, heard=longer), profiles=[LD_E])
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
