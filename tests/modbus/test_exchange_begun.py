"""What is plainly the beginning of an answer is kept, and sorted with the rest: no outcome is another one by it."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lfs10d.modbus.exchange import Exchange, Listen, Settled
from lfs10d.modbus.pending import Pending
from lfs10d.modbus.request import BROADCAST, WriteRegister
from tests.support.exchanges import (
    ANSWER,
    BROKEN,
    CHARACTER,
    CONFIRMED,
    ECHOING,
    HUSH,
    LATE,
    PLAIN,
    REFUSED,
    REQUEST,
    RTU,
    SENT_END,
    UNKNOWN,
    WHO,
    Attempt,
    attempt,
    byte_by_byte,
    carry_out,
    code,
    listening,
)
from tests.support.receptions import ASCII, WIND


def begun(exchange: Exchange, data: bytes, now: float = 0.02) -> Listen | None:
    return exchange.foreseen(data, now)


def test_the_beginning_of_an_answer_is_kept_until_all_of_it_can_be_there() -> None:
    exchange = listening()
    assert begun(exchange, ANSWER[:1]) == Listen(0.02 + HUSH, 0.02 + HUSH)
    most = begun(listening(), ANSWER[:4])
    assert most is not None
    assert most.not_before == pytest.approx(0.02 + 5 * CHARACTER)
    exchange.received(ANSWER[1:], 0.029, (ANSWER[:1], 0.02))
    settled = exchange.step(0.029)
    assert isinstance(settled, Settled)
    outcome = settled.outcome
    assert (outcome.heard, outcome.ended) == (ANSWER, 0.029)
    assert outcome.turnaround == pytest.approx(0.02 - SENT_END)


@pytest.mark.parametrize("data", [b"\x02", b"\xff", REFUSED[:2], ANSWER, ANSWER + b"\0", REQUEST[:3], b"\x01\x03\x05"])
def test_whatever_else_comes_is_sorted_at_once(data: bytes) -> None:
    assert begun(listening(), data) is None


def test_what_comes_later_is_no_beginning() -> None:
    exchange = listening()
    exchange.received(b"\xff", 0.015)
    assert begun(exchange, ANSWER[:1]) is None


@pytest.mark.parametrize("now", [0.0, SENT_END - 2 * CHARACTER])
def test_what_comes_before_the_request_can_have_left_is_no_beginning(now: float) -> None:
    assert begun(listening(), ANSWER[:1], now) is None


def test_before_the_request_nothing_is_a_beginning() -> None:
    assert begun(PLAIN.exchange(), ANSWER[:1]) is None


@pytest.mark.parametrize(
    "each",
    [
        pytest.param(ECHOING, id="an echo comes first"),
        pytest.param(UNKNOWN, id="an echo may come first"),
        pytest.param(replace(PLAIN, earlier=(Pending(WHO, RTU, -0.5),)), id="an earlier answer may come first"),
        pytest.param(attempt(WIND, ASCII), id="characters may come in capitals or not, and pause"),
    ],
)
def test_where_something_else_may_come_everything_is_sorted_at_once(each: Attempt) -> None:
    answer = each.codec.wrap(ANSWER[:-2])
    assert begun(listening(each), answer[:1], 0.05) is None


def test_nobody_answers_all() -> None:
    assert begun(listening(attempt(WriteRegister(BROADCAST, 5, 7))), b"\0", 0.05) is None


ANSWERS = st.sampled_from(
    [ANSWER, ANSWER[:5], BROKEN, REFUSED, LATE, CONFIRMED, b"\xff" + ANSWER, ANSWER + b"\xff", REQUEST]
)
PAUSES = st.lists(st.sampled_from([0.0, 0.0, CHARACTER, 3 * CHARACTER, 0.012, 0.03, 0.25]), min_size=16, max_size=16)


@given(
    answer=ANSWERS,
    begin=st.sampled_from([SENT_END - CHARACTER, SENT_END, SENT_END + 0.005, SENT_END + 0.04, SENT_END + 0.199]),
    pauses=PAUSES,
    each=st.builds(replace, st.just(PLAIN), paced=st.booleans(), patience=st.sampled_from([None, 0.03])),
)
def test_every_outcome_is_the_one_of_who_sorts_at_once(
    answer: bytes, begin: float, pauses: list[float], each: Attempt
) -> None:
    arrivals, late = [], 0.0
    for (at, data), pause in zip(byte_by_byte(answer, begin), pauses, strict=False):
        late += pause
        arrivals.append((at + late, data))
    keeping, sorting = carry_out(each, arrivals), carry_out(each, arrivals, keeps=False)
    assert (keeping.answer, code(keeping)) == (sorting.answer, code(sorting))
    if keeping.answer is not None:
        assert keeping == sorting
    else:  # of what breaks off the last piece may be read some characters sooner
        assert keeping.heard == sorting.heard
        assert keeping.quiet_since == pytest.approx(sorting.quiet_since, abs=2 * HUSH)
        assert keeping.ended == pytest.approx(sorting.ended, abs=2 * HUSH)


def test_a_beginning_counts_though_what_follows_is_faster_than_the_wire() -> None:
    at = SENT_END + 2 * CHARACTER
    arrivals = [(at, ANSWER[:3]), (at + 0.0001, bytes(40))]
    keeping, sorting = carry_out(PLAIN, arrivals), carry_out(PLAIN, arrivals, keeps=False)
    assert keeping.answered
    assert (keeping.answered, code(keeping)) == (sorting.answered, code(sorting))
