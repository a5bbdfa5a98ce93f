"""The plain beginning of an answer is foreseen: it may be sorted with the rest."""

from __future__ import annotations

import pytest

from lfs10d.modbus.echo import Echo
from lfs10d.modbus.reception import Reception
from tests.support.receptions import ANSWER, ASCII, REFUSED, REQUEST, TIMING, WHO, reception


def test_it_is_foreseen_when_all_of_it_can_be_there() -> None:
    ear = reception()
    assert ear.foreseen(ANSWER[:2], 0.05)
    assert ear.whole_at == pytest.approx(0.05 + 7 * TIMING.character)
    assert (bytes(ear.heard), ear.rest) == (b"", 0)


def test_what_was_foreseen_is_sorted_with_the_rest_and_keeps_its_time() -> None:
    ear = reception()
    assert ear.foreseen(ANSWER[:2], 0.05)
    ear.take(ANSWER[2:8], 0.056, (ANSWER[:2], 0.05))
    assert ear.whole_at == pytest.approx(min(0.05 + 7 * TIMING.character, 0.056 + TIMING.character))
    ear.take(ANSWER[8:], 0.058)
    assert ear.answer is not None
    assert (ear.answer.first_at, ear.answer.last_at) == (0.05, 0.058)
    assert ear.heard == ANSWER


@pytest.mark.parametrize("data", [b"\xff", REFUSED[:2], REQUEST[:4], ANSWER])
def test_what_is_no_beginning_is_not_foreseen(data: bytes) -> None:
    assert not reception().foreseen(data, 0.05)


@pytest.mark.parametrize(
    "ear",
    [
        pytest.param(reception(sent=False), id="nothing is asked yet"),
        pytest.param(reception(echo=Echo.UNKNOWN), id="it may be an echo"),
        pytest.param(reception(earlier=(WHO,)), id="it may be an earlier answer"),
        pytest.param(reception(codec=ASCII), id="a new colon begins anew"),
    ],
)
def test_where_something_else_may_come_nothing_is_foreseen(ear: Reception) -> None:
    assert not ear.foreseen(ANSWER[:1], 0.05)


def test_what_comes_too_early_is_not_foreseen() -> None:
    assert not reception().foreseen(ANSWER[:1], 0.001)
    ear = reception()
    ear.take(b"\xff", 0.02)
    assert not ear.foreseen(ANSWER[:1], 0.05)


def test_what_follows_faster_than_the_wire_leaves_a_beginning_what_it_is() -> None:
    ear = reception()
    assert ear.foreseen(ANSWER[:3], 0.012)
    ear.take(bytes(40), 0.0121, (ANSWER[:3], 0.012))
    assert ear.begun
