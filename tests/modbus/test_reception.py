"""What was heard is sorted: echo, what came too early, late answers, the answer, the rest."""

from __future__ import annotations

import pytest

from lfs10d.modbus.reception import HEARD_KEPT
from lfs10d.modbus.request import WriteRegister
from tests.support.receptions import ANSWER, ASCII, REFUSED, REQUEST, RTU, TIMING, reception


def test_nothing_amounts_to_nothing() -> None:
    ear = reception()
    assert (ear.answer, ear.spare, ear.late, ear.rest, ear.leftover()) == (None, None, [], 0, b"")
    assert (ear.begun, ear.echoed, ear.echo_changed, ear.ambiguous, ear.unsolicited) == (False, None, False, False, 0)


def test_an_answer_in_two_pieces_is_an_answer() -> None:
    ear = reception()
    ear.take(ANSWER[:4], 0.02)
    assert ear.begun
    assert ear.whole_at == pytest.approx(0.02 + 5 * TIMING.character)
    ear.take(ANSWER[4:], 0.03)
    assert ear.answer is not None
    assert (ear.answer.first_at, ear.answer.last_at) == (0.02, 0.03)
    assert (ear.rest, ear.unsolicited, ear.echoed) == (0, 0, False)


def test_a_later_piece_never_postpones_the_end_of_its_frame() -> None:
    ear = reception()
    ear.take(ANSWER[:4], 0.02)
    ear.take(ANSWER[4:5], 0.024)
    assert ear.whole_at == pytest.approx(0.02 + 5 * TIMING.character)


def test_ascii_is_heard_in_either_case() -> None:
    ear = reception(codec=ASCII)
    ear.take(b":010304d0f5000033\r\n", 0.1)
    assert ear.answer is not None


def test_what_comes_too_early_on_a_wire_is_no_answer() -> None:
    ear = reception()
    ear.take(ANSWER, 0.001)
    assert (ear.answer, ear.spare, ear.rest, ear.unsolicited) == (None, None, 0, 9)


@pytest.mark.parametrize(("later", "rest"), [(-0.01, 0), (0.01, 1), (1.01, 2), (9.0, 9)])
def test_of_one_piece_only_the_last_bytes_can_have_come_after_the_request(later: float, rest: int) -> None:
    """Counted in characters, at the fastest, from when seven of the request's eight had left."""
    ear = reception()
    ear.take(b"\xff" * 9, (7 + 0.9 * later) * TIMING.character)
    assert ear.rest == rest


def test_what_comes_too_early_without_a_pace_is_a_spare() -> None:
    ear = reception(paced=False)
    ear.take(ANSWER, 0.001)
    assert ear.answer is None
    assert ear.spare is not None
    assert (ear.begun, ear.echoed, ear.ambiguous) == (True, False, False)
    ear.take(ANSWER, 0.02)
    assert ear.answer is not None


def test_a_broadcast_has_no_answer() -> None:
    ear = reception(WriteRegister(0, 5, 7))
    ear.take(RTU.encode(WriteRegister(0, 5, 7)), 0.03)
    assert ear.answer is None


def test_how_long_the_answer_should_be_depends_on_what_it_begins_as() -> None:
    ear = reception()
    ear.take(REFUSED[:4], 0.02)
    assert (ear.expected, ear.unsolicited) == (5, 0)
    both = reception()
    both.take(REFUSED[:4] + ANSWER[:4], 0.02)
    assert (both.expected, both.unsolicited) == (9, 0)


def test_only_the_last_of_very_much_is_remembered() -> None:
    ear = reception()
    for step in range(10):
        ear.take(b"\x55" * 500, 1.0 + step)
    assert HEARD_KEPT <= len(ear.heard) <= 2 * HEARD_KEPT
    assert ear.rest == ear.unsolicited == 5000


def test_nothing_heard_before_is_held_against_a_byte_that_comes_just_in_time() -> None:
    ear = reception()
    ear.take(b"\xff", TIMING.transmission(len(REQUEST) - 1))
    assert ear.rest == 1


def test_huge_pieces_do_not_make_the_memory_grow() -> None:
    ear = reception()
    for n in range(10):
        ear.take(b"\xff" * 5000, 0.02 + n)
        assert len(ear.heard) <= 2 * HEARD_KEPT


def test_the_last_byte_of_a_frame_is_not_postponed_either() -> None:
    ear = reception()
    ear.take(ANSWER[:7], 0.02)
    ear.take(ANSWER[7:8], 0.024)
    assert ear.whole_at == pytest.approx(0.02 + 2 * TIMING.character)


def test_a_frame_that_begins_anew_is_waited_for_anew() -> None:
    ear = reception()
    ear.take(ANSWER[:1], 0.02)
    ear.take(ANSWER[:1], 0.03)
    assert ear.whole_at == pytest.approx(0.03 + 8 * TIMING.character)
