"""Which events wait for others to go with them to the asyncio loop, and how long at most."""

from __future__ import annotations

from dataclasses import replace
from math import inf

import pytest

from lfs10d.line.hand_over import HandOver
from lfs10d.reading import Event, Exchanged, Fault, FaultCode, PortChanged, Purpose, Reading, UartCounted, UartCounters

GOOD = Reading("north", 10.0, {"wind_speed": 3.0}, None, 0.006, online=True, response_timeout=0.05)
DONE = Exchanged(
    at=10.0, asked=9.994, began=9.995, gap=0.002, slave=2, purpose=Purpose.POLL, fault=None, sent=b"", heard=b"",
    unsolicited=0, late=0,
)  # fmt: skip
TIMEOUT = Fault(FaultCode.TIMEOUT, "no answer")


def held(hold: float, took: float = 0.006) -> HandOver:
    """Return one whose exchanges took so many s."""
    made = HandOver()
    made.hold = hold
    made.on_exchange(took)
    return made


def test_without_a_hold_everything_goes_at_once() -> None:
    assert held(0.0).due([GOOD, DONE], 10.0, 0.0) == 10.0


def test_while_somebody_watches_the_frames_nothing_is_held() -> None:
    some = held(0.02)
    some.at_once_until = 11.0
    assert some.due([DONE, GOOD], 10.0, 10.0) == 10.0
    assert some.due([DONE, GOOD], 11.0, 11.0) == 11.02


def test_a_good_sample_waits_for_the_next_ones_no_longer_than_the_hold() -> None:
    some = held(0.02)
    assert some.due([DONE, GOOD], 10.0, 10.0) == 10.02
    assert some.due([DONE, GOOD, DONE, GOOD], 10.006, 10.006) == 10.02
    assert some.due([DONE, GOOD] * 3, 10.012, 10.012) == 10.02, "the fourth would be there at 10.018"
    assert some.due([DONE, GOOD] * 3, 10.016, 10.012) == 10.02, "a turn in the middle of an exchange"
    assert some.due([DONE, GOOD] * 4, 10.018, 10.018) == 10.018, "none more comes in time"
    some.handed_over()
    assert some.due([DONE, GOOD], 10.024, 10.024) == pytest.approx(10.044)


def test_it_does_not_wait_where_no_other_can_come_in_that_time() -> None:
    assert held(0.02, took=0.025).due([DONE, GOOD], 10.0, 10.0) == 10.0, "9600 baud"
    assert held(0.02).due([DONE, GOOD], 10.0, 10.5) == 10.0, "nobody is due for half a second"
    assert held(0.02).due([DONE, GOOD], 10.0, inf) == 10.0
    fresh = HandOver()
    fresh.hold = 0.02
    assert fresh.due([DONE, GOOD], 10.0, 10.0) == 10.0, "how soon another comes is not known yet"


def test_the_quickest_of_the_last_exchanges_tells_how_soon_another_can_be_there() -> None:
    some = held(0.02, took=0.006)
    some.on_exchange(0.5)
    assert some.due([GOOD], 10.0, 10.0) == 10.02
    for _ in range(8):
        some.on_exchange(0.5)
    some.handed_over()
    assert some.due([GOOD], 10.0, 10.0) == 10.0


@pytest.mark.parametrize(
    "event",
    [
        replace(GOOD, values=None, fault=TIMEOUT),
        replace(GOOD, requests=(4,)),
        replace(GOOD, probe=True),
        replace(DONE, fault=FaultCode.TIMEOUT),
        replace(DONE, purpose=Purpose.REQUEST),
        replace(DONE, purpose=Purpose.SCAN),
        PortChanged(10.0, TIMEOUT),
    ],
)
def test_what_somebody_waits_for_and_what_is_bad_goes_at_once_with_all_before_it(event: Event) -> None:
    some = held(0.02)
    assert some.due([DONE, GOOD], 10.0, 10.0) == 10.02
    assert some.due([DONE, GOOD, event], 10.006, 10.006) == 10.006
    assert some.due([DONE, GOOD, event, GOOD], 10.007, 10.007) == 10.007, "still"
    some.handed_over()
    assert some.due([GOOD], 10.01, 10.01) == pytest.approx(10.03)


def test_counters_can_wait() -> None:
    assert held(0.02).due([UartCounted(10.0, UartCounters(0, 0, 0, 0))], 10.0, 10.0) == 10.02
