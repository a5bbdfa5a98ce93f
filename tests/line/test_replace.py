"""What is polled may change at any moment: nothing wedges, nobody gone is polled, those that stay keep their grid."""

from __future__ import annotations

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from lfs10d.line.device import PollRules
from lfs10d.line.jobs.poll import Poll
from lfs10d.reading import Purpose
from tests.support.faulty_sensors import add_fault
from tests.support.lines import Rig, Rigs

RULES = PollRules()


def requested(rig: Rig, slave: int, number: int) -> Poll:
    """Have a device polled for request `number` now."""
    scheduler = rig.poller.scheduler
    device = scheduler.devices[f"slave-{slave}"]
    poll = Poll(device, scheduler.pending, due=rig.clock.now, purpose=Purpose.REQUEST, request=number)
    rig.poller.submit(poll)
    return poll


def test_those_that_stay_keep_their_grid(rigs: Rigs) -> None:
    rig = rigs(3, interval=1.0).run(10.5)
    first = rig.of(1)[0].at - 0.1
    rig.poller.replace([rigs.spec(1, 1.0), rigs.spec(2, 0.25)], RULES)
    rig.run(30.0).prove()
    assert [(reading.at - first) % 1.0 for reading in rig.of(1)] == pytest.approx([0.1] * 30, abs=0.05)
    assert not any(reading.overruns for reading in rig.of(1))
    assert len(rig.of(2, since=11.0)) == pytest.approx(76, abs=1)
    assert not rig.of(3, since=10.6)


def test_one_that_is_renamed_or_moved_is_another_device(rigs: Rigs) -> None:
    rig = rigs(3, polled=[rigs.spec(1, 1.0)]).run(5.0)
    rig.poller.replace([rigs.spec(1, 1.0, name="mast-top")], RULES)
    rig.run(10.0)
    assert {reading.device for reading in rig.readings if reading.at > 5.1} == {"mast-top"}
    rig.poller.replace([rigs.spec(2, 1.0, name="mast-top")], RULES)
    rig.run(15.0)
    assert {exchange.slave for exchange in rig.exchanges if exchange.at > 10.1} == {2}


def test_one_that_is_disabled_is_left_alone_and_comes_back_anew(rigs: Rigs) -> None:
    rig = rigs(2, interval=0.25).run(5.0)
    rig.poller.replace([rigs.spec(1, 0.25, enabled=False), rigs.spec(2, 0.25)], RULES)
    rig.run(10.0)
    assert not rig.of(1, since=5.1)
    rig.poller.replace([rigs.spec(1, 0.25), rigs.spec(2, 0.25)], RULES)
    rig.run(15.0).prove()
    assert len(rig.good(1, since=10.0)) >= 19


@pytest.mark.parametrize("state", ["online", "offline", "unheard", "disabled"])
def test_a_requested_poll_is_done_once_whatever_the_device_is(rigs: Rigs, state: str) -> None:
    specs = [rigs.spec(slave, 10.0, enabled=(slave, state) != (1, "disabled")) for slave in (1, 2)]
    rig = rigs(2, polled=specs)
    if state == "offline":
        add_fault(rig.line.sensor(1), "silent")
        rig.run(41.0)
        assert not rig.of(1)[-1].online
        rig.line.sensor(1).faults.clear()
    elif state != "unheard":
        rig.run(41.0)
    asked = rig.clock.now
    requested(rig, 1, 7)
    rig.run(asked + 4.0).prove()
    answers = [reading for reading in rig.of(1) if reading.requests == (7,)]
    assert [reading.fault for reading in answers] == [None]
    assert answers[0].at - asked < 0.1


def test_a_requested_poll_waits_for_the_exchange_in_progress_only(rigs: Rigs) -> None:
    rig = rigs(32, interval=0.0)
    add_fault(rig.line.sensor(5), "silent")
    waits = []
    for n in range(50):
        rig.run(30.0 + n * 0.4371)  # no probe of 1 s falls into what follows
        asked = rig.clock.now
        requested(rig, 9, n)
        rig.run(asked + 0.4)
        (answer,) = [reading for reading in rig.of(9) if reading.requests == (n,)]
        waits.append(answer.at - asked)
    one = rig.poller.bus.timing.exchange(8, 9, 0.005)
    assert sorted(waits)[40] < 2 * one
    assert max(waits) < 0.2 + 2 * one  # a probe was in progress
    rig.prove()


def test_a_requested_poll_ends_with_the_port_and_is_told_at_once_while_it_is_lost(rigs: Rigs) -> None:
    specs = [rigs.spec(1, 10.0), rigs.spec(2, 10.0, enabled=False)]
    rig = rigs(2, polled=specs)
    add_fault(rig.line.sensor(2), "silent")
    rig.run(5.0)
    requested(rig, 2, 1)
    rig.run(5.1)
    rig.port.unplug()
    rig.run(6.0)
    requested(rig, 1, 2)
    requested(rig, 2, 3)
    rig.run(7.5)
    told = {reading.requests: reading.fault for reading in rig.readings if reading.requests}
    assert set(told) == {(1,), (2,), (3,)}
    assert all(told.values())


def test_a_requested_poll_of_a_device_that_is_removed_in_between_is_dropped(rigs: Rigs) -> None:
    rig = rigs(2, interval=10.0).run(5.0)
    add_fault(rig.line.sensor(1), "silent")
    requested(rig, 1, 1)
    rig.run(5.01)
    rig.poller.replace([rigs.spec(2, 10.0)], RULES)
    requested(rig, 2, 2)
    rig.run(40.0).prove()
    assert not rig.of(1, since=5.1)
    assert next(reading.requests for reading in rig.of(2, since=5.0)) == (2,)
    assert {exchange.slave for exchange in rig.exchanges if exchange.at > 6.0} == {2}


SPECS = st.lists(
    st.tuples(
        st.integers(1, 5), st.sampled_from([0.0, 0.1, 0.25, 1.0, 86400.0]), st.booleans(), st.sampled_from(["", "-new"])
    ),
    max_size=5,
    unique_by=lambda each: each[0],
)
STEPS = st.lists(
    st.tuples(st.floats(0.0, 0.7), st.one_of(SPECS, st.sampled_from(["lose", "find", "silence", "heal", "read"]))),
    min_size=1,
    max_size=14,
)


def change(rigs: Rigs, rig: Rig, step: list[tuple[int, float, bool, str]] | str, number: int) -> None:
    """Take one step: another list of devices, or something that happens to port or sensors, or requests for all."""
    if not isinstance(step, str):
        specs = [rigs.spec(slave, every, name=f"slave-{slave}{new}", enabled=on) for slave, every, on, new in step]
        rig.poller.replace(specs, RULES)
        return
    match step:
        case "lose":
            rig.port.unplug()
        case "find":
            rig.port.replug()
        case "silence":
            add_fault(rig.line.sensor(number % 5 + 1), "silent")
        case "heal":
            for sensor in rig.line.sensors:
                sensor.faults.clear()
        case _:
            for slave in range(1, 6):
                if f"slave-{slave}" in rig.poller.scheduler.devices:
                    requested(rig, slave, number)


@pytest.mark.long(6)
@given(STEPS)
@settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_changes_at_any_moment_wedge_nothing(
    rigs: Rigs, steps: list[tuple[float, list[tuple[int, float, bool, str]] | str]]
) -> None:
    rig = rigs(5, interval=0.25)
    for number, (pause, step) in enumerate(steps):
        rig.run(rig.clock.now + pause)
        change(rigs, rig, step, number)
    change(rigs, rig, "find", 0)
    change(rigs, rig, "heal", 0)
    changed = rig.clock.now
    rig.poller.replace([rigs.spec(2, 0.25), rigs.spec(4, 0.0)], RULES)
    settled = changed + 17.0  # the longest pause between probes, and a probe
    rig.run(settled + 8.0)
    assert {exchange.slave for exchange in rig.exchanges if exchange.at > changed + 1.2} == {2, 4}
    assert len(rig.good(2, since=settled)) >= 31
    assert len(rig.good(4, since=settled)) >= 200
