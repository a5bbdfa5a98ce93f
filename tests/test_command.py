"""A request, and how it ended: in which words it is told, and by what a repeat is recognised."""

from __future__ import annotations

import pytest

from lfs10d.command import Command, Identifier, RefusedError, failed, ok, rejected


def test_what_was_carried_out_has_data_and_no_error() -> None:
    done = ok({"to": 3})
    assert (done.status, done.data, done.error()) == ("ok", {"to": 3}, None)
    assert ok().data is None


def test_a_rejection_names_code_words_parameter_and_further_facts() -> None:
    answer = rejected("invalid_param", "to: must be 1 to 247", param="to", given=0)
    assert (answer.status, answer.data) == ("rejected", None)
    assert answer.error() == {
        "code": "invalid_param",
        "message": "to: must be 1 to 247",
        "param": "to",
        "given": 0,
    }
    assert (rejected("busy", "a scan is under way").error() or {})["param"] is None


def test_a_failure_may_have_data_and_never_names_a_parameter() -> None:
    answer = failed("refused", "the device refuses", data={"written": False}, exception_code=2)
    assert (answer.status, answer.data) == ("failed", {"written": False})
    assert answer.error() == {
        "code": "refused",
        "message": "the device refuses",
        "param": None,
        "exception_code": 2,
    }


@pytest.mark.parametrize(
    ("id_", "transaction", "key"),
    [(None, None, None), ("a", None, "a"), (None, 7, 7), ("a", 7, "a"), (0, 7, 0), ("", 7, "")],
)
def test_a_repeat_is_told_by_its_id_else_by_the_transaction(
    id_: Identifier | None, transaction: Identifier | None, key: Identifier | None
) -> None:
    assert Command(id_, transaction).key == key


def test_a_refusal_on_the_way_carries_its_result_and_its_words() -> None:
    result = rejected("busy", "a scan is under way")
    error = RefusedError(result)
    assert error.result is result
    assert str(error) == "a scan is under way"
