"""A scan on a simulated line in virtual time: who is found, who is suspected, what it costs, and what others notice."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path

import pytest

from lfs10d.line.device import DeviceSpec, PollRules
from lfs10d.line.jobs.identification import FoundDevice
from lfs10d.line.jobs.job import Continue, Done, Requeue
from lfs10d.line.jobs.scan import SLICE, Scan
from lfs10d.line.jobs.scan_plan import ScanPlan
from lfs10d.line.poller import Poller
from lfs10d.line.scheduler import Scheduler
from lfs10d.modbus.ask import Ask
from lfs10d.modbus.bus import Bus, LineRules
from lfs10d.modbus.frames import Codec, Framing
from lfs10d.modbus.outcome import Outcome
from lfs10d.modbus.port_settings import PortSettings
from lfs10d.modbus.timing import LineTiming
from lfs10d.profiles.library import builtin_names, load_profile
from lfs10d.reading import Event, Exchanged, FaultCode, PortChanged, Purpose
from lfs10d.simulator.line import SimulatedLine
from lfs10d.simulator.line_faults import babble, second_master, stray
from lfs10d.simulator.port import SimulatedPort, VirtualClock, run
from lfs10d.simulator.registers import blueprint_of
from lfs10d.simulator.sensor import Sensor
from lfs10d.simulator.wire import Format

PROFILES = tuple(load_profile(name, relative_to=Path()) for name in builtin_names()[:4])
RTU = Codec(Framing.RTU)
ALL = range(1, 256)
LONGEST = 400.0
"""Virtual seconds after which a scan counts as endless."""


def search(ids: Iterable[int], rates: Iterable[int] = (9600,), *, timeout: float = 0.1) -> ScanPlan:
    return ScanPlan(tuple(ids), tuple(LineTiming.of(rate) for rate in rates), RTU, PROFILES, timeout=timeout)


def line_of(*sensors: Sensor | int) -> SimulatedLine:
    """Return a line with these sensors; a number is a healthy LFS10 with that id at 9600 baud."""
    line = SimulatedLine(seed=1, keep_log=True)
    for sensor in sensors:
        line.add(Sensor(sensor) if isinstance(sensor, int) else sensor)
    return line


def ill(slave: int, kind: str, **particulars: float) -> Sensor:
    sensor = Sensor(slave)
    sensor.add_fault(kind, **particulars)
    return sensor


@dataclass
class Scanned:
    """A scan that runs on a line in virtual time, with everything that was heard."""

    line: SimulatedLine
    scan: Scan
    echo: bool = False
    latency: float = 0.0
    events: list[Event] = field(default_factory=list)
    clock: VirtualClock = field(default_factory=VirtualClock)

    def __post_init__(self) -> None:
        self.port = SimulatedPort(self.line, self.clock, PortSettings("/dev/sim"), echo=self.echo, latency=self.latency)
        bus = Bus(self.port, LineRules(), self.clock)
        self.scheduler = Scheduler(bus.line_timing, 0.0)
        self.poller = Poller(bus, self.scheduler, self.events.extend, self.clock)
        self.poller.submit(self.scan)

    def pass_time(self, seconds: float) -> None:
        run(self.poller.turn, self.port, self.clock, self.clock.now + seconds)

    def finish(self) -> Scanned:
        while not self.scan.over:
            assert self.clock.now < LONGEST, "the scan does not end"
            self.pass_time(0.5)
        return self

    @property
    def exchanges(self) -> list[Exchanged]:
        return [event for event in self.events if isinstance(event, Exchanged)]


def scanned(line: SimulatedLine, ids: Iterable[int] = ALL, rates: Iterable[int] = (9600,), **adapter: float) -> Scanned:
    echo, latency = bool(adapter.get("echo")), adapter.get("latency", 0.0)
    done = Scanned(line, Scan(search(ids, rates)), echo=echo, latency=latency).finish()
    assert done.scan.complete
    assert done.scan.progress.percent == 100.0
    assert line.judge.summary()["gap_violations"] == 0
    return done


def by_id(scan: Scan) -> dict[int, FoundDevice]:
    return {finding.slave: finding for finding in scan.found}


def found_ids(scan: Scan) -> list[int]:
    return [finding.slave for finding in scan.found]


# -- who is found


def test_every_sensor_is_found_with_id_rate_time_profile_and_value() -> None:
    done = scanned(line_of(1, 3, 200))
    assert found_ids(done.scan) == [1, 3, 200]
    for finding in done.scan.found:
        assert (finding.baudrate, finding.answers, finding.id_register) == (9600, True, finding.slave)
        assert finding.profile is PROFILES[0]
        assert set(finding.values) == {"wind_speed"}
        assert finding.rtt == pytest.approx(0.0206, abs=0.001)
        assert not finding.suspect
        assert not finding.duplicate


def test_nobody_is_found_on_an_empty_line() -> None:
    done = scanned(line_of())
    assert done.scan.found == ()
    assert done.scan.noise.last is None


def test_an_empty_line_takes_as_long_as_was_said_before() -> None:
    done = scanned(line_of())
    assert len(done.exchanges) == 255
    assert done.exchanges[-1].at == pytest.approx(done.scan.plan.expected, rel=0.02)


def test_sensors_are_found_at_each_rate() -> None:
    fast = Sensor(9, format=Format(19200))
    done = scanned(line_of(2, fast), range(1, 20), (9600, 19200))
    assert [(finding.slave, finding.baudrate) for finding in done.scan.found] == [(2, 9600), (9, 19200)]


def test_the_rate_is_changed_once_per_round_when_nobody_else_speaks() -> None:
    done = scanned(line_of(2), [1, 3, 250], (9600, 19200))
    rates = [round(8 * 10 / ((request.ended - request.begun) / 1e9)) for request in done.line.log if request.frame]
    assert rates == pytest.approx([9600, 9600, 19200, 19200, 9600, 19200], rel=0.01)


@pytest.mark.parametrize("turnaround", [0.09, 0.3, 0.62, 0.9])
def test_a_slow_sensor_is_found_though_it_is_not_waited_for(turnaround: float) -> None:
    done = scanned(line_of(Sensor(40, turnaround=turnaround), 41), range(30, 60))
    assert found_ids(done.scan) == [40, 41]
    assert by_id(done.scan)[40].rtt == pytest.approx(turnaround + 0.0156, abs=0.002)
    assert done.scan.noise.ids == 0


def test_a_slow_sensor_whose_answer_ran_into_the_next_request_is_found() -> None:
    done = scanned(line_of(Sensor(40, turnaround=0.108)), range(30, 60))
    assert found_ids(done.scan) == [40]


def test_a_sensor_that_refuses_everything_is_found() -> None:
    finding = by_id(scanned(line_of(ill(5, "exception")), range(1, 9)).scan)[5]
    assert (finding.answers, finding.profile, finding.exception) == (True, None, 2)


def test_a_sensor_whose_value_is_no_number_is_found_as_an_unknown_device() -> None:
    # Named an LFS10 before: by its id register alone.
    finding = by_id(scanned(line_of(ill(5, "nan")), range(1, 9)).scan)[5]
    assert (finding.answers, finding.profile, dict(finding.values)) == (True, None, {})


def test_every_built_in_device_is_recognised() -> None:
    line = line_of(*(Sensor(10 + place, blueprint=blueprint_of(each)) for place, each in enumerate(PROFILES)))
    found = by_id(scanned(line, range(1, 20)).scan)
    assert [found[10 + place].profile for place in range(len(PROFILES))] == list(PROFILES)


def test_an_echoing_adapter_hides_nobody_and_invents_nobody() -> None:
    done = scanned(line_of(4, 5), range(1, 12), echo=True)
    assert found_ids(done.scan) == [4, 5]
    assert done.scan.noise.echoed
    assert done.scan.noise.ids == 0


def test_an_adapter_that_delivers_in_pieces_hides_nobody() -> None:
    assert found_ids(scanned(line_of(4, 5), range(1, 12), latency=0.016).scan) == [4, 5]


def test_nothing_is_ever_written() -> None:
    done = scanned(line_of(3, ill(4, "garbage"), 255), ALL, (9600, 19200))
    assert {event.sent[1] for event in done.exchanges} == {3}


def test_a_single_id_is_waited_for_patiently() -> None:
    assert found_ids(scanned(line_of(Sensor(7, turnaround=0.8)), [7]).scan) == [7]


# -- suspects and duplicates


def test_ids_from_248_are_asked_when_everybody_else_was() -> None:
    done = scanned(line_of(2), [1, 2, 248, 255], (9600, 19200))
    asked = [event.slave for event in done.exchanges]
    assert asked.index(248) > max(place for place, slave in enumerate(asked) if slave < 248)


def test_a_sensor_that_answers_255_too_makes_255_suspect() -> None:
    found = by_id(scanned(line_of(ill(2, "wildcard")), [1, 2, 3, 255]).scan)
    assert not found[2].suspect
    assert (found[255].suspect, found[255].id_register) == (True, 2)


def test_255_alone_is_no_suspect() -> None:
    assert not by_id(scanned(line_of(255)).scan)[255].suspect


def test_two_reserved_ids_suspect_each_other() -> None:
    assert [finding.suspect for finding in scanned(line_of(250, 251), [1, 250, 251]).scan.found] == [True, True]


def test_several_that_answer_255_at_once_are_told_as_suspect_and_duplicate() -> None:
    done = scanned(line_of(*(ill(slave, "wildcard") for slave in (2, 7, 8))), [2, 7, 8, 255])
    finding = by_id(done.scan)[255]
    assert (finding.answers, finding.suspect, finding.duplicate) == (False, True, True)


@pytest.mark.parametrize("turnaround", [0.005, 0.0124, 0.02])
def test_two_sensors_with_one_id_are_suspected(turnaround: float) -> None:
    done = scanned(line_of(9, Sensor(9, turnaround=turnaround, seed=4), 10), range(1, 20))
    assert [(finding.slave, finding.duplicate) for finding in done.scan.found] == [(9, True), (10, False)]


def test_an_answer_that_follows_late_makes_nobody_twice() -> None:
    done = scanned(line_of(9, Sensor(9, turnaround=0.13, seed=4), 10), range(1, 20))
    assert found_ids(done.scan) == [9, 10]
    assert done.scan.noise.ids == 0


def test_an_id_with_nothing_but_garbage_is_a_duplicate_that_does_not_answer() -> None:
    finding = by_id(scanned(line_of(ill(9, "garbage"), 10), range(1, 20)).scan)[9]
    assert (finding.answers, finding.duplicate, finding.profile) == (False, True, None)


# -- noise


def test_a_sensor_that_garbles_now_and_then_is_no_duplicate() -> None:
    line = line_of(ill(5, "noisy", rate=0.1))
    assert [(finding.slave, finding.duplicate) for finding in scanned(line, range(1, 20)).scan.found] == [(5, False)]


def test_noise_behind_every_request_invents_nobody_and_hides_nobody() -> None:
    line = line_of(5)
    stray(line, 1.0)
    done = scanned(line, range(1, 40))
    assert found_ids(done.scan) == [5]
    assert done.scan.noise.ids == 38
    assert done.scan.noise.last is not None
    assert done.scan.noise.last.code is FaultCode.MALFORMED
    assert len(done.exchanges) < 50


def test_rare_noise_invents_nobody() -> None:
    line = line_of(5)
    stray(line, 0.05)
    done = scanned(line)
    assert found_ids(done.scan) == [5]
    assert 0 < done.scan.noise.ids < 40


def test_a_second_master_is_told_as_noise() -> None:
    line = line_of(5)
    second_master(line, bytes((1, 3, 0, 1, 0, 2)), 0.05, 0.35)
    done = Scanned(line, Scan(search(range(2, 40)))).finish()
    assert 5 in found_ids(done.scan)
    assert done.scan.noise.ids > 3


def test_a_line_that_never_falls_silent_is_told_and_not_spoken_on() -> None:
    line = line_of(5)
    babble(line, 0.0)
    done = Scanned(line, Scan(search(range(1, 11)))).finish()
    assert done.scan.found == ()
    assert (done.scan.noise.ids, done.scan.noise.refused) == (10, 10)
    assert not line.log


# -- as a job


def test_while_the_first_answer_is_awaited_all_of_the_time_remains() -> None:
    scan = Scan(search(range(1, 50)))
    scan.ask(24_000.0)
    assert scan.progress.remaining == pytest.approx(scan.plan.expected)


def test_progress_goes_up_and_the_remaining_time_down() -> None:
    running = Scanned(line_of(3), Scan(search(range(1, 50))))
    assert running.scan.progress.remaining == pytest.approx(running.scan.plan.expected)
    seen = []
    while not running.scan.over:
        seen.append((running.scan.progress.percent, running.scan.progress.remaining))
        running.pass_time(1.0)
    assert [percent for percent, _ in seen] == sorted(percent for percent, _ in seen)
    assert [left for _, left in seen] == sorted((left for _, left in seen), reverse=True)
    assert running.scan.progress.remaining == 0.0
    assert running.scan.progress.slave == 49


def test_what_was_found_before_it_is_cancelled_stays() -> None:
    running = Scanned(line_of(1, 90), Scan(search(ALL)))
    running.pass_time(1.0)
    running.scan.cancel()
    running.pass_time(0.5)
    assert (running.scan.over, running.scan.complete, found_ids(running.scan)) == (True, False, [1])
    asked = len(running.exchanges)
    running.pass_time(2.0)
    assert len(running.exchanges) == asked


def test_a_scan_cancelled_before_it_began_asks_nobody() -> None:
    scan = Scan(search([1]))
    scan.cancel()
    assert scan.ask(0.0) == Done()
    assert scan.over


@pytest.mark.parametrize(
    ("event", "complete", "lost"), [("nothing", True, False), ("cancelled", False, False), ("unplugged", False, True)]
)
def test_however_it_ends_that_is_told_once(event: str, *, complete: bool, lost: bool) -> None:
    ended: list[Scan] = []
    running = Scanned(line_of(1), Scan(search(range(1, 21)), ended.append))
    running.pass_time(0.5)
    assert not ended
    if event == "cancelled":
        running.scan.cancel()
    if event == "unplugged":
        running.port.unplug()
    running.pass_time(20.0)
    assert ended == [running.scan]
    assert (running.scan.over, running.scan.complete, running.scan.lost) == (True, complete, lost)


def test_the_loss_of_the_port_ends_it_with_what_was_found() -> None:
    running = Scanned(line_of(1), Scan(search(ALL)))
    running.pass_time(1.0)
    running.port.unplug()
    running.pass_time(1.0)
    assert (running.scan.over, running.scan.complete, found_ids(running.scan)) == (True, False, [1])
    lost = [event for event in running.events if isinstance(event, PortChanged) and event.fault]
    assert lost[0].fault is not None
    assert lost[0].fault.code is FaultCode.PORT_LOST


def beside_polls(share: float, rates: tuple[int, ...]) -> Scanned:
    """Scan for ten seconds with a share of a line on which one sensor is polled every 100 ms."""
    looked_for = ScanPlan(
        tuple(range(20, 200)), tuple(LineTiming.of(rate) for rate in rates), RTU, PROFILES, line_rate=9600, share=share
    )
    running = Scanned(line_of(1), Scan(looked_for))
    running.poller.replace([DeviceSpec("mast", 1, PROFILES[0], RTU, 0.1)], PollRules())
    running.pass_time(10.0)
    return running


def taken(running: Scanned) -> float:
    return sum(event.at - event.asked for event in running.exchanges if event.purpose is Purpose.SCAN)


@pytest.mark.parametrize("rate", [9600, 19200])
def test_beside_polls_it_takes_its_share_of_the_line_and_no_more(rate: int) -> None:
    assert 2.0 < taken(beside_polls(0.3, (rate,))) < 3.2


def test_at_the_lines_own_rate_polls_come_between_any_two_questions() -> None:
    errands = [event.purpose for event in beside_polls(0.3, (9600,)).exchanges]
    assert (Purpose.SCAN, Purpose.SCAN) not in set(pairwise(errands))


def test_another_rate_is_spoken_in_slices_and_never_for_one_exchange() -> None:
    running = beside_polls(0.3, (19200,))
    slices: list[list[Exchanged]] = [[]]
    for event in running.exchanges:
        if event.purpose is Purpose.SCAN:
            slices[-1].append(event)
        elif slices[-1]:
            slices.append([])
    whole = [each for each in slices if each][:-1]
    assert len(whole) > 5
    for each in whole:
        assert len(each) == 2
        assert each[-1].at - each[0].asked <= SLICE


def test_polls_beside_a_scan_lose_nothing() -> None:
    running = beside_polls(0.3, (19200,))
    polls = [event for event in running.exchanges if event.purpose is Purpose.POLL]
    assert len(polls) > 50
    assert {event.fault for event in polls} == {None}


def test_a_slice_is_claimed_only_where_another_exchange_fits() -> None:
    scan = Scan(ScanPlan((1, 2, 3), (LineTiming.of(19200),), RTU, PROFILES, line_rate=9600, share=0.3))
    first = scan.ask(0.0)
    assert isinstance(first, Ask)
    assert first.baudrate == 19200
    silent = _silence(first)
    assert isinstance(scan.on_outcome(silent, 0.11), Continue)
    assert isinstance(scan.ask(0.11), Ask)
    assert isinstance(scan.on_outcome(silent, 0.22), Requeue)


def _silence(ask: Ask) -> Outcome:
    """Return the outcome of an exchange in which nothing was heard."""
    running = Scanned(line_of(), Scan(search([ask.request.slave])))
    kept: list[Outcome] = []
    on_outcome = running.scan.on_outcome

    def keep(outcome: Outcome, now: float) -> Continue | Requeue | Done:
        kept.append(outcome)
        return on_outcome(outcome, now)

    running.scan.on_outcome = keep  # type: ignore[method-assign]  # an ear at the door
    running.finish()
    return kept[0]
