"""Polls that requests ask for, on a whole line in virtual time."""

from __future__ import annotations

from lfs10d.line.device import PollRules
from lfs10d.reading import FaultCode, Reading
from tests.support.lines import Rig, Rigs

DAILY = 86_400.0


def requested(rig: Rig, *numbers: int) -> list[Reading]:
    """Return the readings that answer these requests, each as often as it was told."""
    return [reading for number in numbers for reading in rig.readings if number in reading.requests]


def test_a_requested_poll_has_one_reading_with_its_number(rigs: Rigs) -> None:
    rig = rigs(3, interval=DAILY).run(1.0)
    rig.poller.read("slave-2", 17)
    rig.run(2.0).prove()
    (reading,) = requested(rig, 17)
    assert (reading.device, reading.fault, reading.probe) == ("slave-2", None, False)
    assert reading.at > 1.0


def test_a_requested_poll_goes_before_all_that_is_due(rigs: Rigs) -> None:
    rig = rigs(8, interval=0.0).run(1.0)
    rig.poller.read("slave-5", 1)
    rig.run(1.2).prove()
    (reading,) = requested(rig, 1)
    assert reading.at < 1.0 + 2.5 * 0.031, "the exchange under way and its own, of 31 ms each"


def test_each_of_several_requests_is_polled_for_itself(rigs: Rigs) -> None:
    rig = rigs(2, interval=DAILY).run(1.0)
    for number in (1, 2, 3):
        rig.poller.read("slave-1", number)
    rig.run(2.0).prove()
    assert [reading.requests for reading in requested(rig, 1, 2, 3)] == [(1,), (2,), (3,)]


def test_polls_of_the_grid_answer_no_request(rigs: Rigs) -> None:
    rig = rigs(4, interval=0.5).run(5.0)
    assert len(rig.readings) > 30
    assert all(reading.requests == () for reading in rig.readings)


def test_a_disabled_device_is_polled_for_a_request_and_then_no_more(rigs: Rigs) -> None:
    polled = [rigs.spec(1), rigs.spec(2, enabled=False)]
    rig = rigs(2, polled=polled).run(2.0)
    rig.poller.read("slave-2", 5)
    rig.run(6.0).prove()
    assert [reading.requests for reading in rig.of(2)] == [(5,)]


def test_an_unknown_device_is_not_polled(rigs: Rigs) -> None:
    rig = rigs(1, interval=DAILY).run(1.0)
    sent = rig.sent
    rig.poller.read("nobody", 1)
    rig.run(2.0)
    assert rig.sent == sent
    assert requested(rig, 1) == []


def test_a_silent_device_is_told_as_such_after_one_attempt_when_it_is_offline(rigs: Rigs) -> None:
    rig = rigs([1], polled=[rigs.spec(1), rigs.spec(9)], rules=PollRules(probe_interval_max=DAILY)).run(20.0)
    rig.poller.read("slave-9", 4)
    rig.run(25.0).prove()
    (reading,) = requested(rig, 4)
    assert reading.fault is not None
    assert (reading.fault.code, reading.online, reading.failed_attempts) == (FaultCode.TIMEOUT, False, ())


def test_when_the_port_is_lost_what_was_requested_has_its_reading_too(rigs: Rigs) -> None:
    polled = [rigs.spec(1), rigs.spec(2, enabled=False)]
    rig = rigs(2, polled=polled).run(1.0)
    for number, device in ((1, "slave-1"), (2, "slave-1"), (3, "slave-2")):
        rig.poller.read(device, number)
    rig.port.unplug()
    rig.run(1.5)
    lost = {reading.device: reading for reading in rig.readings if reading.requests}
    assert {name: sorted(reading.requests) for name, reading in lost.items()} == {"slave-1": [1, 2], "slave-2": [3]}
    assert all(reading.fault is not None for reading in lost.values())
    assert all(len(requested(rig, number)) == 1 for number in (1, 2, 3))


def test_while_the_port_is_lost_a_request_has_its_reading_at_once(rigs: Rigs) -> None:
    rig = rigs(1, interval=DAILY).run(1.0)
    rig.port.unplug()
    rig.run(2.0)
    rig.poller.read("slave-1", 8)
    rig.run(4.0)
    (reading,) = requested(rig, 8)
    assert reading.fault is not None
    assert reading.fault.code is FaultCode.PORT_LOST
