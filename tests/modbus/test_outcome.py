"""What the end of an exchange says of what may still come."""

from __future__ import annotations

import pytest

from lfs10d.modbus.request import NOT_FINAL, ReadRegisters
from lfs10d.reading import Fault, FaultCode
from tests.support.outcomes import ended

ASKED = ReadRegisters(2, 0, 1)


def refused(code: int) -> Fault:
    return Fault(FaultCode.EXCEPTION, "refused", exception_code=code)


@pytest.mark.parametrize("code", range(1, 12))
def test_after_an_exception_that_is_not_final_the_answer_may_still_come(code: int) -> None:
    assert ended(ASKED, fault=refused(code)).may_follow is (code in {5, 10, 11}) is (code in NOT_FINAL)


def test_after_an_answer_or_silence_none_is_announced() -> None:
    assert not ended(ASKED, answer=(7,)).may_follow
    assert not ended(ASKED, fault=Fault(FaultCode.TIMEOUT, "no answer")).may_follow
