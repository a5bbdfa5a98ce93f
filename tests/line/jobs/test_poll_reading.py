"""One poll, one reading, and the missed points of the grid are told once."""

from __future__ import annotations

from pathlib import Path

import pytest

from lfs10d.line.device import Device, DeviceSpec, PollRules
from lfs10d.line.jobs.poll import Poll, lost_reading
from lfs10d.modbus.frames import Codec, Framing
from lfs10d.modbus.pending import PendingRequests
from lfs10d.profiles.library import load_profile
from lfs10d.reading import Fault, FaultCode, Purpose

GONE = Fault(FaultCode.PORT_LOST, "gone")


@pytest.fixture
def device() -> Device:
    profile = load_profile("lfs10", relative_to=Path())
    spec = DeviceSpec("mast", 1, profile, Codec(Framing.RTU), 1.0, response_timeout=0.3)
    return Device(spec, PollRules(), 1, overruns=2)


def a_poll(device: Device, purpose: Purpose, request: int | None = None) -> Poll:
    return Poll(device, PendingRequests(), due=0.0, purpose=purpose, request=request)


def test_a_good_poll(device: Device) -> None:
    device.answered()
    poll = a_poll(device, Purpose.REQUEST, 7)
    poll.values, poll.rtt, poll.at = {"wind_speed": 12.99}, 0.02, 5.0
    poll.failed_attempts.append(FaultCode.CRC)
    reading = poll.reading()
    assert (reading.device, reading.at, reading.values, reading.rtt) == ("mast", 5.0, {"wind_speed": 12.99}, 0.02)
    assert (reading.fault, reading.online, reading.probe, reading.requests) == (None, True, False, (7,))
    assert (reading.failed_attempts, reading.overruns, reading.response_timeout) == ((FaultCode.CRC,), 2, 0.3)
    assert poll.reading().overruns == 0


def test_a_failed_probe(device: Device) -> None:
    poll = a_poll(device, Purpose.PROBE)
    poll.fault = Fault(FaultCode.TIMEOUT, "no answer")
    reading = poll.reading()
    assert (reading.values, reading.fault, reading.probe, reading.requests) == (None, poll.fault, True, ())


def test_the_loss_of_the_port_answers_the_requests_for_this_device(device: Device) -> None:
    other = Device(device.spec, PollRules(), 2)
    polls = [a_poll(device, Purpose.REQUEST, 7), a_poll(other, Purpose.REQUEST, 8), a_poll(device, Purpose.POLL)]
    reading = lost_reading(device, GONE, 9.0, polls)
    assert (reading.at, reading.values, reading.fault, reading.requests) == (9.0, None, GONE, (7,))
