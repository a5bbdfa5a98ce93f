"""Polls lie on a fixed grid, the earliest due goes first, and overload degrades evenly."""

from __future__ import annotations

from collections import Counter
from itertools import pairwise
from math import inf
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lfs10d.line.device import Device, DeviceSpec, PollRules
from lfs10d.line.jobs.poll import Poll
from lfs10d.line.poll_queue import EXCLUDED_PAUSE, FLAT_OUT_PATIENCE, LATE, PollQueue, back_on_grid, spread
from lfs10d.modbus.ask import Ask
from lfs10d.modbus.frames import Codec, Framing
from lfs10d.modbus.pending import PendingRequests
from lfs10d.profiles.library import load_profile
from lfs10d.reading import Fault, FaultCode, Purpose

NOBODY: frozenset[int] = frozenset()


def a_device(slave: int, interval: float, *, due: float = 0.0) -> Device:
    profile = load_profile("lfs10", relative_to=Path())
    spec = DeviceSpec(f"slave-{slave}", slave, profile, Codec(Framing.RTU), interval)
    return Device(spec, PollRules(offline_after=1), slave, due=due)


def a_queue(*devices: Device) -> PollQueue:
    queue = PollQueue(PendingRequests())
    for device in devices:
        queue.enqueue(device)
    return queue


def poll_for(queue: PollQueue, *, until: float, taken: float) -> list[tuple[float, int]]:
    """Poll from 0 to `until`, each poll taking `taken` s; return when and whom."""
    now = 0.0
    polls = []
    while now < until:
        poll = queue.choose(now, NOBODY)
        if poll is None:
            now = queue.next_due()
            continue
        polls.append((now, poll.device.slave))
        now += taken
        queue.enqueue(poll.device)
    return polls


def test_a_device_is_polled_on_its_grid_without_drift() -> None:
    polls = poll_for(a_queue(a_device(1, 0.25, due=0.1)), until=100.0, taken=0.03)
    assert [when for when, _ in polls] == pytest.approx([0.1 + 0.25 * n for n in range(400)])


def test_each_has_its_own_interval() -> None:
    polls = poll_for(a_queue(a_device(1, 0.25), a_device(2, 1.0, due=0.05)), until=10.0, taken=0.03)
    assert Counter(slave for _, slave in polls) == {1: 40, 2: 10}


def test_overload_degrades_evenly_and_is_counted() -> None:
    devices = [a_device(slave, 1.0) for slave in range(1, 65)]
    polls = poll_for(a_queue(*devices), until=64.0, taken=0.03125)
    counts = Counter(slave for _, slave in polls)
    assert max(counts.values()) - min(counts.values()) <= 1
    for device in devices:
        assert counts[device.slave] + device.overruns == pytest.approx(64, abs=2)


@given(
    st.lists(st.sampled_from([0.0, 0.02, 0.1, 0.25, 1.0, 60.0]), min_size=1, max_size=12),
    st.floats(0.005, 0.3),
)
def test_nobody_is_polled_twice_before_one_that_was_due(intervals: list[float], taken: float) -> None:
    devices = [a_device(slave, interval) for slave, interval in enumerate(intervals, 1)]
    queue = a_queue(*devices)
    due_since = {device.slave: device.due for device in devices if device.spec.interval > 0}
    polled_since_due: dict[int, set[int]] = {slave: set() for slave in due_since}
    now = 0.0
    for _ in range(200):
        poll = queue.choose(now, NOBODY)
        if poll is None:
            now = max(queue.next_due(), now)
            continue
        slave = poll.device.slave
        for other, since in due_since.items():
            if other != slave and since <= now:
                assert slave not in polled_since_due[other]
                polled_since_due[other].add(slave)
        if slave in due_since:
            due_since[slave] = poll.device.due
            polled_since_due[slave] = set()
        now += taken
        queue.enqueue(poll.device)


def test_interval_0_takes_in_turn_what_the_due_leave() -> None:
    queue = a_queue(a_device(1, 0.0), a_device(2, 0.0), a_device(3, 1.0))
    counts = Counter(slave for _, slave in poll_for(queue, until=100.0, taken=0.125))
    assert counts[3] == 100
    assert abs(counts[1] - counts[2]) <= 1
    assert counts.total() == 800


def test_interval_0_waits_5_s_at_most_where_the_due_leave_nothing() -> None:
    queue = a_queue(a_device(1, 0.0), a_device(2, 0.02))
    polls = [when for when, slave in poll_for(queue, until=60.0, taken=0.1) if slave == 1]
    assert max(later - earlier for earlier, later in pairwise(polls)) < FLAT_OUT_PATIENCE + 0.3
    assert queue.next_due() == -inf


def test_a_retry_goes_behind_what_was_due_before() -> None:
    first, second = a_device(1, 1.0, due=0.0), a_device(2, 1.0, due=0.01)
    queue = a_queue(first, second)
    poll = queue.choose(0.02, NOBODY)
    assert poll is not None
    assert poll.device is first
    queue.resume(poll, 0.25)
    assert queue.polls() == [poll]
    following = queue.choose(0.25, NOBODY)
    assert following is not None
    assert following.device is second
    assert queue.choose(0.25, NOBODY) is poll


def test_an_excluded_slave_id_is_passed_over_for_a_while() -> None:
    queue = a_queue(a_device(1, 1.0), a_device(2, 0.0))
    assert queue.choose(0.0, frozenset({1, 2})) is None
    assert queue.next_due() == EXCLUDED_PAUSE
    poll = queue.choose(EXCLUDED_PAUSE, NOBODY)
    assert poll is not None
    assert poll.device.slave == 1


def test_one_that_went_offline_leaves_the_grid() -> None:
    device = a_device(1, 1.0)
    queue = a_queue(device)
    device.answered()
    device.failed(Fault(FaultCode.TIMEOUT, "silent"), 0.0)
    assert queue.choose(0.0, NOBODY) is None
    queue.enqueue(device)
    assert queue.next_due() == inf


def test_one_that_is_silent_at_the_start_is_polled_again_at_once_but_after_each_first_poll() -> None:
    silent, other, flat = a_device(1, 100.0), a_device(2, 100.0, due=0.3), a_device(3, 0.0)
    queue = a_queue(silent, other)
    assert (first := queue.choose(0.0, NOBODY)) is not None
    silent.polling = False
    silent.failed(Fault(FaultCode.TIMEOUT, "silent"), 0.2)
    queue.enqueue(silent)
    queue.enqueue(flat)
    polled = [queue.choose(0.4, NOBODY) for _ in range(3)]
    assert first.device is silent
    assert [poll and poll.device.slave for poll in polled] == [2, 1, 3]
    assert (silent.overruns, silent.due) == (0, 100.0)
    silent.failed(Fault(FaultCode.TIMEOUT, "silent"), 0.8)
    queue.enqueue(silent)
    assert queue.next_due() == 0.8


def test_nobody_waits_twice() -> None:
    device = a_device(1, 1.0)
    queue = a_queue(device, device)
    assert queue.choose(0.0, NOBODY) is not None
    assert queue.choose(0.0, NOBODY) is None


def test_the_line_hurries_for_who_is_polled_flat_out_is_late_or_asked_again() -> None:
    assert PollQueue(PendingRequests()).patient(0.0)
    queue = a_queue(a_device(1, 1.0, due=5.0))
    assert queue.patient(0.0)
    assert queue.patient(5.0 + 0.99 * LATE)
    assert not queue.patient(5.0 + LATE)
    queue.resume(Poll(a_device(3, 1.0), PendingRequests(), due=0.0, purpose=Purpose.POLL), 0.0)
    assert not queue.patient(0.0)
    assert not a_queue(a_device(1, 0.0), a_device(2, 1.0, due=5.0)).patient(0.0)


def test_clearing_forgets_everybody() -> None:
    gridded, flat = a_device(1, 1.0), a_device(2, 0.0)
    queue = a_queue(gridded, flat)
    queue.resume(Poll(a_device(3, 1.0), PendingRequests(), due=0.0, purpose=Purpose.POLL), 0.0)
    queue.clear()
    assert queue.next_due() == inf
    assert queue.choose(0.0, NOBODY) is None
    assert not gridded.queued
    assert not flat.queued


def test_grids_are_laid_side_by_side_but_not_far_apart() -> None:
    devices = [a_device(slave, 0.5) for slave in range(1, 5)]
    spread(devices, polled=4, wire_time=0.025, now=7.0)
    assert [device.due for device in devices] == pytest.approx([7.0, 7.05, 7.1, 7.15])
    spread(devices, polled=50, wire_time=0.025, now=7.0)
    assert [device.due for device in devices] == pytest.approx([7.0, 7.01, 7.02, 7.03])


@pytest.mark.parametrize(
    ("interval", "polled", "apart"), [(1.0, 13, 0.025), (1.0, 14, 0.05), (0.99, 4, 0.05), (2.0, 26, 0.025)]
)
def test_polls_of_a_slow_interval_follow_each_other_where_they_leave_enough_of_the_line(
    interval: float, polled: int, apart: float
) -> None:
    devices = [a_device(slave, interval) for slave in range(1, 4)]
    spread(devices, polled=polled, wire_time=0.025, now=7.0)
    assert [device.due for device in devices] == pytest.approx([7.0, 7.0 + apart, 7.0 + 2 * apart])


def test_what_passed_while_offline_is_no_overrun() -> None:
    device = a_device(1, 1.0, due=0.5)
    back_on_grid(device, 100.2)
    assert device.due == 100.5
    back_on_grid(device, 50.0)
    assert device.due == 100.5


@pytest.mark.parametrize(("interval", "due"), [(1.0, 0.5), (0.0, 0.7)])
def test_a_poll_knows_what_it_is_for_and_when_it_was_due(interval: float, due: float) -> None:
    device = a_device(1, interval, due=0.5)
    pending = PendingRequests()
    queue = PollQueue(pending)
    queue.enqueue(device)
    poll = queue.choose(0.7, NOBODY)
    assert poll is not None
    assert (poll.purpose, poll.due, poll.device) == (Purpose.POLL, due, device)
    assert isinstance(poll.ask(0.7), Ask)
    assert device.polling
    assert device.last_asked == 0.7


@pytest.mark.parametrize(
    ("interval", "due", "now", "following"),
    [(0.25, 0.5, 100.2, 100.25), (4.0, 0.5, 9.0, 12.5), (1.0, 2.0, 2.0, 3.0), (0.0, 0.5, 100.2, 0.5)],
)
def test_one_that_is_back_goes_on_at_the_next_point_of_its_own_grid(
    interval: float, due: float, now: float, following: float
) -> None:
    device = a_device(1, interval, due=due)
    back_on_grid(device, now)
    assert device.due == following
