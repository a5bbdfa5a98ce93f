"""The oracle must know what it said, and to whom."""

from __future__ import annotations

import json
import math
import struct
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lfs10d.profiles.library import load_profile
from soak import oracle as oracles
from soak.ledger import Told
from soak.oracle import COUNT, Excuse, Numbered, Oracle, Sent, number_of, value_of

NUMBERS = st.integers(0, COUNT - 1)


def told(number: int, *, seq: int = 1, at: float = 100.0) -> Told:
    return Told("slave-1", "k0000001", seq, round(at * 1000), value_of(number), None, "good", historical=False)


def sent(number: int, *, at: float = 100.0, believable: bool = True, prompt: bool = True) -> Sent:
    return Sent(number, "slave-1", at, believable, prompt)


@given(NUMBERS)
def test_a_value_leads_back_to_its_number(number: int) -> None:
    value = value_of(number)
    assert number_of(value) == number
    assert number_of(json.loads(f"{value:.9g}")) == number  # nine digits tell any float32
    assert 0 < value <= 100
    assert struct.unpack(">f", struct.pack(">f", value))[0] == value


@given(NUMBERS, NUMBERS)
def test_two_numbers_have_two_values(one: int, other: int) -> None:
    assert (value_of(one) == value_of(other)) is (one == other)


def test_steps_of_the_numbers_leave_none_out() -> None:
    assert math.gcd(oracles.STRIDE, COUNT) == 1


@pytest.mark.parametrize("bits", [oracles.FIRST_BITS, oracles.LAST_BITS])
def test_the_daemon_believes_the_least_and_the_greatest_value(bits: int) -> None:
    profile = load_profile("lfs10", relative_to=Path())
    (block,) = profile.reads()
    (value,) = struct.unpack(">f", bits.to_bytes(4, "big"))
    decoded = block.decode(struct.unpack(">HH", bits.to_bytes(4, "big")))
    assert isinstance(decoded, dict)
    assert decoded["wind_speed"] == pytest.approx(value, rel=1e-7)


@given(
    st.one_of(
        st.just(0.0), st.floats(max_value=-1e-30), st.floats(1e-45, 9.9e-7), st.floats(min_value=100.1, max_value=1e300)
    )
)
def test_what_no_sensor_sends_has_no_number(value: float) -> None:
    assert number_of(value) is None


def test_sensors_that_share_a_source_never_send_a_value_twice() -> None:
    source = Numbered()
    values = [source(0) for _ in range(1000)]
    assert len(set(values)) == 1000
    assert number_of(values[-1]) == source.drawn == 1000


def test_an_answer_is_published_by_one_sample_however_often_that_is_sent() -> None:
    oracle = Oracle()
    oracle.sent(sent(7))
    assert oracle.fault_of(told(7)) is None
    assert oracle.fault_of(told(7)) is None
    assert oracle.told_of == 1
    assert "before" in (oracle.fault_of(told(7, seq=2)) or "")


def test_an_answer_nobody_sent_is_told_from_one_forgotten() -> None:
    oracle = Oracle()
    assert oracle.fault_of(told(7)) == "no sensor sent this value within the last hour"
    nothing = Told("slave-1", "k0000001", 1, 0, 0.0, None, "good", historical=False)
    assert oracle.fault_of(nothing) == "no sensor sent this value"


def test_what_was_sent_and_not_published_is_missed_unless_it_is_excused() -> None:
    oracle = Oracle()
    for number, at in ((1, 100.0), (2, 101.0), (3, 102.0), (4, 110.0)):
        oracle.sent(sent(number, at=at))
    oracle.excuse(Excuse("SIGKILL", 100.5, 101.2, 101.5))
    assert oracle.fault_of(told(1)) is None
    assert oracle.waiting(105.0) == 1
    oracle.fold(105.0)
    assert (oracle.untold, oracle.excused, oracle.heard) == (1, {"SIGKILL": 1}, 4)
    assert oracle.reach["SIGKILL"] == pytest.approx(0.2)
    assert [each.number for each in oracle.examples] == [3]
    assert oracle.fault_of(told(4, at=110.0)) is None


def failure(at: float) -> Told:
    return Told("slave-1", "k0000001", 9, round(at * 1000), None, "timeout", "bad", historical=False)


def test_an_answer_that_was_not_believed_is_missed_if_its_poll_is_told_of() -> None:
    oracle = Oracle()
    oracle.sent(sent(1, at=100.0))
    oracle.sent(sent(2, at=105.0))
    oracle.sent(sent(3, at=110.0))
    for at in (99.5, 100.05, 104.9, 107.0, 111.0):
        assert oracle.fault_of(failure(at)) is None
    assert oracle.waiting(200.0) == 1
    oracle.fold(200.0)
    assert (oracle.missed, oracle.untold) == (2, 1)
    assert [each.number for each in oracle.examples] == [2]
    assert oracle.failed


def test_more_misses_than_a_busy_machine_explains_are_a_failure() -> None:
    for misses, failed in ((20, False), (21, True)):
        oracle = Oracle()
        for number in range(1, 1001):
            oracle.sent(sent(number, at=100.0 + number))
            one = failure(100.0 + number) if number <= misses else told(number, seq=number, at=100.0 + number)
            assert oracle.fault_of(one) is None
        oracle.fold(5000.0)
        assert (oracle.missed, oracle.untold) == (misses, 0)
        assert oracle.failed is failed


def test_damaged_and_late_answers_need_not_be_published() -> None:
    oracle = Oracle()
    oracle.sent(sent(1, believable=False))
    oracle.sent(sent(2, prompt=False))
    oracle.fold(200.0)
    assert (oracle.untold, oracle.excused) == (0, {})


def test_a_late_answer_may_be_published_if_nothing_else_was_asked_meanwhile() -> None:
    oracle = Oracle()
    oracle.sent(sent(2, prompt=False))
    assert oracle.fault_of(told(2)) is None


def test_answers_are_forgotten() -> None:
    oracle = Oracle()
    for number in range(100):
        oracle.sent(sent(number, at=100.0 + number))
        oracle.excuse(Excuse("SIGTERM", 100.0 + number, 100.0 + number, 100.5 + number))
        oracle.fold(100.0 + number - 10)
    assert len(oracle._sent) <= 11
    assert len(oracle._excuses) <= 12
