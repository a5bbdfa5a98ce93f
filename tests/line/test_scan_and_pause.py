"""Others while a scan goes on, and a line whose port is another program's for a while. Virtual time."""

from __future__ import annotations

from pathlib import Path

import pytest

from lfs10d.line.device import PollRules
from lfs10d.line.jobs.identification import by_evidence
from lfs10d.line.jobs.scan import Scan
from lfs10d.line.jobs.scan_plan import ScanPlan
from lfs10d.modbus.frames import Codec, Framing
from lfs10d.modbus.timing import LineTiming
from lfs10d.profiles.library import builtin_names, load_profile
from lfs10d.reading import Fault, FaultCode
from lfs10d.simulator.sensor import Sensor
from lfs10d.simulator.wire import Format
from tests.support.lines import Rig, Rigs

PROFILES = by_evidence(load_profile(name, relative_to=Path()) for name in builtin_names())
WIRE = 0.0314
"""s that one poll takes at 9600 baud with 5 ms of turnaround."""


def a_scan(share: float, rates: tuple[int, ...]) -> Scan:
    timings = tuple(LineTiming.of(rate) for rate in rates)
    return Scan(ScanPlan(tuple(range(1, 256)), timings, Codec(Framing.RTU), PROFILES, line_rate=9600, share=share))


@pytest.mark.parametrize("rates", [(9600,), (9600, 19200)])
@pytest.mark.parametrize("sensors", [3, 16])
def test_during_a_scan_the_others_keep_70_percent_of_their_rate_on_a_line_that_is_70_percent_full(
    rigs: Rigs, sensors: int, rates: tuple[int, ...]
) -> None:
    interval = sensors * WIRE / 0.7
    rig = rigs(sensors, interval=interval).run(5.0)
    scan = a_scan(0.3, rates)
    rig.poller.submit(scan)
    while not scan.over:
        rig.run(rig.clock.now + 1.0)
    assert scan.complete
    assert [finding.slave for finding in scan.found] == list(range(1, sensors + 1))
    took = rig.clock.now - 5.0
    for slave in range(1, sensors + 1):
        assert len(rig.good(slave, since=5.0)) >= 0.7 * took / interval
        assert not rig.codes(slave)
    if rates == (9600,):  # at the other rate sensors hear nothing, and their own line's bytes are not judged
        rig.prove()


@pytest.mark.parametrize("retries", [0, 1])
@pytest.mark.parametrize("echo", [False, True])
def test_wherever_its_slices_fall_a_scan_at_another_rate_costs_the_others_no_answer(
    rigs: Rigs, retries: int, *, echo: bool
) -> None:
    """Sensors at 19200 baud, polled five times a second, while those at 9600 baud are looked for."""
    for phase in range(12):
        rig = rigs(
            (1, 2, 5), interval=0.2, baudrate=19200, turnaround=0.003, rules=PollRules(retries=retries), echo=echo
        )
        rig.line.add(Sensor(9, format=Format(9600)))
        rig.run(2.0 + phase * 0.017)
        timings = LineTiming.of(19200), LineTiming.of(9600)
        ids = tuple(range(1, 13))
        scan = Scan(ScanPlan(ids, timings, Codec(Framing.RTU), PROFILES, line_rate=19200, share=0.6))
        rig.poller.submit(scan)
        while not scan.over:
            rig.run(rig.clock.now + 0.5)
        assert [(found.slave, found.baudrate) for found in scan.found] == [
            (9, 9600),
            (1, 19200),
            (2, 19200),
            (5, 19200),
        ]
        assert not any(rig.codes(slave) for slave in (1, 2, 5))


def paused(rig: Rig) -> list[bool]:
    """Pause, and return what becomes true when the port is free."""
    freed: list[bool] = []
    rig.poller.pause(lambda: freed.append(rig.poller.bus.open))
    return freed


def test_a_pause_frees_the_port_with_one_sample_per_device_until_it_is_told_to_end(rigs: Rigs) -> None:
    rig = rigs(3, interval=1.0).run(2.0)
    freed = paused(rig)
    rig.run(2.1)
    assert freed == [False]
    sent = rig.sent
    rig.run(60.0)
    assert rig.sent == sent
    assert not rig.poller.bus.open
    assert [dict(rig.codes(slave)) for slave in (1, 2, 3)] == [{FaultCode.PORT_LOST: 1}] * 3
    assert rig.port_changes[-1].freed

    rig.poller.resume()
    rig.run(60.2).prove()
    assert [len(rig.good(slave, since=60.0)) for slave in (1, 2, 3)] == [1, 1, 1], "all are due at once"
    assert [change.fault is None for change in rig.port_changes] == [True, False, True]


def test_a_pause_waits_for_the_exchange_under_way(rigs: Rigs) -> None:
    rig = rigs(1, interval=0.0).run(1.01)
    before = len(rig.good(1))
    freed = paused(rig)
    while not freed:
        rig.run(rig.clock.now + 0.001)
    rig.prove()
    assert len(rig.good(1)) == before + 1


def test_a_second_pause_changes_nothing_and_one_end_ends_both(rigs: Rigs) -> None:
    rig = rigs(1).run(1.0)
    first, second = paused(rig), paused(rig)
    rig.run(2.0)
    assert (first, second) == ([False], [False])
    assert rig.codes(1) == {FaultCode.PORT_LOST: 1}
    rig.poller.resume()
    rig.poller.resume()
    rig.run(3.0).prove()
    assert rig.good(1, since=2.0)
    assert len(rig.port_changes) == 3


def test_after_a_pause_it_is_told_that_the_port_is_still_gone(rigs: Rigs) -> None:
    rig = rigs(2).run(1.0)
    rig.port.unplug()
    rig.run(3.0)
    paused(rig)
    rig.run(10.0)
    told = len(rig.port_changes)
    rig.poller.resume()
    rig.run(20.0)
    absent = Fault(FaultCode.PORT_LOST, "/dev/simulated: no such device; is the adapter plugged in?")
    assert [change.fault for change in rig.port_changes[told:]] == [absent]
    assert rig.codes(1) == {FaultCode.PORT_LOST: 1}
    rig.port.replug()
    rig.run(23.0).prove()
    assert rig.good(1, since=20.0)


def test_a_pause_ends_a_scan(rigs: Rigs) -> None:
    rig = rigs(2).run(1.0)
    scan = a_scan(0.3, (9600,))
    rig.poller.submit(scan)
    rig.run(3.0)
    paused(rig)
    rig.run(4.0)
    assert (scan.over, scan.lost, scan.complete) == (True, True, False)
