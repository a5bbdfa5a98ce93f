"""Which answers a master may believe, by the line's own log; in virtual time."""

from __future__ import annotations

from lfs10d.simulator.faults import FaultKind
from lfs10d.simulator.line import SimulatedLine
from lfs10d.simulator.sensor import Sensor
from lfs10d.simulator.wire import SECOND, Format, seal
from soak.line import SLAVES, ail, answers_of
from soak.oracle import Numbered, Sent
from tests.support.faulty_sensors import add_fault

WIND = seal(bytes((1, 3, 0, 1, 0, 2)))
ID = seal(bytes((1, 3, 0, 5, 0, 1)))
ORIGIN = 1_000.0


def asked(sensor: Sensor, *requests: tuple[float, bytes], stray: float | None = None) -> list[Sent]:
    """Return the settled answers of a sensor that is asked at these times (s)."""
    shape = Format(19200)
    sensor.format = shape
    sensor.source = Numbered()
    line = SimulatedLine([sensor], format=shape)
    for at, frame in requests:
        line.transmit(frame, round(at * SECOND), shape)
        if stray is not None:
            line.speak("noise", b"abc", round(stray * SECOND))
    line.advance(10 * SECOND)
    return answers_of(line.log, line.log, {sensor: "slave-1"}, ORIGIN)


def late(delay: float) -> Sensor:
    """Return a sensor that answers late."""
    sensor = Sensor(1)
    add_fault(sensor, FaultKind.LATE, delay=delay)
    return sensor


def test_a_good_answer_is_believable_and_prompt() -> None:
    (sent,) = asked(Sensor(1, turnaround=0.005), (1.0, WIND))
    assert (sent.number, sent.device, sent.believable, sent.prompt) == (1, "slave-1", True, True)
    # 8 bytes, the turnaround, 9 bytes of ten bits each
    assert abs(sent.at - (ORIGIN + 1.0 + 0.005 + 17 * 10 / 19200)) < 1e-6


def test_a_late_answer_is_believable_until_something_else_is_asked() -> None:
    (alone,) = asked(late(0.6), (1.0, WIND))
    assert (alone.believable, alone.prompt) == (True, False)
    overtaken = asked(late(0.6), (1.0, WIND), (1.4, ID))
    assert [each.believable for each in overtaken] == [False]


def test_a_struck_answer_is_not_believable() -> None:
    (sent,) = asked(Sensor(1, turnaround=0.005), (1.0, WIND), stray=1.012)
    assert not sent.believable


def test_answers_without_a_value_are_none() -> None:
    broken = Sensor(1)
    add_fault(broken, FaultKind.NAN)
    assert asked(broken, (1.0, WIND)) == []
    assert asked(Sensor(1), (1.0, ID)) == []


def test_one_sensor_of_the_line_is_well_and_the_others_are_not() -> None:
    line = SimulatedLine([Sensor(slave) for slave in SLAVES])
    ail(line)
    assert [slave for slave in SLAVES if not line.sensor(slave).faults] == [1]
