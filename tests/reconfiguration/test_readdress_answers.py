"""What is answered when a sensor was given another place: a code of the contract, and what to do next."""

from __future__ import annotations

from pathlib import Path

import pytest

from lfs10d.profiles.library import load_profile
from lfs10d.reconfiguration.journal import Endpoint
from lfs10d.reconfiguration.procedures.readdress import NOTHING_WRITTEN, ReaddressEnding, ReaddressReport, ReaddressWish
from lfs10d.reconfiguration.readdress_answers import result

LFS10 = load_profile("lfs10", relative_to=Path())
LD_E = load_profile("ld-e", relative_to=Path())
WISH = ReaddressWish(Endpoint(slave=3, baudrate=9600), 9, (9600, 19200))
PLACES = {"device": "mast", "from": 3, "to": 9}


def test_a_sensor_that_moved_is_ok_and_the_answer_says_from_where_to_where() -> None:
    answer = result("mast", WISH, ReaddressReport(ReaddressEnding.MOVED, 9), LFS10)
    assert (answer.status, answer.data, answer.error()) == ("ok", PLACES, None)


def test_a_dry_run_is_ok_and_says_that_it_was_one() -> None:
    answer = result("mast", WISH, ReaddressReport(ReaddressEnding.FREE, 3), LFS10)
    assert (answer.status, answer.data) == ("ok", {**PLACES, "dry_run": True})


@pytest.mark.parametrize(
    ("ending", "code"),
    [
        (ReaddressEnding.TAKEN, "address_in_use"),
        (ReaddressEnding.ABSENT, "timeout"),
        (ReaddressEnding.DEAF, "line_error"),
        (ReaddressEnding.LOST_BEFORE, "line_error"),
        (ReaddressEnding.UNWRITTEN, "storage_full"),
        (ReaddressEnding.TWINS, "duplicate_id"),
        (ReaddressEnding.UNRECOGNISED, "not_recognised"),
        (ReaddressEnding.BOTH, "duplicate_id"),
        (ReaddressEnding.GARBAGE, "duplicate_id"),
        (ReaddressEnding.REFUSED, "refused"),
        (ReaddressEnding.LOCKED, "dip_switch"),
        (ReaddressEnding.PENDING, "power_cycle_needed"),
        (ReaddressEnding.NOWHERE, "not_verified"),
    ],
)
def test_each_ending_has_its_code_and_is_rejected_only_where_nothing_was_written(
    ending: ReaddressEnding, code: str
) -> None:
    answer = result("mast", WISH, ReaddressReport(ending, at=9600, why="the disk is full"), LFS10)
    assert answer.code == code
    written = ending not in NOTHING_WRITTEN
    assert (answer.status, answer.data) == (("failed", PLACES) if written else ("rejected", None))
    error = answer.error()
    assert error is not None
    message = str(error["message"])
    assert "{" not in message
    assert "None" not in message
    assert "exception_code" not in error


def test_every_ending_has_an_answer() -> None:
    assert all(result("mast", WISH, ReaddressReport(ending), LFS10).status for ending in ReaddressEnding)


def test_a_taken_id_is_the_fault_of_the_parameter_to_and_no_other_refusal_is() -> None:
    taken = result("mast", WISH, ReaddressReport(ReaddressEnding.TAKEN, at=19200), LFS10).error()
    assert taken is not None
    assert taken["param"] == "to"
    assert "slave id 9 is in use: something answers there at 19200 baud" in str(taken["message"])
    absent = result("mast", WISH, ReaddressReport(ReaddressEnding.ABSENT), LFS10).error()
    assert absent is not None
    assert absent.get("param") is None


@pytest.mark.parametrize("ending", [ReaddressEnding.ABSENT, ReaddressEnding.REFUSED])
def test_an_exception_is_told_by_its_code(ending: ReaddressEnding) -> None:
    error = result("mast", WISH, ReaddressReport(ending, exception=3), LFS10).error()
    assert error is not None
    assert error["exception_code"] == 3
    assert "(exception 03)" in str(error["message"])


@pytest.mark.parametrize("ending", [ReaddressEnding.LOCKED, ReaddressEnding.PENDING])
def test_switch_and_power_cycle_each_name_the_other(ending: ReaddressEnding) -> None:
    error = result("mast", WISH, ReaddressReport(ending), LFS10).error()
    assert error is not None
    assert "DIP switch" in str(error["message"])
    assert "power" in str(error["message"])


def test_where_the_profile_names_no_lock_it_is_an_address_switch() -> None:
    error = result("mast", WISH, ReaddressReport(ReaddressEnding.LOCKED), LD_E).error()
    assert error is not None
    assert "its address switch overrules the write" in str(error["message"])
