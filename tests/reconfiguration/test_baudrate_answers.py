"""What is answered when a line was given another rate: a code of the contract, where each sensor is, and what to do."""

from __future__ import annotations

import pytest

from lfs10d.reconfiguration.baudrate_answers import result
from lfs10d.reconfiguration.procedures.baudrate import UNTOUCHED, BaudrateEnding, BaudrateReport

WHERE = {"s3": 9600, "s4": None}


@pytest.mark.parametrize("names", [(), ("s3",)])
def test_what_was_moved_is_ok_and_names_those_that_wait_for_power(names: tuple[str, ...]) -> None:
    ended = BaudrateEnding.PENDING if names else BaudrateEnding.MOVED
    answer = result(9600, 19200, BaudrateReport(ended, names=names))
    assert (answer.status, answer.data) == ("ok", {"from": 9600, "to": 19200, "pending": list(names)})
    assert answer.error() is None


def test_a_dry_run_is_ok_and_says_that_it_was_one() -> None:
    answer = result(9600, 19200, BaudrateReport(BaudrateEnding.FREE), dry_run=True)
    assert (answer.status, answer.data) == ("ok", {"from": 9600, "to": 19200, "dry_run": True})


@pytest.mark.parametrize(
    ("ended", "code"),
    [
        (BaudrateEnding.ABSENT, "timeout"),
        (BaudrateEnding.DEAF, "line_error"),
        (BaudrateEnding.LOST_BEFORE, "line_error"),
        (BaudrateEnding.UNWRITTEN, "storage_full"),
        (BaudrateEnding.REFUSED, "refused"),
        (BaudrateEnding.CANARY, "power_cycle_needed"),
        (BaudrateEnding.TWINS, "duplicate_id"),
        (BaudrateEnding.ROLLED_BACK, "rolled_back"),
        (BaudrateEnding.UNVERIFIED, "not_verified"),
    ],
)
def test_each_ending_has_its_code_and_is_rejected_only_where_nothing_was_written(
    ended: BaudrateEnding, code: str
) -> None:
    answer = result(9600, 19200, BaudrateReport(ended, WHERE, ("s3", "s4"), why="the disk is full"))
    error = answer.error()
    assert error is not None
    assert error["code"] == code
    assert not {"{", "}"} & set(str(error["message"]))
    if ended in UNTOUCHED:
        assert (answer.status, answer.data) == ("rejected", None)
    else:
        assert (answer.status, answer.data) == ("failed", {"where": WHERE})


def test_the_message_names_the_sensors_and_the_rates_they_are_asked_at() -> None:
    error = result(9600, 19200, BaudrateReport(BaudrateEnding.UNVERIFIED, WHERE, ("s4",))).error()
    assert error is not None
    assert error["message"] == (
        "s4 no longer answers; it was last seen at 9600 baud, and is queried at 9600 and 19200 until it is found"
    )


def test_a_refusal_has_the_code_of_the_exception() -> None:
    error = result(9600, 19200, BaudrateReport(BaudrateEnding.REFUSED, WHERE, ("s3",), exception=4)).error()
    assert error is not None
    assert error["exception_code"] == 4
    assert error["message"] == "s3 refused the write (exception 04); everything is as it was, at 9600 baud"
