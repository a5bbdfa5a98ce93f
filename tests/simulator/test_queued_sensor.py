"""A sensor that answers in turn."""

from __future__ import annotations

from lfs10d.simulator.wire import Format
from tests.support.faulty_sensors import add_fault
from tests.support.queued_sensor import QueuedSensor

READ = bytes((1, 3, 0, 1, 0, 2))
LASTS = Format().span(9)
"""Of an answer, in ns."""


def test_an_answer_waits_until_the_one_before_is_over_and_silence_was_kept() -> None:
    sensor = QueuedSensor(1, turnaround=0.005)
    add_fault(sensor, "late", delay=0.5, last=1.0)
    first = sensor.hear(READ, 900_000_000)
    second = sensor.hear(READ, 1_100_000_000)
    assert first is not None
    assert second is not None
    assert second.start == first.start + LASTS + Format().t35


def test_with_nothing_left_to_say_it_answers_as_any_other() -> None:
    sensor = QueuedSensor(1, turnaround=0.005)
    replies = [sensor.hear(READ, ended) for ended in (0, 1_000_000_000)]
    assert [reply and reply.start for reply in replies] == [5_000_000, 1_005_000_000]


def test_what_is_not_for_it_it_does_not_answer() -> None:
    assert QueuedSensor(2).hear(READ, 0) is None
