"""One place is asked who is there, and no late answer to an older question passes for the answer."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import cast

import pytest

from lfs10d.line.jobs.job import Hold
from lfs10d.modbus.ask import Ask
from lfs10d.modbus.duplicates import WATCHED
from lfs10d.modbus.frames import Codec, Framing
from lfs10d.modbus.outcome import LateAnswer, Outcome
from lfs10d.modbus.request import NOT_FINAL, ReadRegisters, WriteRegister
from lfs10d.profiles.library import load_profile, parse_profile
from lfs10d.reading import FaultCode
from lfs10d.reconfiguration.journal import Endpoint
from lfs10d.reconfiguration.procedures.identity_query import (
    BARRIERS,
    HEARD_WITHIN,
    PATIENT,
    QUICK,
    IdentityReply,
    quiet,
)
from tests.support.sensors import EXCHANGE, Pretence

RTU = Codec(Framing.RTU)
HERE = Endpoint(slave=3, baudrate=9600)
ELSEWHERE = Endpoint(slave=3, baudrate=19200)
WHO, WIND = ReadRegisters(3, 5, 1), ReadRegisters(3, 1, 2)
NARROW = """
name: narrow
title: One register of values, as long as that of the id
ids: [1, 247]
framings: [rtu]
checksums: [crc]
max_words: 1
values:
  - {name: level, register: 1, type: uint16, unit: "1", source: none}
slave_id: {register: 5, source: none}
"""
WITHOUT_RATE = parse_profile(NARROW, "narrow.yaml")


def test_a_profile_without_a_register_of_the_id_cannot_be_asked(pretence: Pretence) -> None:
    with pytest.raises(ValueError, match="profile ld-e defines no register of the slave id"):
        pretence.query(load_profile("ld-e", relative_to=Path()))


def test_who_answers_says_its_id(pretence: Pretence) -> None:
    pretence.sensor(3)
    assert pretence.carry_out(pretence.query().read_register(HERE)) == IdentityReply(answers=True, register=3)
    assert pretence.asked == [Ask(WHO, RTU, QUICK, None, 9600)]


def test_at_another_rate_the_question_says_so(pretence: Pretence) -> None:
    pretence.sensor(3, baudrate=19200)
    assert pretence.carry_out(pretence.query().read_register(ELSEWHERE, 0.7)).answers
    assert pretence.asked == [Ask(WHO, RTU, 0.7, None, 19200)]


def test_another_register_can_be_asked(pretence: Pretence) -> None:
    pretence.sensor(3, baudrate=19200)
    assert pretence.carry_out(pretence.query().read_register(ELSEWHERE, register=4)).register == 2
    assert pretence.requests == [ReadRegisters(3, 4, 1)]


def test_values_say_nothing_of_the_id(pretence: Pretence) -> None:
    pretence.sensor(3)
    assert pretence.carry_out(pretence.query().read_values(HERE)) == IdentityReply(answers=True)
    assert pretence.requests == [WIND]


def test_silence_noise_and_a_refusal_are_told_apart(pretence: Pretence) -> None:
    assert pretence.carry_out(pretence.query().read_register(HERE)).silent
    pretence.noise.add((4, 9600))
    noise = pretence.carry_out(pretence.query().read_register(Endpoint(slave=4, baudrate=9600)))
    assert noise == IdentityReply(noise=True)
    assert not noise.silent
    pretence.sensor(5, exception=2)
    refusal = pretence.carry_out(pretence.query().read_register(Endpoint(slave=5, baudrate=9600)))
    assert refusal == IdentityReply(answers=True, exception=2)
    assert not refusal.silent


@pytest.mark.parametrize("code", NOT_FINAL)
def test_what_a_gateway_refuses_is_no_answer_of_the_sensor_and_no_silence(pretence: Pretence, code: int) -> None:
    pretence.sensor(3, exception=code)
    reply = pretence.carry_out(pretence.query().read_register(HERE))
    assert reply == IdentityReply(exception=code)
    assert not reply.silent


def reply_to(pretence: Pretence, outcome: Outcome) -> tuple[IdentityReply, float]:
    """Return what is made of one outcome, and how long the next question waits."""
    query = pretence.query()
    steps = query.read_register(HERE)
    next(steps)
    with pytest.raises(StopIteration) as end:
        steps.send(outcome)
    reply = end.value.value
    assert isinstance(reply, IdentityReply)
    return reply, query.timeout


def test_a_refusal_that_may_be_an_older_ones_is_no_answer(
    pretence: Pretence, outcome_of: Callable[..., Outcome]
) -> None:
    reply, _ = reply_to(pretence, outcome_of(WHO, exception=2, ambiguous=True))
    assert reply == IdentityReply(noise=True)


def test_a_second_frame_behind_the_answer_is_noise_and_a_few_bytes_are_not(
    pretence: Pretence, outcome_of: Callable[..., Outcome]
) -> None:
    reply, _ = reply_to(pretence, outcome_of(WHO, answer=(3,), unsolicited=5))
    assert reply == IdentityReply(answers=True, noise=True, register=3)
    reply, _ = reply_to(pretence, outcome_of(WHO, answer=(3,), unsolicited=4))
    assert reply == IdentityReply(answers=True, register=3)


@pytest.mark.parametrize(("turnaround", "timeout"), [(0.1, QUICK), (0.101, PATIENT), (None, QUICK)])
def test_a_slow_sensor_is_waited_for_longer_from_then_on(
    pretence: Pretence, outcome_of: Callable[..., Outcome], turnaround: float | None, timeout: float
) -> None:
    assert reply_to(pretence, outcome_of(WHO, answer=(3,), turnaround=turnaround))[1] == timeout


@pytest.mark.parametrize(("slave", "timeout"), [(3, PATIENT), (4, QUICK)])
def test_so_is_one_whose_own_answer_came_late(
    pretence: Pretence, outcome_of: Callable[..., Outcome], slave: int, timeout: float
) -> None:
    late = LateAnswer(ReadRegisters(slave, 1, 2), 0.3)
    assert reply_to(pretence, outcome_of(WHO, FaultCode.LATE, late=(late,)))[1] == timeout


def test_after_silence_the_values_go_first_and_then_the_silence_is_waited_out(pretence: Pretence) -> None:
    query = pretence.query()
    assert pretence.carry_out(query.read_register(HERE)).silent
    pretence.sensor(3)
    assert pretence.carry_out(query.read_register(HERE)) == IdentityReply(answers=True, register=3)
    assert pretence.requests == [WHO, WIND, WHO]
    assert pretence.clock.now >= 1.0


def test_while_the_values_are_not_answered_the_id_is_not_asked_again(pretence: Pretence) -> None:
    query = pretence.query()
    pretence.carry_out(query.read_register(HERE))
    assert pretence.carry_out(query.read_register(HERE)).silent
    assert pretence.requests == [WHO, WIND]


def asked_all_the_time(pretence: Pretence) -> Callable[[Ask], Outcome]:
    """Return what carries out an exchange while another master asks the slave something of the id's shape."""
    carry_out = pretence.outcome

    def outcome(ask: Ask) -> Outcome:
        came = carry_out(ask)
        pretence.pending.asked_by_another(ReadRegisters(3, 1, 1), RTU, pretence.clock.now)
        return came

    return outcome


def test_where_another_master_asks_all_the_time_the_id_is_given_up(
    pretence: Pretence, monkeypatch: pytest.MonkeyPatch
) -> None:
    pretence.sensor(3)
    monkeypatch.setattr(pretence, "outcome", asked_all_the_time(pretence))
    pretence.pending.asked_by_another(ReadRegisters(3, 1, 1), RTU, 0.0)
    assert pretence.carry_out(pretence.query().read_register(HERE)) == IdentityReply(noise=True)
    assert pretence.requests == [WIND] * BARRIERS


def test_an_answer_to_another_master_may_be_known_a_little_later(pretence: Pretence) -> None:
    pretence.sensor(3)
    pretence.pending.asked_by_another(ReadRegisters(3, 1, 1), RTU, 0.0)
    steps = pretence.query().read_register(HERE)
    outcome = pretence.outcome(cast("Ask", next(steps)))
    pretence.pending.asked_by_another(ReadRegisters(3, 1, 1), RTU, pretence.clock.now)
    assert steps.send(outcome) == Hold(pretence.clock.now + HEARD_WITHIN)
    assert pretence.pending.overheard(3, 7, exception=None, now=pretence.clock.now)
    assert cast("Ask", next(steps)).request == WHO


def test_without_a_second_shape_the_slave_is_left_alone_first(pretence: Pretence) -> None:
    query = pretence.query(parse_profile(NARROW, "narrow.yaml"))
    assert pretence.carry_out(query.read_register(HERE)).silent
    pretence.sensor(3)
    assert pretence.carry_out(query.read_register(HERE)).register == 3
    assert pretence.requests == [WHO, WHO]
    assert pretence.clock.now >= 1.0


def test_values_wait_for_a_slave_that_is_left_alone(pretence: Pretence) -> None:
    query = pretence.query()
    pretence.carry_out(query.read_register(HERE))
    pretence.pending.leave_alone(3, 0.5)
    pretence.sensor(3)
    assert pretence.carry_out(query.read_values(HERE)).answers
    assert pretence.clock.now >= 1.0


def test_where_nothing_is_pending_nothing_is_asked_to_settle(pretence: Pretence) -> None:
    assert pretence.carry_out(pretence.query().settle(HERE))
    assert pretence.requests == []


def test_it_is_settled_once_the_sensor_answers_and_the_silence_is_over(pretence: Pretence) -> None:
    query = pretence.query()
    pretence.carry_out(query.read_register(HERE))
    pretence.sensor(3)
    assert pretence.carry_out(query.settle(HERE))
    assert pretence.pending.earlier(3) == ()


def test_a_slave_that_is_left_alone_is_settled_after_that(pretence: Pretence) -> None:
    query = pretence.query()
    pretence.carry_out(query.read_register(HERE))
    pretence.pending.leave_alone(3, 0.5)
    until = pretence.pending.left_alone_until(3, pretence.clock.now)
    pretence.sensor(3)
    assert pretence.carry_out(query.settle(HERE))
    assert until is not None
    assert pretence.clock.now >= until


def test_a_slave_that_stays_silent_is_never_settled(pretence: Pretence) -> None:
    query = pretence.query()
    pretence.carry_out(query.read_register(HERE))
    assert not pretence.carry_out(query.settle(HERE))


def test_quiet_is_a_silence_in_which_only_others_answered_late(outcome_of: Callable[..., Outcome]) -> None:
    own, others = (LateAnswer(ReadRegisters(slave, 1, 2), 0.3) for slave in (3, 4))
    assert quiet(outcome_of(WHO))
    assert quiet(outcome_of(WHO, FaultCode.LATE, late=(others,)))
    assert not quiet(outcome_of(WHO, FaultCode.LATE, late=(others, own)))
    assert not quiet(outcome_of(WHO, FaultCode.MALFORMED))
    assert not quiet(outcome_of(WHO, unsolicited=1))
    assert not quiet(outcome_of(WHO, answer=(3,)))


def test_so_is_one_whose_answer_came_while_another_was_asked(
    pretence: Pretence, outcome_of: Callable[..., Outcome]
) -> None:
    late = LateAnswer(WHO, 0.4)
    pretence.pending.on_outcome(outcome_of(ReadRegisters(9, 1, 2), late=(late,)), RTU, QUICK, 1.0)
    pretence.carry_out(pretence.query().read_register(HERE))
    pretence.carry_out(pretence.query().read_register(Endpoint(slave=9, baudrate=9600)))
    assert [ask.timeout for ask in pretence.asked if ask.request == WHO] == [PATIENT]
    assert pretence.asked[-1].timeout == QUICK


def test_listening_asks_a_silent_place_behind_the_exchange_before(pretence: Pretence) -> None:
    silent = Endpoint(slave=9, baudrate=9600)
    assert pretence.carry_out(pretence.query().listen(silent, 0.3, 3)) == (IdentityReply(), False)
    assert pretence.asked == [Ask(ReadRegisters(9, 1, 2), RTU, 0.3, None, 9600, at_once=True)]


def test_a_second_block_of_values_can_be_asked(pretence: Pretence) -> None:
    pretence.sensor(3)
    block = load_profile("fuling-dzb", relative_to=Path()).reads()[1]
    pretence.carry_out(pretence.query().read_values(Endpoint(slave=4, baudrate=9600), block=block))
    assert pretence.requests == [ReadRegisters(4, 0x5000, 2)]


def test_a_rate_without_a_code_is_known_by_what_the_register_held(pretence: Pretence) -> None:
    query = pretence.query()
    for same in (query.knowing(4800, None), query.knowing(9600, 7), pretence.query(WITHOUT_RATE).knowing(4800, 7)):
        assert same.profile in (query.profile, WITHOUT_RATE)
    knowing = query.knowing(4800, 7)
    assert knowing.profile.baudrate is not None
    assert knowing.profile.baudrate.codes == {9600: 1, 19200: 2, 4800: 7}
    assert knowing.clock is query.clock
    assert pretence.carry_out(knowing.read_values(Endpoint(slave=3, baudrate=9600))).silent


def test_a_place_is_answered_twice_after_two_second_answers() -> None:
    pretence = Pretence()
    query, here = pretence.query(), Endpoint(slave=3, baudrate=9600)
    pretence.pending.duplicates.answered(3, 1.0)
    pretence.pending.duplicates.second(3, 1.5)
    assert not query.answered_twice(here)
    pretence.pending.duplicates.second(3, 1.7)
    assert query.answered_twice(here)


def test_where_a_second_answer_may_follow_nothing_is_asked_before_it_could_have_come(pretence: Pretence) -> None:
    pretence.sensor(3)
    query = pretence.query()
    pretence.carry_out(query.read_register(HERE))
    pretence.carry_out(query.read_register(HERE))
    assert pretence.clock.now == pytest.approx(2 * EXCHANGE), "no second answer is known yet"
    pretence.pending.duplicates.answered(3, 1.0, barrier=True)
    pretence.pending.duplicates.second(3, 1.04)
    pretence.clock.now = 2.0
    pretence.carry_out(query.read_register(HERE))
    pretence.carry_out(query.put(Ask(WriteRegister(3, 4, 1), RTU, QUICK)))
    assert pretence.clock.now == pytest.approx(2.0 + WATCHED + 2 * EXCHANGE)


def test_after_a_silence_no_second_answer_is_waited_for(pretence: Pretence) -> None:
    pretence.pending.duplicates.answered(3, 0.0, barrier=True)
    pretence.pending.duplicates.second(3, 0.04)
    query = pretence.query()
    pretence.clock.now = 1.0
    for _ in range(2):
        assert pretence.carry_out(query.put(Ask(WIND, RTU, QUICK))).answer is None
    assert pretence.clock.now == pytest.approx(1.0 + 2 * QUICK)
