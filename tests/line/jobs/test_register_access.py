"""Raw access to registers on a simulated line in virtual time: what is asked, what is written, how it ends."""

from __future__ import annotations

import pytest

from lfs10d.line.jobs.access_end import End
from lfs10d.profiles.library import load_profile
from lfs10d.profiles.profile import Profile
from lfs10d.reading import FaultCode
from tests.support.faulty_sensors import add_fault
from tests.support.register_accesses import AVERAGING, ROOT, VANE, Rig, read

LFS10 = load_profile("lfs10", relative_to=ROOT)


# -- reading


def test_registers_are_read_as_they_are() -> None:
    rig = Rig()
    rig.vane.words[AVERAGING] = 17
    access = rig.do(read())
    assert (access.end, access.registers, access.fault, access.sent) == (End.DONE, (17,), None, False)
    assert rig.asked == [bytes.fromhex("03 0010 0001")]


def test_a_register_that_does_not_exist_is_refused_at_once() -> None:
    rig = Rig()
    access = rig.do(read(0x0999))
    assert (access.end, access.registers) == (End.REFUSED, None)
    assert access.fault is not None
    assert access.fault.exception_code == 2
    assert len(rig.asked) == 1


@pytest.mark.parametrize("profile", [VANE, None])
def test_a_silent_slave_is_asked_with_growing_patience(profile: Profile | None) -> None:
    rig = Rig()
    add_fault(rig.vane, "silent")
    access = rig.do(read(), profile)
    assert (access.end, access.sent) == (End.UNANSWERED, False)
    assert access.fault is not None
    assert access.fault.code is FaultCode.TIMEOUT
    waited = [each.at - each.asked for each in rig.exchanges]
    assert waited == pytest.approx([0.2, 0.4, 1.0], abs=0.02)


def test_a_fixed_time_out_holds_for_every_try() -> None:
    rig = Rig()
    add_fault(rig.vane, "silent")
    rig.do(read(), timeout=0.3)
    assert [each.at - each.asked for each in rig.exchanges] == pytest.approx([0.3] * 3, abs=0.02)


def test_noise_is_asked_again_and_told_as_what_it_is() -> None:
    rig = Rig()
    add_fault(rig.vane, "noisy")
    access = rig.do(read())
    assert access.end is End.UNANSWERED
    assert access.fault is not None
    assert access.fault.code is FaultCode.CRC
    assert len(rig.asked) >= 3


def test_a_busy_slave_is_asked_later_and_told_as_busy() -> None:
    rig = Rig()
    add_fault(rig.vane, "exception", code=6, last=0.2)
    assert rig.do(read()).end is End.DONE
    assert rig.exchanges[1].asked - rig.exchanges[0].at > 0.29
    add_fault(rig.vane, "exception", code=6)
    access = rig.do(read(), None)
    assert (access.end, access.fault and access.fault.busy) == (End.BUSY, True)


def test_which_exception_means_busy_is_the_profiles_word() -> None:
    rig = Rig()
    add_fault(rig.vane, "exception", code=6)
    assert rig.do(read(), VANE.model_copy(update={"busy_exceptions": (5,)})).end is End.REFUSED


def test_an_answer_that_comes_too_late_never_passes_for_the_next_one() -> None:
    rig = Rig()
    rig.vane.words[AVERAGING] = 17
    add_fault(rig.vane, "late", delay=0.35, last=0.1)
    access = rig.do(read(0x07D0))
    assert (access.end, access.registers) == (End.DONE, (7,))
    assert rig.asked[1] == bytes.fromhex("03 0000 0002")  # another shape: the barrier is as long as what is read


def test_a_slave_without_a_known_second_shape_is_left_alone_until_nothing_can_come() -> None:
    rig = Rig()
    add_fault(rig.vane, "late", delay=0.35, last=0.1)
    assert rig.do(read(), None).registers == (1,)
    first, second = rig.exchanges
    assert second.asked - first.at > 0.75
    assert second.late == 0


def test_the_values_shape_is_asked_by_the_barrier_first() -> None:
    rig = Rig()
    add_fault(rig.vane, "silent", last=0.1)
    assert rig.do(read(0x0000, 2)).end is End.DONE
    assert rig.asked[1:2] == [bytes.fromhex("03 07D0 0001")]


def test_a_profile_without_a_barrier_lends_the_shape_of_a_poll() -> None:
    rig = Rig()
    add_fault(rig.vane, "silent", last=0.1)
    assert rig.do(read(), VANE.model_copy(update={"barrier": None})).end is End.DONE
    assert rig.asked[1:2] == [bytes.fromhex("03 0000 0002")]


def test_two_shapes_unanswered_leave_nothing_to_ask_for_a_while() -> None:
    rig = Rig()
    add_fault(rig.vane, "silent", last=0.5)
    assert rig.do(read()).end is End.DONE
    assert rig.asked[:3] == [bytes.fromhex(each) for each in ("03 0010 0001", "03 0000 0002", "03 0010 0001")]
    assert rig.exchanges[2].asked - rig.exchanges[1].asked > 0.75
