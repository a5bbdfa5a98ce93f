"""What a failed reading means, and what to check."""

from __future__ import annotations

import pytest

from lfs10d.cli.render.troubleshooting import Symptoms, checks, lines, meaning
from lfs10d.reading import PORT_CODES, FaultCode

OF_AN_EXCHANGE = [
    code
    for code in FaultCode
    if code
    not in PORT_CODES
    | {
        FaultCode.STARTING,
        FaultCode.DISABLED,
        FaultCode.OVERRUN,
        FaultCode.WRONG_RATE,
        FaultCode.CONFIG_CONFLICT,
        FaultCode.STORAGE_FULL,
        FaultCode.DUPLICATE_CLIENT,
        FaultCode.DUPLICATE_ID,
    }
]


@pytest.mark.parametrize("code", OF_AN_EXCHANGE)
def test_everything_that_can_happen_on_the_line_has_a_meaning_and_advice(code: FaultCode) -> None:
    assert meaning(Symptoms(code)) != meaning(Symptoms(FaultCode.PORT_LOST))
    assert list(checks(Symptoms(code)))


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
    assert list(lines("It is so.", tuple(checks(Symptoms(FaultCode.PORT_LOST))))) == ["It is so."]
