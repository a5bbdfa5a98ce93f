"""What a code means and what to do, for a person who has never seen the code."""

from __future__ import annotations

from typing import get_args

import pytest

from lfs10d.command import ErrorCode
from lfs10d.reading import FaultCode
from lfs10d.web.words import MEANINGS, answer, explained, meaning, remedy

CAUGHT_BY_THE_PAGE = {
    "invalid_json", "unknown_request", "retained", "duplicate_conflict", "too_large",
}  # fmt: skip
"""Codes that no button of the page can cause."""


def test_every_code_of_a_device_or_a_line_has_a_meaning_and_a_remedy() -> None:
    for code in FaultCode:
        assert meaning(code.value) != code.value, code
        assert remedy(code.value), code


def test_every_code_of_a_response_that_the_page_can_cause_has_both() -> None:
    assert set(get_args(ErrorCode)) - MEANINGS.keys() == CAUGHT_BY_THE_PAGE


def test_an_unknown_code_is_shown_as_it_is() -> None:
    assert (meaning("new_code"), remedy("new_code"), meaning(None), remedy(["x"])) == ("new_code", "", "None", "")


def test_an_active_error_is_explained_and_no_error_is_none() -> None:
    error = {"v": 1, "active": True, "code": "timeout", "message": "no answer in 200 ms", "since": 5, "count": 3}
    shown = explained(error)
    assert shown is not None
    assert (shown["meaning"], shown["since"], shown["count"]) == ("does not answer", 5, 3)
    assert "power" in shown["remedy"]
    assert explained(None) is None
    assert explained({"active": False, "code": None}) is None


@pytest.mark.parametrize(
    ("response", "words"),
    [
        ({"status": "ok", "error": None}, "Done."),
        (
            {"status": "rejected", "error": {"code": "busy", "message": "a scan is under way"}},
            (
                "Nothing was changed: another job is under way. A scan is under way. "
                "Wait for its end, or cancel the scan; then try again."
            ),
        ),
        (
            {"status": "rejected", "error": {"code": "line_error", "message": "the port is freed for another program"}},
            (
                "Nothing was changed: the line failed. The port is freed for another program. "
                "Look at the errors of the line and the sensor, then try again."
            ),
        ),
        ({"status": "failed", "error": {"code": "new", "message": ""}}, "It failed: new."),
        ({"status": "failed", "error": "nonsense"}, "It failed: None."),
    ],
)
def test_a_response_in_words(response: dict[str, object], words: str) -> None:
    assert answer(response) == words
