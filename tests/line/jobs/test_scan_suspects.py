"""Suspected and duplicate ids, and noise, on a scanned line."""

from __future__ import annotations

import pytest

from lfs10d.line.jobs.scan import Scan
from lfs10d.reading import FaultCode
from lfs10d.simulator.line_faults import babble, second_master, stray
from lfs10d.simulator.sensor import Sensor
from tests.support.scans import Scanned, by_id, found_ids, ill, line_of, scanned, search

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
    # It answers, for what all three refuse alike at the same time is one right frame (registers of other profiles).
    assert (finding.answers, finding.suspect, finding.duplicate) == (True, True, True)
    assert finding.profile is None


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
