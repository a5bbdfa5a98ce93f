"""What a device refuses because it is optional is left out in the same poll; slow values are kept with their age."""

from __future__ import annotations

from dataclasses import replace

import pytest

from lfs10d.line.device import Device, DeviceSpec, PollRules
from lfs10d.line.jobs.job import Done, Requeue
from lfs10d.line.jobs.poll import Poll
from lfs10d.modbus.ask import Ask
from lfs10d.modbus.frames import Codec, Framing
from lfs10d.modbus.pending import PendingRequests
from lfs10d.modbus.request import ReadRegisters
from lfs10d.profiles.library import parse_profile
from lfs10d.reading import Fault, FaultCode, Purpose
from tests.support.outcomes import ended

REFUSED = Fault(FaultCode.EXCEPTION, "exception 02", 2)
STATION = """
name: station
title: Wind, rain where it has a gauge, and now and then its battery
ids: [1, 247]
values:
  - {name: wind, register: 0, type: uint16, unit: "1", source: none}
  - {name: rain, register: 1, type: uint16, unit: "1", optional: true, source: none}
  - {name: battery, register: 8, type: uint16, unit: V, interval: 60s, source: none}
"""


@pytest.fixture
def device() -> Device:
    profile = parse_profile(STATION, "station.yaml")
    made = Device(DeviceSpec("mast", 1, profile, Codec(Framing.RTU), 1.0), PollRules(retries=0), 1)
    made.answered()
    return made


def read(poll: Poll, now: float, answer: tuple[int, ...] | None) -> tuple[tuple[int, int], Requeue | Done]:
    """Carry out the next read of a poll, which is refused where there is no answer; return what was read."""
    ask = poll.ask(now)
    assert isinstance(ask, Ask)
    assert isinstance(ask.request, ReadRegisters)
    fault = REFUSED if answer is None else None
    outcome = replace(ended(ask.request, answer=answer, fault=fault, answered=True), ended=now + 0.02)
    following = poll.on_outcome(outcome, now + 0.02)
    assert isinstance(following, Requeue | Done)
    return (ask.request.address, ask.request.count), following


def begun(device: Device, now: float) -> Poll:
    return Poll(device, PendingRequests(), due=now, purpose=Purpose.POLL)


def test_where_what_is_optional_is_refused_the_rest_is_read_in_the_same_poll(device: Device) -> None:
    poll = begun(device, 0.0)
    assert read(poll, 0.0, None) == ((0, 2), Requeue(0.0))
    assert read(poll, 0.1, (5,)) == ((0, 1), Requeue(0.0))
    assert read(poll, 0.2, None) == ((1, 1), Requeue(0.0))
    assert read(poll, 0.3, (12,)) == ((8, 1), Done())
    assert poll.good == {"wind": 5, "rain": None, "battery": 12}
    assert (poll.fault, poll.faults, poll.ages) == (None, {"rain": REFUSED}, {})


def test_a_slow_value_is_kept_with_its_age(device: Device) -> None:
    first = begun(device, 0.0)
    read(first, 0.0, (5, 6))
    read(first, 0.1, (12,))
    poll = begun(device, 10.0)
    assert read(poll, 10.0, (7, 8)) == ((0, 2), Done())
    assert poll.good == {"wind": 7, "rain": 8, "battery": 12}
    assert poll.ages == {"battery": pytest.approx(9.9)}


def test_a_refusal_of_what_is_not_optional_is_the_polls(device: Device) -> None:
    poll = begun(device, 0.0)
    read(poll, 0.0, (5, 6))
    assert read(poll, 0.1, None) == ((8, 1), Done())
    assert (poll.good, poll.fault) == (None, REFUSED)
