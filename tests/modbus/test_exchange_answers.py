"""What is an answer, and when: whole at its last byte, among noise, and not before our request has left."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lfs10d.modbus.frames import Codec
from lfs10d.modbus.request import ReadRegisters
from lfs10d.reading import FaultCode
from tests.support.exchanges import (
    ANSWER,
    ASCII,
    CHARACTER,
    MOVE,
    PLAIN,
    REFUSED,
    RTU,
    SENT_END,
    SUM,
    T9600,
    VALUES,
    WIND,
    attempt,
    byte_by_byte,
    carry_out,
    code,
    framed,
)


@pytest.mark.parametrize("codec", [RTU, SUM, ASCII])
@pytest.mark.parametrize("slave", [1, 4, 255])
def test_an_answer_is_given_at_its_last_byte(codec: Codec, slave: int) -> None:
    request = ReadRegisters(slave, 0x0001, 2)
    each = replace(attempt(request, codec), timing=T9600)
    end = len(codec.encode(request)) * CHARACTER
    frame = codec.wrap(bytes((slave, 3, 4, 0x41, 0x4F, 0xD7, 0x0A)))
    outcome = carry_out(each, byte_by_byte(frame, end + 0.005))
    assert outcome.answer == VALUES
    assert outcome.ended == pytest.approx(end + 0.005 + len(frame) * CHARACTER)
    assert outcome.rtt == pytest.approx(outcome.ended)
    assert outcome.turnaround == pytest.approx(0.005 + CHARACTER)
    assert outcome.quiet_since == outcome.ended
    assert (outcome.answered, outcome.echoed, outcome.unsolicited) == (True, False, 0)
    assert outcome.heard == frame


def test_the_round_trip_runs_from_the_first_bit_of_the_request() -> None:
    outcome = carry_out(PLAIN, byte_by_byte(ANSWER, 0.02), quiet_since=0.0)
    assert outcome.began == T9600.gap
    assert outcome.rtt == pytest.approx(0.02 + 9 * CHARACTER - T9600.gap)


def test_lower_case_ascii_is_understood() -> None:
    frame = b":010304d0f5000033\r\n"
    assert carry_out(attempt(WIND, ASCII), [(0.05, frame)]).answer == (0xD0F5, 0)


def test_an_ascii_frame_is_restarted_by_a_colon() -> None:
    frame = b":010304D0F5" + b":010304D0F5000033\r\n"
    assert carry_out(attempt(WIND, ASCII), [(0.05, frame)]).answer == (0xD0F5, 0)


def test_ascii_characters_may_pause_a_second() -> None:
    first, second = b":010304D0", b"F5000033\r\n"
    assert carry_out(attempt(WIND, ASCII), [(0.05, first), (1.04, second)]).answer == (0xD0F5, 0)
    outcome = carry_out(attempt(WIND, ASCII), [(0.05, first), (1.06, second)])
    assert code(outcome) is FaultCode.MALFORMED
    assert outcome.ended == pytest.approx(1.05)


def test_a_write_is_confirmed_by_its_echo_from_the_slave() -> None:
    outcome = carry_out(attempt(MOVE), [(0.02, framed("010600050007"))])
    assert outcome.answer == (7,)
    assert outcome.echoed is None


def test_an_exception_is_a_fault_with_its_code() -> None:
    outcome = carry_out(PLAIN, [(0.02, REFUSED)])
    assert outcome.fault is not None
    assert outcome.fault.code is FaultCode.EXCEPTION
    assert outcome.fault.exception_code == 2
    assert outcome.fault.message == "exception 02 illegal register address, reading 2 registers at 0x0001"
    assert outcome.turnaround == pytest.approx(0.02 - SENT_END)
    assert (outcome.answered, outcome.ambiguous) == (True, False)


@pytest.mark.parametrize("codec", [RTU, SUM, ASCII])
@given(before=st.binary(max_size=30), after=st.binary(max_size=30))
def test_a_right_frame_wins_whatever_noise_surrounds_it(codec: Codec, before: bytes, after: bytes) -> None:
    frame = framed("010304414FD70A", codec)
    outcome = carry_out(attempt(WIND, codec), [(0.2, before + frame + after)])
    assert outcome.answer == VALUES or frame in before + after
    assert outcome.unsolicited == len(before + after)


@pytest.mark.parametrize("piece", [1, 2, 8])
def test_pauses_inside_what_is_received_are_not_judged(piece: int) -> None:
    each = replace(PLAIN, adapter_latency=0.020)
    pieces = [(0.02 + i * 0.016 / piece, ANSWER[i : i + piece]) for i in range(0, 9, piece)]
    assert carry_out(each, pieces).answer == VALUES


# -- too early


def test_on_a_wire_what_comes_before_our_request_has_left_is_noise() -> None:
    outcome = carry_out(PLAIN, [(0.006, ANSWER)])
    assert code(outcome) is FaultCode.TIMEOUT
    assert outcome.unsolicited == 9
    assert not outcome.answered


def test_on_a_wire_an_adapter_cannot_make_it_look_later() -> None:
    """Nine bytes read 4 ms after the request's end began to come before it."""
    assert code(carry_out(PLAIN, [(SENT_END + 0.004, ANSWER)])) is FaultCode.MALFORMED
    assert carry_out(PLAIN, [(SENT_END + 0.004, b"\x00" * 9), (0.03, ANSWER)]).answer == VALUES


def test_a_hair_too_early_is_early_enough() -> None:
    assert carry_out(PLAIN, byte_by_byte(ANSWER, SENT_END - 1.9 * CHARACTER)).answer == VALUES


def test_without_a_pace_a_right_frame_counts_if_nothing_better_comes() -> None:
    each = replace(PLAIN, paced=False)
    alone = carry_out(each, [(0.001, ANSWER)])
    assert alone.answer == VALUES
    assert (alone.turnaround, alone.rtt) == (0.0, 0.001)
    assert (alone.answered, alone.echoed, alone.unsolicited) == (True, False, 0)
    better = carry_out(each, [(0.001, ANSWER), (0.02, framed("01030400010002"))])
    assert better.answer == (1, 2)


def test_without_a_pace_a_burst_after_the_request_is_an_answer_at_once() -> None:
    outcome = carry_out(replace(PLAIN, paced=False), [(SENT_END + 0.001, ANSWER)])
    assert outcome.answer == VALUES
    assert outcome.ended == pytest.approx(SENT_END + 0.001)
