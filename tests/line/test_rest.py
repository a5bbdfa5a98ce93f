"""Sensors that need rest between two requests, alone and among others; sensors that sleep. Nobody is stranded."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import pytest

from lfs10d.line.device import DeviceSpec, PollRules
from lfs10d.line.jobs.access_end import End
from lfs10d.line.jobs.register_access import Access, Target
from lfs10d.modbus.frames import Codec, Framing
from lfs10d.modbus.request import ReadRegisters, Request, WriteRegister
from lfs10d.reading import FaultCode
from lfs10d.simulator.burst import MASTER
from tests.support.faulty_sensors import add_fault
from tests.support.lines import LFS10, Rig, Rigs, a_spec

HEALTHY = (2, 3, 4)


def a_line(rigs: Rigs, rest: float, *, alone: bool, gap: float = 0.0) -> Rig:
    """Return a line whose sensor 1 needs `rest` s, and is given `gap` by the configuration; the others are well."""
    slaves = (1,) if alone else (1, *HEALTHY)
    polled = [replace(a_spec(slave), request_gap=gap if slave == 1 else 0.0) for slave in slaves]
    rig = rigs(slaves, polled=polled)
    add_fault(rig.line.sensor(1), "needs_rest", delay=rest)
    return rig


def lose_answers(rig: Rig) -> Rig:
    """Let sensor 1 be silent for a second, three times."""
    for first in (5.5, 40.5, 80.5):
        add_fault(rig.line.sensor(1), "silent", first=first, last=first + 1.0)
    return rig


@pytest.mark.parametrize("alone", [True, False])
@pytest.mark.parametrize("rest", [0.05, 0.1, 0.25, 0.5])
def test_one_that_needs_rest_is_never_stranded_by_lost_answers(rigs: Rigs, rest: float, *, alone: bool) -> None:
    rig = lose_answers(a_line(rigs, rest, alone=alone)).run(120.0).prove()
    for since in (0.0, 15.0, 50.0, 90.0):
        assert rig.of(1, since=since)[0].fault is None, since
    assert len(rig.good(1, since=90.0)) >= 27
    assert {reading.fault.code for reading in rig.of(1) if reading.fault} == {FaultCode.TIMEOUT}
    assert len(rig.of(1)) - len(rig.good(1)) <= 6
    assert 0 < rig.of(1)[-1].request_gap <= max(0.1, 2 * rest)
    assert rig.of(1)[-1].gap_learned
    for slave in () if alone else HEALTHY:
        assert len(rig.good(slave)) == 120
        assert {reading.request_gap for reading in rig.of(slave)} == {0.0}


@pytest.mark.parametrize("rest", [0.05, 0.5])
def test_one_whose_rest_is_configured_never_hears_a_request_too_early(rigs: Rigs, rest: float) -> None:
    rig = lose_answers(a_line(rigs, rest, alone=False, gap=rest)).run(120.0).prove()
    assert least_rest(rig, 1) >= rest
    assert not any(reading.gap_learned for reading in rig.of(1))
    assert len(rig.of(1)) - len(rig.good(1)) <= 3
    assert all(len(rig.good(slave)) == 120 for slave in HEALTHY)


def least_rest(rig: Rig, slave: int) -> float:
    """Return the shortest time in s from the end of an exchange with a slave to its next request, by the line's log."""
    requests = [request for request in rig.line.log if request.speaker is MASTER and request.body[0] == slave]
    ends = (
        max((request.ended, *(answer.burst.ends[-1] for answer in request.answers))) for request in requests[:-1]
    )  # fmt: skip
    return min(later.begun - end for later, end in zip(requests[1:], ends, strict=True)) / 1e9


def access(rig: Rig, what: Request, spec: DeviceSpec) -> list[End | None]:
    ends: list[End | None] = []
    target = Target(1, Codec(Framing.RTU), spec.profile)
    pending = rig.poller.scheduler.pending
    rig.poller.submit(
        Access(target, what, pending=pending, echo_known=lambda: True, over=lambda job: ends.append(job.end))
    )
    return ends


def test_requests_of_every_kind_keep_the_rest_and_others_are_polled_meanwhile(rigs: Rigs) -> None:
    rig = a_line(rigs, 0.3, alone=False, gap=0.3)
    spec = rig.poller.scheduler.devices["slave-1"].spec
    rig.run(5.02)
    ends = access(rig, ReadRegisters(1, 0x0005, 1), spec)
    rig.poller.read("slave-1", 7)
    ends += access(rig, ReadRegisters(1, 0x0001, 2), spec)
    written = access(rig, WriteRegister(1, 0x0004, 1), spec)
    rig.run(9.0)
    add_fault(rig.line.sensor(1), "silent", first=9.0, last=14.0)
    rig.run(40.0).prove()
    assert [str(end) for end in (*ends, *written)] == ["done"] * (len(ends) + len(written))
    assert len(written) == 1
    assert least_rest(rig, 1) >= 0.3
    assert [reading.fault for reading in rig.readings if reading.requests == (7,)] == [None]
    assert all(len(rig.good(slave)) == 40 for slave in HEALTHY)


def test_each_read_of_a_poll_has_its_rest_and_devices_flat_out_lose_nothing_by_it(rigs: Rigs) -> None:
    rested = replace(a_spec(1, 0.0), request_gap=0.2)
    rig = rigs(2, polled=[rested, a_spec(2, 0.0)]).run(20.0).prove()
    alone = rigs((2,), polled=[a_spec(2, 0.0)]).run(20.0)
    assert least_rest(rig, 1) >= 0.2
    assert len(rig.good(1)) == pytest.approx(20 / 0.23, rel=0.06)
    assert len(rig.good(2)) >= len(alone.good(2)) - len(rig.good(1)) - 2


def test_a_poll_that_a_request_wants_waits_for_the_shortest_interval_of_the_profile(rigs: Rigs) -> None:
    slow = LFS10.model_copy(update={"min_interval": 2.0})
    rig = rigs((1,), polled=[a_spec(1, 5.0, profile=slow)])
    add_fault(rig.line.sensor(1), "needs_rest", delay=1.9)
    rig.run(5.3)
    rig.poller.read("slave-1", 7)
    rig.run(9.9)
    rig.poller.read("slave-1", 8)
    rig.run(40.0).prove()
    assert all(reading.fault is None for reading in rig.of(1))
    assert [reading.requests for reading in rig.readings if reading.requests] == [(7,), (8,)]
    assert min(later.at - before.at for before, later in pairwise(rig.of(1))) >= 1.99


@pytest.mark.parametrize("retries", [0, 1])
@pytest.mark.parametrize(("sleeps", "interval"), [(0.5, 1.0), (0.9, 1.0), (0.9, 5.0), (3.0, 5.0)])
def test_one_that_sleeps_is_woken_and_that_is_no_failure(
    rigs: Rigs, sleeps: float, interval: float, retries: int
) -> None:
    slaves = (1, *HEALTHY)
    polled = [a_spec(slave, interval if slave == 1 else 1.0) for slave in slaves]
    rig = rigs(slaves, polled=polled, rules=PollRules(retries=retries))
    add_fault(rig.line.sensor(1), "sleeps", delay=sleeps)
    rig.run(100.0).prove()
    settled = rig.of(1, since=20.0)
    assert len(settled) >= 80 / interval - 1
    assert all(reading.fault is None and not reading.failed_attempts for reading in settled)
    assert all(len(rig.good(slave)) == 100 for slave in HEALTHY)


def test_a_healthy_line_is_given_no_rest_and_a_noisy_one_neither(rigs: Rigs) -> None:
    rig = rigs(8, interval=0.0)
    for slave in range(1, 5):
        add_fault(rig.line.sensor(slave), "silent", 0.05)
        add_fault(rig.line.sensor(slave), "noisy", 0.05)
    rig.run(120.0).prove()
    assert {reading.request_gap for reading in rig.readings} == {0.0}
