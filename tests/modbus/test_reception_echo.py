"""Our own request as it comes back: echo, changed echo, what seemed to be one."""

from __future__ import annotations

import pytest

from lfs10d.modbus.echo import Echo
from tests.support.receptions import ANSWER, CONFIRMED, MOVE, REQUEST, TIMING, reception


def test_an_echo_is_taken_out() -> None:
    ear = reception(echo=Echo.UNKNOWN)
    ear.take(REQUEST[:3], 0.003)
    assert (ear.rest, ear.begun, ear.leftover(), ear.unsolicited) == (3, True, REQUEST[:3], 0)
    assert ear.whole_at == 0.003
    ear.take(REQUEST[3:], 0.009)
    assert (ear.rest, ear.begun, ear.echoed, ear.only_request) == (0, False, True, True)
    ear.take(ANSWER, 0.03)
    assert ear.answer is not None
    assert not ear.only_request


def test_the_end_of_an_echo_and_the_answer_may_come_in_one_piece() -> None:
    ear = reception(echo=Echo.ON)
    ear.take(REQUEST[:3], 0.003)
    ear.take(REQUEST[3:] + ANSWER, 0.03)
    assert ear.answer is not None
    assert (ear.echoed, ear.unsolicited) == (True, 0)


def test_half_an_echo_belongs_to_no_answer() -> None:
    ear = reception(echo=Echo.ON)
    ear.take(REQUEST[:3], 0.003)
    assert ear.unsolicited == 3


def test_an_expected_echo_of_which_nothing_came_has_not_changed() -> None:
    assert not reception(echo=Echo.ON).echo_changed


def test_what_seemed_echo_and_is_none_is_given_back() -> None:
    ear = reception(echo=Echo.UNKNOWN)
    ear.take(ANSWER[:2], 0.02)
    ear.take(ANSWER[2:], 0.03)
    assert ear.answer is not None
    assert ear.answer.first_at == 0.02
    assert ear.echoed is False


def test_an_echo_behind_noise_proves_nothing() -> None:
    ear = reception()
    ear.take(b"\x00" + REQUEST + ANSWER, 0.03)
    assert ear.answer is not None
    assert ear.echoed is None


def test_an_echo_that_nobody_expects_is_noticed() -> None:
    ear = reception()
    ear.take(REQUEST + ANSWER, 0.03)
    assert ear.echoed is True


def test_an_expected_echo_that_came_back_otherwise_has_changed() -> None:
    ear = reception(echo=Echo.ON)
    ear.take(REQUEST[:3], 0.003)
    assert ear.echo_changed
    assert ear.whole_at == pytest.approx(0.003 + 5 * TIMING.character)
    ear.take(b"\xff" * 5, 0.009)
    assert ear.echo_changed
    assert not ear.begun
    whole = reception(echo=Echo.ON)
    whole.take(REQUEST, 0.009)
    assert not whole.echo_changed


@pytest.mark.parametrize(("echo", "echoed"), [(Echo.ON, True), (Echo.UNKNOWN, None), (Echo.OFF, None)])
def test_one_frame_confirms_a_write_only_where_there_is_no_echo(echo: Echo, *, echoed: bool | None) -> None:
    ear = reception(MOVE, echo=echo)
    ear.take(CONFIRMED, 0.03)
    assert (ear.answer is not None) is (echo is Echo.OFF)
    assert ear.echoed is echoed


def test_two_frames_confirm_a_write_behind_an_echo() -> None:
    ear = reception(MOVE, echo=Echo.UNKNOWN)
    ear.take(CONFIRMED + CONFIRMED, 0.03)
    assert ear.answer is not None
    assert ear.echoed is True
    changed = reception(MOVE, echo=Echo.ON)
    changed.take(b"\x00" + CONFIRMED, 0.03)
    assert changed.answer is None


def test_what_was_no_echo_is_not_taken_for_the_rest_of_one_later() -> None:
    ear = reception(echo=Echo.UNKNOWN)
    pieces = (REQUEST[:3], b"\xff", REQUEST[3:])
    for n, piece in enumerate(pieces):
        ear.take(piece, 0.05 + 0.01 * n)
    assert ear.leftover() == b"".join(pieces)


def test_two_bytes_that_may_be_echo_may_be_the_answers_first() -> None:
    ear = reception(echo=Echo.UNKNOWN)
    ear.take(REQUEST[:2], 0.05)
    assert ear.begun


def test_an_echo_has_changed_where_it_was_expected_and_a_single_other_byte_came() -> None:
    ear = reception(echo=Echo.ON)
    ear.take(b"\xff", 0.05)
    assert ear.echo_changed
    ear = reception(echo=Echo.OFF)
    ear.take(b"\xff", 0.05)
    assert not ear.echo_changed
    ear = reception(echo=Echo.ON)
    ear.take(REQUEST + b"\xff", 0.05)
    assert not ear.echo_changed


def test_an_echo_in_many_pieces_is_left_over_as_it_came() -> None:
    ear = reception(echo=Echo.UNKNOWN)
    for at in range(5):
        ear.take(REQUEST[at : at + 1], 0.05 + at * TIMING.character)
    assert ear.leftover() == REQUEST[:5]


def test_our_own_request_is_no_stray_once() -> None:
    ear = reception()
    ear.take(b"x" + REQUEST + b"y", 0.02)
    assert ear.strays == ((b"x", 0.02), (b"y", 0.02))
    quiet = reception()
    quiet.take(b"xy", 0.02)
    assert quiet.strays == ((b"xy", 0.02),)
    echoed = reception(echo=Echo.ON)
    echoed.take(REQUEST, 0.01)
    echoed.take(REQUEST, 0.02)  # another's: ours has come back
    assert echoed.strays == ((REQUEST, 0.02),)


def test_what_answers_another_masters_request_is_displaced() -> None:
    """It was heard to ask the same slave right behind us."""
    ear = reception(echo=Echo.ON)
    ear.take(REQUEST, 0.01)
    ear.take(REQUEST, 0.02)
    ear.take(ANSWER, 0.04)
    assert ear.answer is None
    assert ear.displaced is not None
