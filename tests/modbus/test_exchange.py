"""One request and its answer, in virtual time: the silence before it, the states, and the laws of it all."""

from __future__ import annotations

from dataclasses import replace
from math import inf

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lfs10d.modbus.echo import Echo
from lfs10d.modbus.exchange import TRANSITIONS, Happening, Listen, MisuseError, Quiet, Send, Settled, State
from lfs10d.modbus.pending import Pending
from lfs10d.modbus.request import ReadRegisters, WriteRegister
from lfs10d.modbus.timing import LineTiming
from lfs10d.reading import FaultCode
from tests.support.exchanges import (
    ANSWER,
    ASCII,
    BROKEN,
    CHARACTER,
    CONFIRMED,
    ECHOING,
    HUSH,
    LATE,
    MOVE,
    PLAIN,
    REFUSED,
    REQUEST,
    RTU,
    SENT_END,
    SUM,
    T9600,
    VALUES,
    WHO,
    WIND,
    Attempt,
    attempt,
    byte_by_byte,
    carry_out,
    code,
    framed,
    listening,
)

# -- silence


def test_a_request_waits_for_the_gap_since_the_last_byte() -> None:
    exchange = PLAIN.exchange(asked=10.0, quiet_since=10.0)
    assert exchange.step(10.0) == Quiet(10.0 + T9600.gap)
    assert exchange.step(10.0 + T9600.gap - 1e-6) == Quiet(10.0 + T9600.gap)
    assert exchange.step(10.0 + T9600.gap) == Send(bytes.fromhex("01030001000295CB"))


def test_a_byte_in_the_silence_restarts_it() -> None:
    exchange = PLAIN.exchange(asked=10.0, quiet_since=10.0)
    exchange.received(b"\xff", 10.002)
    assert exchange.step(10.002) == Quiet(10.002 + T9600.gap)
    assert exchange.quiet_since == 10.002


def test_a_byte_after_the_silence_and_before_the_request_restarts_it() -> None:
    exchange = PLAIN.exchange(asked=10.0, quiet_since=0.0)
    assert isinstance(exchange.step(10.0), Send)
    assert isinstance(exchange.step(10.0005), Send)
    exchange.received(b"\xff", 10.001)
    assert exchange.step(10.001) == Quiet(10.001 + T9600.gap)


def test_a_longer_gap_can_be_asked_for_and_a_shorter_one_not() -> None:
    longer = replace(PLAIN, gap=0.05).exchange(asked=0.0, quiet_since=0.0)
    assert longer.step(0.0) == Quiet(0.05)
    shorter = replace(PLAIN, gap=0.001).exchange(asked=0.0, quiet_since=0.0)
    assert shorter.step(0.0) == Quiet(T9600.gap)


def test_a_line_that_never_falls_silent_is_a_collision_and_nothing_is_sent() -> None:
    outcome = carry_out(PLAIN, [(i * 0.003, b"\x55") for i in range(1000)])
    assert code(outcome) is FaultCode.COLLISION
    assert (outcome.began, outcome.sent_end, outcome.sent, outcome.gap) == (None, None, b"", None)
    assert outcome.ended == pytest.approx(PLAIN.timeout, abs=0.003)
    assert outcome.fault is not None
    assert outcome.fault.heard == b"\x55" * 32
    assert outcome.unsolicited == len(outcome.heard) > 60
    assert (outcome.answered, outcome.echoed) == (False, None)


def test_a_silence_still_running_is_no_babble() -> None:
    outcome = carry_out(replace(PLAIN, timeout=0.001), [], quiet_since=0.0)
    assert outcome.began == T9600.gap


def test_the_measured_gap_is_told() -> None:
    assert carry_out(PLAIN, [], quiet_since=-0.5).gap == 0.5
    assert carry_out(PLAIN, [], quiet_since=-inf).gap is None


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
    assert exchange._state is State.SETTLED


def test_what_follows_the_answer_before_it_is_settled_is_unsolicited() -> None:
    exchange = listening()
    exchange.received(ANSWER, 0.03)
    exchange.received(ANSWER[:3], 0.031)
    settled = exchange.step(0.031)
    assert isinstance(settled, Settled)
    assert (settled.outcome.answer, settled.outcome.unsolicited) == (VALUES, 3)


@pytest.mark.parametrize("state", [State.SILENCE, State.LISTENING, State.SETTLED])
def test_sending_unasked_is_refused_and_changes_nothing(state: State) -> None:
    exchange = PLAIN.exchange(asked=0.0, quiet_since=0.0) if state is State.SILENCE else listening()
    if state is State.SETTLED:
        exchange.step(1.0)
    before = exchange.step(0.001)
    with pytest.raises(MisuseError, match=f"in state {state} cannot be told sent"):
        exchange.sent(0.001, 0.001)
    assert exchange._state is state
    assert exchange.step(0.001) == before


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
    exchange = PLAIN.exchange(asked=0.0, quiet_since=-1.0)
    exchange.step(0.0)
    with pytest.raises(MisuseError, match=r"^a request cannot have been written before it was begun$"):
        exchange.sent(1.0, 0.9)
    assert exchange._state is State.READY
