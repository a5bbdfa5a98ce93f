"""`device/read`."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from lfs10d.inquiries import Inquiry
from lfs10d.reading import Fault, FaultCode

if TYPE_CHECKING:
    from tests.requests.conftest import Ask, FakePowers

GOOD = {"device": "mast-top", "wind_speed": 12.5, "error": None}
BAD = {"device": "mast-top", "wind_speed": None, "error": "timeout"}


def test_a_reading_is_answered_with_its_sample(ask: Ask, powers: FakePowers) -> None:
    powers.inquiry = Inquiry(GOOD, None)
    answer = ask("device/read", '{"device":"mast-top"}')
    assert (answer.status, answer.data, answer.error()) == ("ok", GOOD, None)
    assert powers.done == ["read mast-top"]


@pytest.mark.parametrize(
    ("fault", "code"),
    [
        (Fault(FaultCode.TIMEOUT, "no answer in 200 ms"), "timeout"),
        *((Fault(code, "something else"), "line_error") for code in FaultCode if code is not FaultCode.TIMEOUT),
    ],
)
def test_silence_is_a_timeout_and_everything_else_a_line_error(
    ask: Ask, powers: FakePowers, fault: Fault, code: str
) -> None:
    powers.inquiry = Inquiry(BAD, fault)
    answer = ask("device/read", '{"device":"mast-top"}')
    assert (answer.status, answer.data) == ("failed", BAD)
    assert answer.error() == {"code": code, "message": f"mast-top: {fault.message}", "param": None}


def test_an_exception_is_told_with_its_code(ask: Ask, powers: FakePowers) -> None:
    powers.inquiry = Inquiry(BAD, Fault(FaultCode.EXCEPTION, "refused", exception_code=2))
    error = ask("device/read", '{"device":"mast-top"}').error()
    assert error is not None
    assert (error["code"], error["exception_code"]) == ("line_error", 2)


def test_an_unknown_device_is_rejected_without_a_look_at_the_line(ask: Ask, powers: FakePowers) -> None:
    answer = ask("device/read", '{"device":"nobody"}')
    assert answer.status == "rejected"
    assert answer.error() == {
        "code": "unknown_device",
        "message": "there is no device nobody; configured are: mast-top, slave-3",
        "param": "device",
    }
    assert powers.done == []


@pytest.mark.parametrize("payload", ["{}", '{"device":3}', '{"device":null}', '{"device":"Mast Top"}', '{"slave":3}'])
def test_a_device_is_a_name_and_must_be_told(ask: Ask, payload: str) -> None:
    assert ask("device/read", payload).code == "invalid_param"


def test_a_device_that_went_before_it_was_asked_is_a_line_error(ask: Ask) -> None:
    answer = ask("device/read", '{"device":"slave-3"}')
    assert (answer.status, answer.code, answer.data) == ("failed", "line_error", None)
