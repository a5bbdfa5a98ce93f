"""Another slave id: looked before, one write, and then only what is answered counts."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lfs10d.modbus.request import ReadRegisters, WriteRegister
from lfs10d.reconfiguration.journal import Endpoint
from lfs10d.reconfiguration.procedures.identity_query import PATIENT, QUICK, SILENCE, IdentityReply
from lfs10d.reconfiguration.procedures.readdress import (
    ECHO_READS,
    NOTHING_WRITTEN,
    QUICK_LOOK,
    TRIES,
    VERIFY,
    IdWrite,
    ReaddressEnding,
    ReaddressFinding,
    ReaddressReport,
    ReaddressWish,
    free,
    judge,
    read_both,
    readdress,
    undo_stored_id,
    verify,
    write,
)
from tests.support.sensors import LFS10, Pretence

OLD, NEW = Endpoint(slave=3, baudrate=9600), Endpoint(slave=9, baudrate=9600)
WISH = ReaddressWish(OLD, 9, (9600, 19200))


def carried_out(pretence: Pretence, wish: ReaddressWish = WISH, *, echo_known: bool = True) -> ReaddressReport:
    return pretence.carry_out(readdress(wish, pretence.query(), lambda: echo_known))


# -- the whole


def test_a_sensor_that_obeys_is_written_once_and_found_at_its_new_id(pretence: Pretence) -> None:
    pretence.sensor(3)
    assert carried_out(pretence) == ReaddressReport(ReaddressEnding.MOVED, 9)
    assert pretence.writes == [WriteRegister(3, 5, 9)]
    assert pretence.awaited == [IdWrite(OLD, NEW, 3)]


def test_a_sensor_that_knows_function_16_only_is_written_by_it(pretence: Pretence) -> None:
    pretence.sensor(3)
    profile = LFS10.model_copy(update={"write_function": 16})
    steps = readdress(WISH, pretence.query(profile), lambda: True)
    assert pretence.carry_out(steps) == ReaddressReport(ReaddressEnding.MOVED, 9)
    assert pretence.writes == [WriteRegister(3, 5, 9, 16)]


@pytest.mark.parametrize(
    ("manner", "expected"),
    [
        ("ignores", ReaddressReport(ReaddressEnding.LOCKED, 3)),
        ("stores", ReaddressReport(ReaddressEnding.PENDING, 9, stays_open=True)),
        ("refuses", ReaddressReport(ReaddressEnding.REFUSED, 3, exception=3)),
        ("refuses_and_stores", ReaddressReport(ReaddressEnding.REFUSED, 9, exception=3, stays_open=True)),
        ("refuses_and_obeys", ReaddressReport(ReaddressEnding.MOVED, 9, exception=3)),
        ("vanishes", ReaddressReport(ReaddressEnding.NOWHERE, stays_open=True)),
    ],
)
def test_however_a_sensor_takes_the_write_what_it_answers_then_is_the_verdict(
    pretence: Pretence, manner: str, expected: ReaddressReport
) -> None:
    pretence.sensor(3, manner=manner)
    assert carried_out(pretence) == expected
    assert len(pretence.writes) == 1


def test_of_two_sensors_at_one_id_one_that_moves_alone_is_a_duplicate(pretence: Pretence) -> None:
    pretence.sensor(3)
    pretence.sensor(3, manner="ignores")
    report = carried_out(pretence)
    assert report.ending is ReaddressEnding.BOTH


def test_the_one_of_two_that_stays_and_stored_the_new_id_gets_its_old_one_back(pretence: Pretence) -> None:
    pretence.sensor(3)
    pretence.sensor(3, manner="stores")
    assert carried_out(pretence) == ReaddressReport(ReaddressEnding.BOTH, 3)
    assert pretence.writes == [WriteRegister(3, 5, 9), WriteRegister(3, 5, 3)]


def test_one_that_keeps_the_new_id_stored_leaves_the_change_open(pretence: Pretence) -> None:
    stays = pretence.sensor(3, manner="ignores")
    stays.stored[5] = 9
    before = ReaddressReport(ReaddressEnding.BOTH, 9, stays_open=True)
    assert pretence.carry_out(undo_stored_id(before, OLD, 9, pretence.query())) == before


@pytest.mark.parametrize("dry_run", [False, True])
def test_two_sensors_of_one_id_are_not_written_to(pretence: Pretence, *, dry_run: bool) -> None:
    pretence.sensor(3)
    pretence.sensor(3, wind=(0, 0))
    wish = ReaddressWish(OLD, 9, (9600, 19200), dry_run)
    assert carried_out(pretence, wish) == ReaddressReport(ReaddressEnding.TWINS, why="answers collide there")
    assert pretence.writes == pretence.awaited == []


def test_two_whose_ids_collide_already_are_two(pretence: Pretence) -> None:
    pretence.noise.add((3, 9600))
    assert carried_out(pretence) == ReaddressReport(ReaddressEnding.TWINS, why="answers collide there")


def test_one_that_gives_its_id_and_no_value_is_not_written_to(pretence: Pretence) -> None:
    sensor = pretence.sensor(3)
    pretence.later.append((0.01, lambda: setattr(sensor, "exception", 4)))
    assert carried_out(pretence) == ReaddressReport(ReaddressEnding.ABSENT, exception=4)
    assert pretence.writes == []


def test_a_dry_run_looks_and_writes_nothing(pretence: Pretence) -> None:
    pretence.sensor(3)
    assert carried_out(pretence, ReaddressWish(OLD, 9, (9600, 19200), dry_run=True)) == ReaddressReport(
        ReaddressEnding.FREE, 3
    )
    assert pretence.writes == pretence.awaited == []


def test_nothing_is_written_where_the_intent_cannot_be_kept(pretence: Pretence) -> None:
    pretence.sensor(3)
    pretence.answer = "the disk is full"
    assert carried_out(pretence) == ReaddressReport(ReaddressEnding.UNWRITTEN, why="the disk is full")
    assert pretence.writes == []


def test_a_port_lost_before_the_write_is_told_as_that(pretence: Pretence) -> None:
    pretence.sensor(3)
    pretence.lost_at = 2
    assert carried_out(pretence) == ReaddressReport(ReaddressEnding.LOST_BEFORE)
    assert pretence.writes == []


def test_a_port_lost_after_the_write_leaves_the_change_open(pretence: Pretence) -> None:
    pretence.sensor(3)
    carried_out(pretence, ReaddressWish(OLD, 9, (9600, 19200), dry_run=True))
    looks = len(pretence.asked)
    pretence.asked.clear()
    pretence.lost_at = looks + 1
    assert carried_out(pretence) == ReaddressReport(ReaddressEnding.NOWHERE, stays_open=True)
    assert len(pretence.writes) == 1


# -- before


def test_a_sensor_that_does_not_answer_is_not_written_to(pretence: Pretence) -> None:
    report = carried_out(pretence)
    assert report == ReaddressReport(ReaddressEnding.ABSENT)
    assert report.ending in NOTHING_WRITTEN
    assert pretence.writes == []


def test_nor_is_one_that_refuses_to_say_its_id(pretence: Pretence) -> None:
    pretence.sensor(3, exception=2)
    assert carried_out(pretence) == ReaddressReport(ReaddressEnding.ABSENT, exception=2)


@pytest.mark.parametrize("rate", [9600, 19200])
def test_an_id_at_which_somebody_answers_at_any_rate_is_taken(pretence: Pretence, rate: int) -> None:
    pretence.sensor(3)
    pretence.sensor(9, baudrate=rate)
    assert carried_out(pretence) == ReaddressReport(ReaddressEnding.TAKEN, at=rate)


def test_one_byte_at_the_new_id_is_enough_to_call_it_taken(pretence: Pretence) -> None:
    pretence.sensor(3)
    pretence.noise.add((9, 19200))
    assert carried_out(pretence) == ReaddressReport(ReaddressEnding.TAKEN, at=19200)


def test_without_knowing_how_the_adapter_echoes_nothing_is_written(pretence: Pretence) -> None:
    pretence.sensor(3)
    assert carried_out(pretence, echo_known=False) == ReaddressReport(ReaddressEnding.DEAF)
    assert pretence.requests.count(ReadRegisters(3, 5, 1)) == 1 + ECHO_READS


def test_reads_that_teach_the_echo_are_enough(pretence: Pretence) -> None:
    pretence.sensor(3)
    steps = readdress(WISH, pretence.query(), lambda: len(pretence.asked) >= 10)
    assert pretence.carry_out(steps).ending is ReaddressEnding.MOVED


def test_a_sensor_that_is_gone_after_the_look_at_the_new_id_is_not_written_to(pretence: Pretence) -> None:
    sensor = pretence.sensor(3)
    pretence.later.append((1.0, lambda: setattr(sensor, "silent", True)))
    assert carried_out(pretence) == ReaddressReport(ReaddressEnding.ABSENT)
    assert pretence.writes == []


# -- the pieces


def test_free_asks_for_values_three_times(pretence: Pretence) -> None:
    assert pretence.carry_out(free(NEW, pretence.query()))
    assert [ask.timeout for ask in pretence.asked] == [0.2, 0.2, 0.6]
    assert set(pretence.requests) == {ReadRegisters(9, 1, 2)}


@pytest.mark.parametrize("rate", [9600, 19200])
def test_a_write_goes_out_at_the_rate_of_its_place(pretence: Pretence, rate: int) -> None:
    pretence.sensor(3, baudrate=rate)
    assert pretence.carry_out(write(Endpoint(slave=3, baudrate=rate), 5, 9, pretence.query())) is None
    (ask,) = pretence.asked
    assert (ask.request, ask.baudrate, ask.timeout) == (WriteRegister(3, 5, 9), rate, 1.0)


def test_both_places_are_asked_for_five_seconds(pretence: Pretence) -> None:
    pretence.sensor(3)
    found = pretence.carry_out(verify(OLD, NEW, pretence.query()))
    assert found == ReaddressFinding(SILENCE, IdentityReply(answers=True, register=3))
    assert VERIFY <= pretence.clock.now < VERIFY + 3.0


def test_after_a_write_the_new_id_is_waited_for_long_in_the_end(pretence: Pretence) -> None:
    pretence.sensor(3)
    pretence.carry_out(verify(OLD, NEW, pretence.query()))
    assert max(ask.timeout for ask in pretence.asked if ask.request.slave == NEW.slave) == PATIENT
    pretence.asked.clear()
    pretence.carry_out(verify(OLD, NEW, pretence.query(), QUICK_LOOK))
    assert {ask.timeout for ask in pretence.asked} == {QUICK}


def test_a_sensor_that_takes_its_time_is_found_within_them(pretence: Pretence) -> None:
    pretence.later.append((4.0, lambda: pretence.sensor(9)))
    assert pretence.carry_out(verify(OLD, NEW, pretence.query())).new == IdentityReply(answers=True, register=9)
    assert pretence.clock.now < VERIFY + 3.0


def test_two_with_one_id_are_told_by_their_winds(pretence: Pretence) -> None:
    pretence.sensor(9)
    pretence.sensor(9, wind=(0, 0))
    found = pretence.carry_out(read_both(OLD, NEW, pretence.query()))
    assert found.spoilt
    assert found.new.answers
    assert pretence.requests.count(ReadRegisters(9, 1, 2)) == TRIES


def test_garbage_thrice_is_spoilt(pretence: Pretence) -> None:
    pretence.noise.add((9, 9600))
    assert pretence.carry_out(read_both(OLD, NEW, pretence.query())) == ReaddressFinding(
        IdentityReply(noise=True), SILENCE, spoilt=True
    )


# -- the table

YES, NO = IdentityReply(answers=True, register=9), SILENCE
STAYED, STORED = IdentityReply(answers=True, register=3), IdentityReply(answers=True, register=9)


@pytest.mark.parametrize(
    ("found", "exception", "ending", "stays_open"),
    [
        (ReaddressFinding(YES, NO), None, ReaddressEnding.MOVED, False),
        (ReaddressFinding(YES, STAYED), None, ReaddressEnding.BOTH, False),
        (ReaddressFinding(YES, STORED), None, ReaddressEnding.BOTH, True),
        (ReaddressFinding(IdentityReply(noise=True), NO, spoilt=True), None, ReaddressEnding.GARBAGE, True),
        (ReaddressFinding(IdentityReply(noise=True), STAYED, spoilt=True), None, ReaddressEnding.BOTH, False),
        (ReaddressFinding(NO, STAYED), 3, ReaddressEnding.REFUSED, False),
        (ReaddressFinding(NO, STORED), 3, ReaddressEnding.REFUSED, True),
        (ReaddressFinding(NO, STAYED), None, ReaddressEnding.LOCKED, False),
        (ReaddressFinding(NO, STORED), None, ReaddressEnding.PENDING, True),
        (ReaddressFinding(NO, NO), None, ReaddressEnding.NOWHERE, True),
        (ReaddressFinding(NO, IdentityReply(noise=True)), 3, ReaddressEnding.NOWHERE, True),
    ],
)
def test_the_table_of_verdicts(
    found: ReaddressFinding,
    exception: int | None,
    ending: ReaddressEnding,
    stays_open: bool,  # noqa: FBT001  # a case
) -> None:
    report = judge(found, 3, exception, 9)
    assert (report.ending, report.exception, report.stays_open) == (ending, exception, stays_open)


def test_a_register_that_said_the_new_id_before_shows_no_write(pretence: Pretence) -> None:
    del pretence
    report = judge(ReaddressFinding(NO, STORED), 9, None, 9)
    assert (report.ending, report.stays_open) == (ReaddressEnding.LOCKED, True)


REPLIES = st.builds(
    IdentityReply, st.booleans(), st.booleans(), st.none() | st.integers(1, 9), st.none() | st.integers(1, 6)
)  # fmt: skip


@given(REPLIES, REPLIES, st.booleans(), st.none() | st.integers(1, 9), st.none() | st.integers(1, 6))
def test_it_is_moved_only_where_the_new_id_answers_and_the_old_is_silent(
    new: IdentityReply, old: IdentityReply, spoilt: bool, before: int | None, exception: int | None  # noqa: FBT001  # drawn
) -> None:  # fmt: skip
    report = judge(ReaddressFinding(new, old, spoilt), before, exception, 9)
    assert report.ending not in NOTHING_WRITTEN
    assert (report.ending is ReaddressEnding.MOVED) == (new.answers and not old.answers and not spoilt)
    assert report.stays_open or report.ending not in (
        ReaddressEnding.NOWHERE,
        ReaddressEnding.GARBAGE,
        ReaddressEnding.PENDING,
    )
