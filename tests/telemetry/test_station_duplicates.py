"""An id that is answered for twice, as the broker is told of it."""

from __future__ import annotations

from lfs10d.reading import AnsweredTwice, Fault, FaultCode, PortChanged
from tests.support.stations import LOST, fields, instant, shown, station, topics

TWICE = AnsweredTwice(1.0, "a", 3, Fault(FaultCode.DUPLICATE_ID, "slave 3 is answered for twice"))


def test_it_is_an_event_and_the_error_of_its_device_alone() -> None:
    running = station()
    running.on_event(PortChanged(0.5, None), instant(0.5))
    assert topics(running.on_event(TWICE, instant(1.0))) == ["device/a/error", "event"]
    assert fields(shown(running, "device/a/error"), "active", "code") == (True, "duplicate_id")
    assert fields(shown(running, "device/b/error"), "active") == (False,)
    over = AnsweredTwice(2.0, "a", 3, None)
    assert topics(running.on_event(over, instant(2.0))) == ["device/a/error"]


def test_it_says_nothing_while_the_port_is_lost_or_of_a_device_that_is_gone() -> None:
    running = station()
    running.on_event(PortChanged(0.5, LOST), instant(0.5))
    assert running.on_event(TWICE, instant(1.0)) == []
    running.on_event(PortChanged(1.5, None), instant(1.5))
    assert running.on_event(AnsweredTwice(2.0, "gone", 9, TWICE.fault), instant(2.0)) == []
