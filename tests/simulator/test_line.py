"""The wire: who hears what, what is logged, power, duplicates, other rates."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from lfs10d.simulator.line import SimulatedLine
from lfs10d.simulator.sensor import Sensor
from lfs10d.simulator.wire import Format
from tests.support.faulty_sensors import add_fault, believable
from tests.support.simulated import Bench

Maker = Callable[..., Bench]

ID = 5


def test_the_log_tells_every_request_and_its_answers(bench: Maker) -> None:
    line = bench(Sensor(1))
    line.read(1)
    line.read(9)
    first, second = line.line.log
    assert (first.body, second.body) == (bytes.fromhex("010300010002"), bytes.fromhex("090300010002"))
    assert (len(first.answers), len(second.answers)) == (1, 0)
    assert first.begun == 1_000_000_000
    assert second.gap == second.begun - first.answers[0].burst.ends[-1]
    assert line.line.answered == 1


def test_without_a_log_nothing_is_kept() -> None:
    line = SimulatedLine([Sensor(1)], keep_log=False)
    line.transmit(b"\x01\x03", 0, line.format)
    line.advance(10**9)
    line.transmit(bytes.fromhex("01030001000295cb"), 10**9, line.format)
    line.advance(2 * 10**9)
    assert line.log == []
    assert (line.judge.counts["malformed"], line.answered) == (1, 1)


def test_a_sensor_keeps_a_source_of_its_own() -> None:
    def always(now: int) -> float:
        return 1.5 + 0 * now

    own = Sensor(1, source=always)
    line = SimulatedLine([own, Sensor(2), Sensor(3)])
    assert own.source is always
    assert line.sensor(2).source is line.sensor(3).source


def test_nobody_at_an_id_is_a_key_error() -> None:
    with pytest.raises(KeyError):
        SimulatedLine().sensor(1)


def test_a_sensor_at_another_rate_is_never_understood_and_never_understands(bench: Maker) -> None:
    line = bench(Sensor(1, format=Format(19200)), Sensor(2))
    assert line.id_of(1) is None
    assert line.heard == b""
    assert line.id_of(2) == 2


def test_a_broken_request_upsets_nobody_at_another_rate(bench: Maker) -> None:
    line = bench(Sensor(1), Sensor(2, format=Format(19200)))
    for sensor in line.line.sensors:
        add_fault(sensor, "hangs")
    line.port.write(b"\x01\x03")
    line.listen(0.1)
    assert [sensor.hung for sensor in line.line.sensors] == [True, False]


def test_a_sensor_of_another_framing_hears_nothing(bench: Maker) -> None:
    line = bench(Sensor(1, framing="ascii"))
    assert line.id_of(1) is None


def test_duplicates_that_answer_alike_cannot_be_told_apart(bench: Maker) -> None:
    line = bench(Sensor(1), Sensor(1))
    assert line.id_of(1) == 1
    assert line.line.answered == 2


def test_duplicates_with_different_answers_garble_each_other(bench: Maker) -> None:
    line = bench(Sensor(1), Sensor(1))
    assert line.read(1) is None
    assert len(line.heard) == 9
    assert not believable(line.answer)


def test_duplicates_of_which_one_is_slower_garble_each_other(bench: Maker) -> None:
    line = bench(Sensor(1), Sensor(1, turnaround=0.008))
    assert line.id_of(1) is None
    assert len(line.heard) > 7


def test_a_power_cut_ends_an_answer_under_way(bench: Maker) -> None:
    line = bench(Sensor(1), Sensor(2))
    line.line.at(1.018, lambda now: line.line.power_cut(now / 1e9))
    assert line.id_of(1) is None
    assert 0 < len(line.heard) < 7
    line.line.power_up()
    assert line.id_of(1) == 1


def test_the_power_of_one_sensor_can_be_cut_before_it_answers(bench: Maker) -> None:
    line = bench(Sensor(1), Sensor(2))
    one = line.line.sensor(1)
    line.line.at(1.010, lambda now: line.line.power_cut(now / 1e9, [one]))
    assert line.id_of(1) is None
    assert line.heard == b""
    assert line.id_of(2) == 2
    line.line.power_up([one])
    assert line.id_of(1) == 1


def test_actions_happen_in_the_order_of_their_times() -> None:
    line = SimulatedLine()
    done: list[float] = []
    for when in (3.0, 1.0, 2.0):
        line.at(when, lambda now: done.append(now / 1e9))
    assert line.next_event() == 1_000_000_000
    line.advance(2_500_000_000)
    assert done == [1.0, 2.0]
    assert line.now == 2_500_000_000


def test_an_id_of_another_check_is_not_heard(bench: Maker) -> None:
    line = bench(Sensor(1))
    line.port.write(bytes.fromhex("010300010002") + b"\x00\x07")  # a right sum, but the sensor wants a CRC
    assert line.listen(0.1) == b""
    assert line.line.judge.counts["heard"] == 1


def test_a_late_handover_moves_the_end_of_the_last_byte() -> None:
    line = SimulatedLine([Sensor(1)])
    request = bytes.fromhex("01030001000295cb")
    line.transmit(request, 0, line.format)
    line.advance(50_000_000)
    line.handed_over(40_000_000)
    line.transmit(request, 42_000_000, line.format)
    line.advance(90_000_000)
    assert line.log[1].gap == 2_000_000
    assert line.judge.counts["gap"] == 1


def test_bytes_of_a_master_wholly_within_babble_are_lost() -> None:
    line = SimulatedLine([Sensor(1)])
    line.speak("noise", bytes(40), 0)
    line.transmit(bytes.fromhex("01030001000295cb"), 5_000_000, line.format)
    line.advance(10**9)
    assert line.judge.counts["collision"] == 1
    assert line.answered == 0


def test_a_master_that_changes_its_rate_under_its_bytes_spoils_them() -> None:
    line = SimulatedLine([Sensor(1)])
    line.strike(0)
    line.transmit(bytes.fromhex("01030001000295cb"), 0, line.format)
    line.strike(4_000_000)
    line.advance(10**9)
    assert line.judge.counts["struck"] == 1


def test_only_heard_requests_reach_the_troubles() -> None:
    line = SimulatedLine([Sensor(1)])
    seen: list[bytes] = []
    line.after_each_request(lambda request: seen.append(request.body))
    end = line.transmit(bytes.fromhex("01030001000295cb"), 0, line.format)
    line.transmit(bytes.fromhex("01030001000295cb"), end + 1000, line.format)
    line.advance(10**9)
    assert seen == [bytes.fromhex("010300010002")]
