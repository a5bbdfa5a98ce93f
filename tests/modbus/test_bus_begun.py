"""The beginning of an answer only tells the bus when to come back: it is given to the exchange with the rest."""

from __future__ import annotations

import pytest

from lfs10d.modbus.bus import AWAKE_BEFORE, UNHURRIED_AFTER, LineRules, Wait
from lfs10d.modbus.outcome import Outcome
from lfs10d.reading import FaultCode
from tests.modbus.test_bus import ANSWER, READ, T9600, Rig

HUSH = T9600.t35 + 0.004
"""Silence that ends a begun answer behind the adapter of these tests, in s."""


def asked(*, hurried: bool = True) -> Rig:
    """Return a bus that has sent a request, behind an adapter without echo."""
    rig = Rig(LineRules(echo="off")).opened()
    rig.port.adapter_latency = 0.004
    rig.bus.ask(READ, {}, hurried=hurried)
    rig.step()
    rig.step(T9600.gap)
    assert rig.port.written
    return rig


@pytest.mark.parametrize(("hurried", "early"), [(True, AWAKE_BEFORE), (False, -UNHURRIED_AFTER)])
def test_it_comes_back_when_the_rest_can_be_there(hurried: bool, early: float) -> None:  # noqa: FBT001 - a case
    rig = asked(hurried=hurried)
    began = rig.clock.now + 0.02
    wait = rig.step(0.02, ANSWER[:3])
    assert isinstance(wait, Wait)
    assert (wait.listen, wait.hurried) == (True, hurried)
    assert wait.not_before == pytest.approx(began + 6 * T9600.character - early)
    assert wait.until == pytest.approx(began + HUSH)
    outcome = rig.step(0.007, ANSWER[3:])
    assert isinstance(outcome, Outcome)
    assert outcome.answer == (0x414F, 0xD70A)
    assert outcome.heard == ANSWER
    assert outcome.sent_end is not None
    assert outcome.turnaround == pytest.approx(began - outcome.sent_end)


def test_an_answer_that_breaks_off_is_given_up_as_ever() -> None:
    rig = asked()
    rig.step(0.02, ANSWER[:4])
    outcome = rig.step(HUSH)
    assert isinstance(outcome, Outcome)
    assert outcome.fault is not None
    assert (outcome.fault.code, outcome.heard) == (FaultCode.MALFORMED, ANSWER[:4])


def test_who_comes_back_too_soon_is_told_to_wait_on() -> None:
    rig = asked()
    rig.step(0.02, ANSWER[:4])
    assert isinstance(rig.step(0.001), Wait)
    assert isinstance(rig.step(0.001, ANSWER[4:7]), Wait)
    assert isinstance(rig.step(0.001, ANSWER[7:]), Outcome)


def test_the_beginning_is_forgotten_with_its_exchange() -> None:
    rig = asked()
    rig.step(0.02, ANSWER[:4])
    rig.bus.close()
    rig.opened()
    rig.port.written.clear()
    outcome = rig.carry_out(READ)
    assert (outcome.answer, outcome.heard) == ((0x414F, 0xD70A), ANSWER)
