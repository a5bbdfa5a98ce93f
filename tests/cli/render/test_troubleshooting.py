"""What a failed reading means, and what to check."""

from __future__ import annotations

import pytest

from lfs10d.cli.render.troubleshooting import Symptoms, checks, lines, meaning
from lfs10d.reading import FaultCode


@pytest.mark.parametrize("code", FaultCode)
def test_everything_that_can_go_wrong_has_advice(code: FaultCode) -> None:
    assert meaning(Symptoms(code))
    assert all(checks(Symptoms(code)))
    assert list(checks(Symptoms(code)))


def test_each_code_has_a_meaning_of_its_own() -> None:
    assert len({meaning(Symptoms(code)) for code in FaultCode}) == len(FaultCode)


def test_framing_errors_speak_of_another_rate_or_swapped_wires() -> None:
    assert "1 byte it could not read" in meaning(Symptoms(FaultCode.TIMEOUT, framing_errors=1))
    assert "7 bytes it could not read: another baud rate" in meaning(Symptoms(FaultCode.TIMEOUT, framing_errors=7))


def test_an_echo_is_no_answer_but_a_good_sign() -> None:
    assert "the adapter echoes, which is harmless" in meaning(
        Symptoms(FaultCode.TIMEOUT, echoed=True, framing_errors=0)
    )


def test_advice_is_numbered() -> None:
    assert list(lines("It is so.", ("do this", "do that"))) == [
        "It is so.",
        "",
        "What to check:",
        "  1. do this",
        "  2. do that",
    ]


def test_where_there_is_no_advice_there_is_no_list() -> None:
    assert list(lines("It is so.", ())) == ["It is so."]
