"""One request and its answer: every rule of the exchange, in virtual time."""

from __future__ import annotations

from dataclasses import replace
from math import inf

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lfs10d.modbus.exchange import (
    TRANSITIONS,
    Attempt,
    Echo,
    Exchange,
    Happening,
    LateAnswer,
    Listen,
    MisuseError,
    Outcome,
    Pending,
    Quiet,
    Send,
    Settled,
    State,
)
from lfs10d.modbus.frames import Checksum, Codec, Framing, ReadRegisters, WriteRegister
from lfs10d.modbus.timing import LineTiming
from lfs10d.reading import FaultCode

RTU, SUM, ASCII = Codec(Framing.RTU), Codec(Framing.RTU, Checksum.SUM), Codec(Framing.ASCII)
T9600 = LineTiming.of(9600)
CHARACTER = T9600.character
WIND = ReadRegisters(1, 0x0001, 2)
WHO = ReadRegisters(1, 0x0005, 1)
MOVE = WriteRegister(1, 0x0005, 7)
ANSWER = bytes.fromhex("010304414FD70A002F")
VALUES = (0x414F, 0xD70A)
BROKEN = bytes.fromhex("010304414FD70A0030")
REFUSED = bytes.fromhex("018302C0F1")
SENT_END = 8 * CHARACTER
"""Of an RTU request begun at 0 and written in no time."""
HUSH = T9600.t35 + 0.004


def framed(body: str, codec: Codec = RTU) -> bytes:
    return codec.wrap(bytes.fromhex(body))


def attempt(request: ReadRegisters | WriteRegister = WIND, codec: Codec = RTU) -> Attempt:
    """Return an attempt with a time-out of 200 ms, a learned turnaround of 30 ms and an adapter without echo."""
    return Attempt(
        request=request,
        codec=codec,
        timing=T9600,
        timeout=0.2,
        patience=0.03,
        echo=Echo.OFF,
        adapter_latency=0.004,
        earlier=(),
        turn=0.5,
        paced=True,
    )


PLAIN = attempt()


def byte_by_byte(data: bytes, begin: float) -> list[tuple[float, bytes]]:
    """Return the bytes of a frame, each when its last bit has come."""
    return [(begin + (i + 1) * CHARACTER, data[i : i + 1]) for i in range(len(data))]


def carry_out(
    each: Attempt, arrivals: list[tuple[float, bytes]], *, asked: float = 0.0, quiet_since: float = -1.0
) -> Outcome:
    """Obey an exchange as the bus does: sleep, read what is there, step."""
    exchange = Exchange(each, asked=asked, quiet_since=quiet_since)
    waiting = sorted(arrivals, key=lambda arrival: arrival[0])
    now = asked
    while True:
        there = b"".join(data for at, data in waiting if at <= now)
        waiting = [arrival for arrival in waiting if arrival[0] > now]
        exchange.received(there, now)
        match exchange.step(now):
            case Settled(outcome):
                return outcome
            case Send():
                exchange.sent(now, now)
            case Quiet(until):
                now = min([until, *(at for at, _ in waiting)])
            case Listen(until, not_before):
                now = min([until, *(max(at, not_before) for at, _ in waiting)])


def code(outcome: Outcome) -> FaultCode | None:
    assert (outcome.answer is None) is (outcome.fault is not None)
    return outcome.fault.code if outcome.fault else None


def listening(each: Attempt = PLAIN) -> Exchange:
    """Return an exchange whose request was begun at 0 and written in no time."""
    exchange = Exchange(each, asked=0.0, quiet_since=-1.0)
    assert exchange.step(0.0) == Send(each.codec.encode(each.request))
    exchange.sent(0.0, 0.0)
    return exchange


# -- silence


def test_a_request_waits_for_the_gap_since_the_last_byte() -> None:
    exchange = Exchange(PLAIN, asked=10.0, quiet_since=10.0)
    assert exchange.step(10.0) == Quiet(10.0 + T9600.gap)
    assert exchange.step(10.0 + T9600.gap - 1e-6) == Quiet(10.0 + T9600.gap)
    assert exchange.step(10.0 + T9600.gap) == Send(bytes.fromhex("01030001000295CB"))


def test_a_byte_in_the_silence_restarts_it() -> None:
    exchange = Exchange(PLAIN, asked=10.0, quiet_since=10.0)
    exchange.received(b"\xff", 10.002)
    assert exchange.step(10.002) == Quiet(10.002 + T9600.gap)
    assert exchange.quiet_since == 10.002


def test_a_byte_after_the_silence_and_before_the_request_restarts_it() -> None:
    exchange = Exchange(PLAIN, asked=10.0, quiet_since=0.0)
    assert isinstance(exchange.step(10.0), Send)
    assert isinstance(exchange.step(10.0005), Send)
    exchange.received(b"\xff", 10.001)
    assert exchange.step(10.001) == Quiet(10.001 + T9600.gap)


def test_a_longer_gap_can_be_asked_for_and_a_shorter_one_not() -> None:
    longer = Exchange(replace(PLAIN, gap=0.05), asked=0.0, quiet_since=0.0)
    assert longer.step(0.0) == Quiet(0.05)
    shorter = Exchange(replace(PLAIN, gap=0.001), asked=0.0, quiet_since=0.0)
    assert shorter.step(0.0) == Quiet(T9600.gap)


def test_a_line_that_never_falls_silent_is_a_collision_and_nothing_is_sent() -> None:
    outcome = carry_out(PLAIN, [(i * 0.003, b"\x55") for i in range(1000)])
    assert code(outcome) is FaultCode.COLLISION
    assert (outcome.began, outcome.sent_end, outcome.sent, outcome.gap) == (None, None, b"", None)
    assert outcome.ended == pytest.approx(0.5, abs=0.003)
    assert outcome.fault is not None
    assert outcome.fault.heard == b"\x55" * 32
    assert outcome.unsolicited == len(outcome.heard) > 100
    assert (outcome.answered, outcome.echoed) == (False, None)


def test_a_silence_still_running_is_no_babble() -> None:
    outcome = carry_out(replace(PLAIN, turn=0.001), [], quiet_since=0.0)
    assert outcome.began == T9600.gap


def test_the_measured_gap_is_told() -> None:
    assert carry_out(PLAIN, [], quiet_since=-0.5).gap == 0.5
    assert carry_out(PLAIN, [], quiet_since=-inf).gap is None


# -- the answer


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
    assert outcome.fault.message == "exception 02 illegal register address"
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


# -- no answer


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


# -- late answers


LATE = framed("0103020007")
"""The answer to `WHO`, which the exchange of `WIND` may still hear."""
AFTER_WHO = replace(PLAIN, earlier=(Pending(WHO, RTU, -0.3),))


def test_a_late_answer_is_dropped_and_told_and_ours_still_comes() -> None:
    outcome = carry_out(AFTER_WHO, [(0.02, LATE), (0.1, ANSWER)])
    assert outcome.answer == VALUES
    assert outcome.late == (LateAnswer(WHO, 0.02 + 0.3),)
    assert outcome.unsolicited == 0
    assert not outcome.ambiguous


def test_a_late_answer_alone_is_late_at_the_time_out() -> None:
    outcome = carry_out(AFTER_WHO, [(0.02, LATE)])
    assert code(outcome) is FaultCode.LATE
    assert outcome.ended == pytest.approx(SENT_END + 0.2)
    assert not outcome.answered


def test_after_a_late_answer_the_slave_gets_its_usual_time_again() -> None:
    outcome = carry_out(AFTER_WHO, [(SENT_END + 0.199, LATE), (SENT_END + 0.22, ANSWER)])
    assert outcome.answer == VALUES


OTHER = ReadRegisters(4, 0x0001, 2)
LATE_OTHER = framed("040304414FD70A")
AFTER_OTHER = replace(PLAIN, elsewhere={4: (Pending(OTHER, RTU, -0.3),)})


@pytest.mark.parametrize(
    ("arrivals", "fault"),
    [
        pytest.param([(0.05, LATE_OTHER), (0.1, ANSWER)], None, id="ours still comes"),
        pytest.param([(0.05, ANSWER + LATE_OTHER)], None, id="behind ours"),
        pytest.param([(0.05, LATE_OTHER)], FaultCode.LATE, id="alone"),
    ],
)
def test_a_late_answer_of_another_slave_is_dropped_and_told(
    arrivals: list[tuple[float, bytes]], fault: FaultCode | None
) -> None:
    outcome = carry_out(AFTER_OTHER, arrivals)
    assert outcome.late == (LateAnswer(OTHER, 0.05 + 0.3),)
    assert code(outcome) is fault
    assert outcome.unsolicited == 0


def test_a_late_answer_of_another_slave_gives_ours_no_more_time() -> None:
    outcome = carry_out(AFTER_OTHER, [(SENT_END + 0.199, LATE_OTHER)])
    assert [late.request for late in outcome.late] == [OTHER]
    assert outcome.ended == pytest.approx(SENT_END + 0.199 + HUSH)


def test_late_answers_of_other_slaves_are_told_of_a_babbling_line_too() -> None:
    each = replace(AFTER_OTHER, turn=0.01)
    outcome = carry_out(each, [(0.001, LATE_OTHER), *((0.002 * n, b"\xff") for n in range(1, 9))], quiet_since=0.0)
    assert code(outcome) is FaultCode.COLLISION
    assert [late.request for late in outcome.late] == [OTHER]


def test_a_late_answer_in_the_silence_is_told_too() -> None:
    outcome = carry_out(AFTER_WHO, [(0.001, LATE), (0.1, ANSWER)], quiet_since=0.0)
    assert outcome.answer == VALUES
    assert [late.request for late in outcome.late] == [WHO]
    assert outcome.began == pytest.approx(0.001 + T9600.gap)


def test_a_late_answer_while_our_request_is_on_its_way_is_told_too() -> None:
    outcome = carry_out(AFTER_WHO, [(0.002, LATE)])
    assert code(outcome) is FaultCode.LATE


def test_noise_beside_a_late_answer_is_still_late_but_a_broken_answer_is_not() -> None:
    assert code(carry_out(AFTER_WHO, [(0.02, LATE + b"\xff")])) is FaultCode.LATE
    assert code(carry_out(AFTER_WHO, [(0.02, LATE + BROKEN)])) is FaultCode.CRC


def test_two_answers_of_one_shape_are_two_late_answers() -> None:
    each = replace(PLAIN, earlier=(Pending(WHO, RTU, -0.6), Pending(WHO, RTU, -0.3)))
    outcome = carry_out(each, [(0.02, LATE), (0.03, LATE), (0.04, LATE), (0.1, ANSWER)])
    assert [late.latency for late in outcome.late] == [pytest.approx(0.62), pytest.approx(0.33)]
    assert outcome.answer == VALUES
    assert outcome.unsolicited == len(LATE)


def test_an_older_answer_cannot_follow_a_younger_one() -> None:
    """A slave answers in order."""
    older, younger = ReadRegisters(1, 0x0001, 3), WHO
    each = replace(PLAIN, earlier=(Pending(older, RTU, -0.6), Pending(younger, RTU, -0.3)))
    outcome = carry_out(each, [(0.02, LATE), (0.022, framed("010306000100020003"))])
    assert [late.request for late in outcome.late] == [younger]
    assert code(outcome) is FaultCode.MALFORMED


def test_an_exception_may_be_that_of_an_earlier_request() -> None:
    assert carry_out(AFTER_WHO, [(0.02, REFUSED)]).ambiguous
    assert not carry_out(AFTER_WHO, [(0.02, LATE + REFUSED)]).ambiguous
    of_a_write = replace(PLAIN, earlier=(Pending(MOVE, RTU, -0.3),))
    assert not carry_out(of_a_write, [(0.02, REFUSED)]).ambiguous


def test_the_exception_of_an_earlier_write_is_late() -> None:
    each = replace(PLAIN, earlier=(Pending(MOVE, RTU, -0.3),))
    assert [late.request for late in carry_out(each, [(0.02, framed("018602"))]).late] == [MOVE]


def test_an_answer_that_another_earlier_request_could_have_is_marked() -> None:
    other = ReadRegisters(1, 0x0004, 1)
    asked = replace(attempt(WHO), earlier=(Pending(other, RTU, -0.3),))
    assert carry_out(asked, [(0.02, LATE)]).ambiguous
    same = replace(attempt(WHO), earlier=(Pending(WHO, RTU, -0.3),))
    outcome = carry_out(same, [(0.02, LATE)])
    assert (outcome.answer, outcome.ambiguous) == ((7,), False)


# -- echo


ECHOING = replace(PLAIN, echo=Echo.ON)
UNKNOWN = replace(PLAIN, echo=Echo.UNKNOWN)
REQUEST = RTU.encode(WIND)


@pytest.mark.parametrize("each", [ECHOING, UNKNOWN, PLAIN])
@pytest.mark.parametrize("piecewise", [True, False])
def test_an_echo_hides_no_answer(each: Attempt, *, piecewise: bool) -> None:
    echo = byte_by_byte(REQUEST, 0.0) if piecewise else [(SENT_END + 0.001, REQUEST)]
    outcome = carry_out(each, echo + byte_by_byte(ANSWER, SENT_END + 0.005))
    assert outcome.answer == VALUES
    assert outcome.echoed is True


@pytest.mark.parametrize("each", [ECHOING, UNKNOWN])
def test_echo_and_answer_in_one_piece_are_taken_apart(each: Attempt) -> None:
    outcome = carry_out(each, [(0.03, REQUEST + ANSWER)])
    assert (outcome.answer, outcome.echoed, outcome.unsolicited) == (VALUES, True, 0)


@pytest.mark.parametrize("each", [ECHOING, UNKNOWN])
def test_nothing_at_all_is_a_timeout_on_an_echoing_adapter_too(each: Attempt) -> None:
    assert code(carry_out(each, [])) is FaultCode.TIMEOUT


@pytest.mark.parametrize("each", [ECHOING, UNKNOWN])
def test_nothing_but_echo_is_a_timeout(each: Attempt) -> None:
    outcome = carry_out(each, byte_by_byte(REQUEST, 0.0))
    assert code(outcome) is FaultCode.TIMEOUT
    assert outcome.echoed is True
    assert outcome.ended == pytest.approx(SENT_END + 0.2)


def test_a_missing_echo_is_proved_by_an_answer_only() -> None:
    assert carry_out(UNKNOWN, [(0.03, ANSWER)]).echoed is False
    assert carry_out(UNKNOWN, [(0.03, REFUSED)]).echoed is False
    assert carry_out(UNKNOWN, [(0.03, BROKEN)]).echoed is None
    assert carry_out(UNKNOWN, []).echoed is None


def test_an_echo_behind_noise_proves_nothing() -> None:
    assert carry_out(UNKNOWN, [(0.03, b"\x00" + REQUEST + ANSWER)]).echoed is None


@pytest.mark.parametrize("latency", [0.0, 0.016])
def test_a_changed_echo_is_a_collision(latency: float) -> None:
    changed = REQUEST[:4] + b"\x55" + REQUEST[5:]
    outcome = carry_out(ECHOING, [(at + latency, byte) for at, byte in byte_by_byte(changed, 0.0)])
    assert code(outcome) is FaultCode.COLLISION


def test_an_echo_cut_short_is_a_collision() -> None:
    assert code(carry_out(ECHOING, byte_by_byte(REQUEST[:5], 0.0))) is FaultCode.COLLISION


def test_a_changed_echo_hides_no_answer_of_a_read() -> None:
    outcome = carry_out(ECHOING, [(0.009, b"\x55" + REQUEST[1:]), (0.03, ANSWER)])
    assert (outcome.answer, outcome.echoed) == (VALUES, False)


def test_an_echo_expected_in_vain_hides_no_answer_of_a_read() -> None:
    assert carry_out(ECHOING, [(0.03, ANSWER)]).answer == VALUES


CONFIRMED = framed("010600050007")


@pytest.mark.parametrize("echo", [Echo.ON, Echo.UNKNOWN])
def test_a_write_needs_echo_and_answer(echo: Echo) -> None:
    each = replace(attempt(MOVE), echo=echo)
    both = carry_out(each, [(0.009, CONFIRMED), (0.03, CONFIRMED)])
    assert (both.answer, both.echoed) == ((7,), True)
    one = carry_out(each, [(0.009, CONFIRMED)])
    assert code(one) is FaultCode.TIMEOUT
    assert one.echoed is (True if echo is Echo.ON else None)
    changed = carry_out(each, [(0.009, b"\x00" + CONFIRMED)])
    assert code(changed) is FaultCode.COLLISION
    refused = carry_out(each, [(0.009, CONFIRMED), (0.03, framed("018602"))])
    assert code(refused) is FaultCode.EXCEPTION


def test_a_cut_answer_that_looks_like_echo_so_far_is_given_up_like_any() -> None:
    outcome = carry_out(UNKNOWN, [(0.03, ANSWER[:2])])
    assert code(outcome) is FaultCode.MALFORMED
    assert outcome.ended == pytest.approx(0.03 + HUSH)
    assert outcome.answered


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


# -- broadcast


EVERYBODY = attempt(WriteRegister(0, 0x0005, 7))


def test_a_broadcast_is_over_after_its_silence() -> None:
    outcome = carry_out(EVERYBODY, [(0.05, b"\x00\x06\xff")])
    assert (outcome.answer, outcome.fault) == ((), None)
    assert outcome.ended == pytest.approx(SENT_END + 0.1)
    assert outcome.unsolicited == 3


def test_a_broadcast_whose_echo_was_changed_is_a_collision() -> None:
    each = replace(EVERYBODY, echo=Echo.ON)
    whole = RTU.encode(each.request)
    assert carry_out(each, byte_by_byte(whole, 0.0)).answer == ()
    assert code(carry_out(each, byte_by_byte(b"\x55" + whole[1:], 0.0))) is FaultCode.COLLISION


# -- the machine


def test_the_shell_may_sleep_until_the_frame_can_be_whole() -> None:
    exchange = listening()
    exchange.received(ANSWER[:1], 0.02)
    first = exchange.step(0.02)
    assert isinstance(first, Listen)
    assert first.until == pytest.approx(SENT_END + 0.03)
    assert first.not_before == pytest.approx(0.02 + 8 * CHARACTER)
    exchange.received(ANSWER[1:5], 0.021)
    soon = exchange.step(0.021)
    assert isinstance(soon, Listen)
    assert soon.until == pytest.approx(0.021 + HUSH)
    assert soon.not_before == pytest.approx(0.021 + 4 * CHARACTER)


def test_it_never_sleeps_longer_than_it_listens() -> None:
    slow = LineTiming.of(1200)
    each = replace(attempt(ReadRegisters(1, 0, 125)), timing=slow)
    exchange = listening(each)
    exchange.received(b"\x01\x03\xfa", 0.1)
    decision = exchange.step(0.1)
    assert isinstance(decision, Listen)
    assert decision.not_before == decision.until


def test_while_nothing_is_known_every_byte_is_waited_for() -> None:
    assert listening().step(0.001) == Listen(SENT_END + 0.2, 0.001)


def test_while_an_echo_comes_back_the_shell_may_sleep_to_its_end() -> None:
    exchange = listening(ECHOING)
    exchange.received(REQUEST[:2], 0.002)
    decision = exchange.step(0.002)
    assert isinstance(decision, Listen)
    assert decision.not_before == pytest.approx(0.002 + 6 * CHARACTER)


def test_a_settled_exchange_stays_settled() -> None:
    exchange = listening()
    exchange.received(ANSWER, 0.03)
    settled = exchange.step(0.03)
    assert isinstance(settled, Settled)
    exchange.received(b"\xff", 0.04)
    assert exchange.step(0.05) == settled
    assert exchange.quiet_since == 0.04
    assert exchange.state is State.SETTLED


def test_what_follows_the_answer_before_it_is_settled_is_unsolicited() -> None:
    exchange = listening()
    exchange.received(ANSWER, 0.03)
    exchange.received(ANSWER[:3], 0.031)
    settled = exchange.step(0.031)
    assert isinstance(settled, Settled)
    assert (settled.outcome.answer, settled.outcome.unsolicited) == (VALUES, 3)


@pytest.mark.parametrize("state", [State.SILENCE, State.LISTENING, State.SETTLED])
def test_sending_unasked_is_refused_and_changes_nothing(state: State) -> None:
    exchange = Exchange(PLAIN, asked=0.0, quiet_since=0.0) if state is State.SILENCE else listening()
    if state is State.SETTLED:
        exchange.step(1.0)
    before = exchange.step(0.001)
    with pytest.raises(MisuseError, match=f"in state {state} cannot be told sent"):
        exchange.sent(0.001, 0.001)
    assert exchange.state is state
    assert exchange.step(0.001) == before


def test_a_request_cannot_be_written_before_it_was_begun() -> None:
    exchange = Exchange(PLAIN, asked=0.0, quiet_since=-1.0)
    exchange.step(0.0)
    with pytest.raises(MisuseError, match="before it was begun"):
        exchange.sent(0.002, 0.001)
    assert exchange.state is State.READY


def test_every_state_can_be_reached_and_left_by_the_table() -> None:
    assert {happening for _, happening in TRANSITIONS} == set(Happening)
    assert {state for state, _ in TRANSITIONS} == set(State) - {State.SETTLED}
    assert set(TRANSITIONS.values()) == set(State)


# -- laws

TIMES = st.floats(0.0, 0.4, allow_nan=False)
PIECES = st.one_of(
    st.binary(max_size=20),
    st.sampled_from([ANSWER, ANSWER[:4], ANSWER[4:], BROKEN, REFUSED, LATE, REQUEST, CONFIRMED, framed("048302")]),
    st.sampled_from([b":010304D0F5000033\r\n", b":0103", b"04D0F5000033\r\n", b":"]),
)
ATTEMPTS = st.builds(
    replace,
    st.builds(attempt, st.sampled_from([WIND, WHO, MOVE, WriteRegister(0, 5, 7)]), st.sampled_from([RTU, SUM, ASCII])),
    patience=st.sampled_from([None, 0.0, 0.03, 9.0]),
    echo=st.sampled_from(list(Echo)),
    paced=st.booleans(),
    gap=st.sampled_from([None, 0.05]),
)


@given(ATTEMPTS, st.lists(st.tuples(TIMES, PIECES), max_size=20), st.integers(0, 2))
def test_whatever_comes_it_settles_by_a_bound_and_believes_no_wrong_frame(
    each: Attempt, arrivals: list[tuple[float, bytes]], pending: int
) -> None:
    earlier = (Pending(WHO, each.codec, -0.3), Pending(MOVE, each.codec, -0.2))
    each = replace(each, earlier=earlier[:pending])
    outcome = carry_out(each, arrivals)
    request = each.request
    slack = 18.0 if each.codec is ASCII else 0.0
    assert outcome.ended <= 0.5 + 0.2 + 0.2 + slack
    assert (outcome.answer is None) is (outcome.fault is not None)
    heard = b"".join(data for _, data in sorted(arrivals, key=lambda arrival: arrival[0])).upper()
    if outcome.answer and isinstance(request, ReadRegisters):
        body = bytes((request.slave, request.function, 2 * request.count))
        body += b"".join(register.to_bytes(2, "big") for register in outcome.answer)
        assert each.codec.wrap(body).upper() in heard
    elif outcome.answer:
        assert heard.count(each.codec.encode(request).upper()) >= (1 if each.echo is Echo.OFF else 2)
    assert 0 <= outcome.unsolicited <= len(heard)
    assert len(outcome.late) <= len(each.earlier)
    if outcome.gap is not None:
        assert outcome.gap >= max(each.timing.gap, each.gap or 0.0) - 1e-9


def test_an_outcome_says_what_was_asked_when_and_what_was_sent() -> None:
    outcome = carry_out(PLAIN, [], asked=1.0, quiet_since=0.9)
    assert (outcome.request, outcome.asked, outcome.began, outcome.sent) == (WIND, 1.0, 1.0, RTU.encode(WIND))
    assert outcome.sent_end == pytest.approx(1.0 + SENT_END)


def test_only_a_refusal_has_an_exception_code() -> None:
    fault = carry_out(PLAIN, []).fault
    assert fault is not None
    assert fault.exception_code is None


def test_a_write_that_ends_before_it_began_is_a_mistake() -> None:
    exchange = Exchange(PLAIN, asked=0.0, quiet_since=-1.0)
    exchange.step(0.0)
    with pytest.raises(MisuseError, match=r"^a request cannot have been written before it was begun$"):
        exchange.sent(1.0, 0.9)
    assert exchange.state is State.READY
