"""What troubles a whole line."""

from __future__ import annotations

from collections.abc import Callable

from lfs10d.simulator.burst import SECOND_MASTER
from lfs10d.simulator.faults import window
from lfs10d.simulator.line_faults import babble, second_master, stray
from lfs10d.simulator.sensor import Sensor
from lfs10d.simulator.wire import unseal
from tests.support.simulated import Bench

Maker = Callable[..., Bench]


def test_babble_fills_its_time_without_a_pause(bench: Maker) -> None:
    line = bench()
    babble(line.line, 2.0, 2.5)
    line.reach(2.5)
    assert len(line.listen(0.0)) in {479, 480}  # 500 ms at 1.04 ms each
    assert line.listen(5.0) == b""


def test_babble_without_an_end_goes_on(bench: Maker) -> None:
    line = bench()
    babble(line.line, 1.0)
    assert len(line.listen(10.0)) > 9000


def test_babble_can_come_again(bench: Maker) -> None:
    line = bench()
    babble(line.line, 2.0, 2.1, every=1.0)
    assert 180 < len(line.listen(2.5)) < 200


def test_in_babble_nobody_is_heard(bench: Maker) -> None:
    line = bench(Sensor(1))
    babble(line.line, 1.0, 2.0)
    line.listen(0.53)
    assert line.id_of(1) is None
    assert line.line.judge.counts["collision"] == 1
    line.reach(2.1)
    line.port.flush()
    assert line.id_of(1) == 1


def test_stray_bytes_come_between_request_and_answer(bench: Maker) -> None:
    line = bench(Sensor(1))
    stray(line.line, length=2, window=window(2.0))
    assert line.id_of(1) == 1
    line.reach(2.0)
    assert line.id_of(1) is None
    assert len(line.heard) == 9
    assert unseal(line.heard[2:]) is not None


def test_stray_bytes_come_after_their_share_of_the_requests(bench: Maker) -> None:
    line = bench(Sensor(1))
    stray(line.line, 0.25)
    clean = sum(line.id_of(1) == 1 for _ in range(200))
    assert 120 < clean < 180


def test_a_second_master_is_answered_and_heard_by_the_first(bench: Maker) -> None:
    line = bench(Sensor(1), Sensor(2))
    second_master(line.line, bytes.fromhex("020300050001"), 1.5, 1.0)
    heard = line.listen(3.0)
    assert len(heard) == 3 * (8 + 7)
    assert [request.speaker for request in line.line.log] == [SECOND_MASTER] * 3
    assert line.line.judge.counts.total() == 0


def test_a_second_master_falls_into_the_first(bench: Maker) -> None:
    line = bench(Sensor(1), Sensor(2))
    second_master(line.line, bytes.fromhex("020300050001"), 1.004, 10.0)
    assert line.id_of(1) is None
    assert line.line.judge.counts["struck"] == 1
    assert line.line.answered == 0
