"""What is no answer: each fault with its code, and how long is listened for better."""

from __future__ import annotations

from dataclasses import replace

import pytest

from lfs10d.reading import FaultCode
from tests.support.exchanges import (
    ANSWER,
    ASCII,
    BROKEN,
    CHARACTER,
    HUSH,
    MOVE,
    PLAIN,
    REFUSED,
    RTU,
    SENT_END,
    VALUES,
    WIND,
    attempt,
    byte_by_byte,
    carry_out,
    code,
    framed,
)


def test_silence_is_a_timeout_at_the_time_out() -> None:
    outcome = carry_out(PLAIN, [])
    assert code(outcome) is FaultCode.TIMEOUT
    assert outcome.fault is not None
    assert outcome.fault.message == "no answer in 200 ms"
    assert outcome.ended == pytest.approx(SENT_END + 0.2)
    assert outcome.quiet_since == pytest.approx(SENT_END)
    assert (outcome.turnaround, outcome.rtt, outcome.echoed) == (None, None, None)


def test_an_answer_that_begins_just_before_the_time_out_is_heard_to_its_end() -> None:
    assert carry_out(PLAIN, byte_by_byte(ANSWER, SENT_END + 0.2 - 1.1 * CHARACTER)).answer == VALUES


@pytest.mark.parametrize(
    ("heard", "expected"),
    [
        (ANSWER[:1], FaultCode.MALFORMED),
        (ANSWER[:5], FaultCode.MALFORMED),
        (ANSWER[:8], FaultCode.MALFORMED),
        (REFUSED[:4], FaultCode.MALFORMED),
        (b"\xff", FaultCode.MALFORMED),
        (BROKEN, FaultCode.CRC),
        (REFUSED[:4] + b"\x00", FaultCode.CRC),
        (b"\xff" * 12, FaultCode.CRC),
        (framed("040304414FD70A"), FaultCode.WRONG_SLAVE),
        (framed("010404414FD70A"), FaultCode.WRONG_FUNCTION),
        (framed("0103020007"), FaultCode.MALFORMED),
        (framed("010306000700070007"), FaultCode.MALFORMED),
        (b"\xff\x00" + framed("0103020007"), FaultCode.MALFORMED),
    ],
)
def test_each_fault_has_its_code(heard: bytes, expected: FaultCode) -> None:
    outcome = carry_out(PLAIN, byte_by_byte(heard, SENT_END + 0.005))
    assert code(outcome) is expected
    assert outcome.fault is not None
    assert outcome.fault.heard == heard


def test_a_wrong_echo_of_a_write_is_malformed() -> None:
    assert code(carry_out(attempt(MOVE), [(0.02, framed("010600050008"))])) is FaultCode.MALFORMED


def test_our_own_request_from_an_adapter_without_echo_is_a_timeout_with_a_hint() -> None:
    outcome = carry_out(PLAIN, byte_by_byte(RTU.encode(WIND), 0.0))
    assert code(outcome) is FaultCode.TIMEOUT
    assert outcome.fault is not None
    assert "own request" in outcome.fault.message


@pytest.mark.parametrize("heard", [ANSWER[:5], BROKEN, ANSWER[:2]])
def test_a_begun_answer_is_given_up_after_silence_and_not_after_the_time_out(heard: bytes) -> None:
    outcome = carry_out(PLAIN, [(SENT_END + 0.015, heard)])
    assert outcome.ended == pytest.approx(SENT_END + 0.015 + HUSH)
    assert outcome.answered
    assert outcome.unsolicited == 0


def test_bytes_that_begin_no_answer_end_it_after_the_slaves_usual_turnaround() -> None:
    outcome = carry_out(PLAIN, [(SENT_END + 0.005, b"\xff\xff")])
    assert outcome.ended == pytest.approx(SENT_END + 0.03)
    assert (outcome.answered, outcome.unsolicited) == (False, 2)
    later = carry_out(PLAIN, [(SENT_END + 0.028, b"\xff\xff")])
    assert later.ended == pytest.approx(SENT_END + 0.028 + HUSH)


def test_without_a_learned_turnaround_they_end_it_at_the_time_out() -> None:
    outcome = carry_out(replace(PLAIN, patience=None), [(SENT_END + 0.005, b"\xff\xff")])
    assert outcome.ended == pytest.approx(SENT_END + 0.2)


def test_a_learned_turnaround_beyond_the_time_out_does_not_count() -> None:
    outcome = carry_out(replace(PLAIN, patience=5.0), [(SENT_END + 0.005, b"\xff\xff")])
    assert outcome.ended == pytest.approx(SENT_END + 0.2)


def test_after_another_slaves_frame_ours_is_waited_for() -> None:
    stranger = framed("040304414FD70A")
    outcome = carry_out(PLAIN, [(0.02, stranger), (0.15, ANSWER)])
    assert outcome.answer == VALUES
    assert outcome.unsolicited == 9
    alone = carry_out(PLAIN, [(0.02, stranger)])
    assert code(alone) is FaultCode.WRONG_SLAVE
    assert alone.ended == pytest.approx(SENT_END + 0.2)


def test_a_babbling_line_is_given_up_after_the_time_out_and_the_longest_answer() -> None:
    outcome = carry_out(PLAIN, [(0.01 + i * 0.001, b"\x55") for i in range(5000)])
    assert code(outcome) is FaultCode.CRC
    assert outcome.ended == pytest.approx(SENT_END + 0.2 + 9 * CHARACTER + HUSH, abs=0.002)
    assert outcome.quiet_since == pytest.approx(outcome.ended, abs=0.002)


def test_a_line_that_begins_answers_for_ever_is_given_up_then_too() -> None:
    outcome = carry_out(PLAIN, [(0.01 + i * 0.001, b"\x01\x03\x04") for i in range(5000)])
    assert code(outcome) is FaultCode.CRC
    assert outcome.ended == pytest.approx(SENT_END + 0.2 + 9 * CHARACTER + HUSH, abs=0.01)


def test_a_babbling_ascii_line_is_given_up_after_one_pause() -> None:
    outcome = carry_out(attempt(WIND, ASCII), [(0.02 + i * 0.001, b"\x55") for i in range(5000)])
    assert outcome.ended == pytest.approx(17 * CHARACTER + 0.2 + 19 * CHARACTER + 1.0, abs=0.002)


def test_an_ascii_line_that_begins_for_ever_is_given_up_too() -> None:
    outcome = carry_out(attempt(WIND, ASCII), [(0.05 + i * 0.1, b":0103") for i in range(1000)])
    assert code(outcome) is FaultCode.CRC
    assert outcome.ended <= 0.3 + 19.0


def test_only_the_last_of_very_much_is_told() -> None:
    outcome = carry_out(PLAIN, [(0.02 + i * 0.001, b"\x55" * 900) for i in range(10)])
    assert len(outcome.heard) == 1024
    assert outcome.unsolicited == 9000
