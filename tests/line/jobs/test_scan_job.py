"""A scan as a job: progress, cancelling, loss of the port, polls beside it."""

from __future__ import annotations

from itertools import pairwise

import pytest

from lfs10d.line.device import DeviceSpec, PollRules
from lfs10d.line.jobs.job import Continue, Done, Requeue
from lfs10d.line.jobs.scan import SLICE, Scan
from lfs10d.line.jobs.scan_plan import ScanPlan
from lfs10d.modbus.ask import Ask
from lfs10d.modbus.outcome import Outcome
from lfs10d.modbus.timing import LineTiming
from lfs10d.reading import Exchanged, FaultCode, PortChanged, Purpose
from tests.support.scans import ALL, PROFILES, RTU, Scanned, found_ids, line_of, search

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
    purposes = [event.purpose for event in beside_polls(0.3, (9600,)).exchanges]
    assert (Purpose.SCAN, Purpose.SCAN) not in set(pairwise(purposes))


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
