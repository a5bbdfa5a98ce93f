"""Without `changes.yaml` what the broker retained tells where to look; only the line tells where a sensor is."""

from __future__ import annotations

import json
from typing import Any

from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from lfs10d.config.changes import Place
from lfs10d.config.changes_file import FILE_NAME
from lfs10d.reconfiguration.locate import in_turn
from lfs10d.reconfiguration.restore import Restore
from lfs10d.simulator.sensor import Sensor
from lfs10d.simulator.wire import Format
from tests.support.lives import STATE, Bench, Life


def recalled(bench: Bench, life: Life, baudrate: int = 9600, **slaves: int) -> None:
    """Give a daemon what the broker retained, as at its first connect."""

    async def told() -> None:
        restore = Restore(
            running=lambda: life.running.now,
            learn=life.running.learn,
            devices=life.poller.scheduler.devices.values,
            announce=lambda kind, facts: life.events.append((kind, facts)),
        )
        payloads = {"line/state": json.dumps({"v": 1, "baudrate": baudrate}).encode()}
        payloads |= {f"device/{name}/config": json.dumps({"slave": at}).encode() for name, at in slaves.items()}
        assert payloads.keys() <= restore.topics
        await restore.on_retained(payloads)

    bench.ask(life, told())  # type: ignore[arg-type]  # it answers nothing


def moved(bench: Bench, *slaves: int, **to: int) -> Life:
    """Sensors that a daemon has moved whose changes are lost: `s3=9` is the one that the file has at 3."""
    life = bench.sensors(*slaves)
    sensors = {name: bench.line.sensor(int(name[1:])) for name in to}
    for name, slave in to.items():
        put(sensors[name], slave)
    return life


def put(sensor: Sensor, slave: int) -> None:
    sensor.slave = sensor.words[5] = slave


def spot(slave: int, baudrate: int = 9600) -> dict[str, int]:
    return {"slave": slave, "baudrate": baudrate}


def good_since(bench: Bench, life: Life, device: str, seconds: float = 10.0) -> int:
    before = len(life.readings)
    bench.go(life, seconds)
    return sum(reading.device == device and reading.values is not None for reading in life.readings[before:])


def conflicts(life: Life) -> list[dict[str, Any]]:
    return [dict(each) for each in life.told("change_conflict")]


def test_a_sensor_silent_at_the_files_place_is_found_where_it_was_and_that_is_kept(bench: Bench) -> None:
    life = moved(bench, 3, 4, s3=9)
    bench.go(life, 5.0)
    recalled(bench, life, s3=9, s4=4)
    bench.go(life, 10.0)
    assert conflicts(life) == [{"device": "s3", "file": spot(3), "last": spot(9), "used": spot(9)}]
    assert (life.place("s3"), good_since(bench, life, "s3") >= 8) == (9, True)
    bench.cut()
    life = bench.begin()
    assert life.place("s3") == 9
    assert not life.running.missing


def test_a_sensor_that_answers_at_the_files_place_is_polled_on_without_a_pause(bench: Bench) -> None:
    life = moved(bench, 3, 4)
    bench.go(life, 5.0)
    recalled(bench, life, s3=9, s4=4)
    assert good_since(bench, life, "s3") >= 9
    assert conflicts(life) == [{"device": "s3", "file": spot(3), "last": spot(9), "used": spot(3)}]
    assert not any(request.body[0] == 9 for request in bench.line.log), "only who is silent is looked for elsewhere"
    assert STATE / FILE_NAME not in bench.files.kept


def test_what_was_retained_outlives_a_power_cut_before_the_sensor_is_back(bench: Bench) -> None:
    life = moved(bench, 3, 4, s3=9)
    sensor = bench.line.sensor(9)
    sensor.powered = False
    recalled(bench, life, s3=9, s4=4)
    bench.go(life, 20.0)
    assert [each["used"] for each in conflicts(life)] == [None]
    bench.cut()
    life = bench.begin()
    bench.go(life, 20.0)
    sensor.power_up()
    bench.go(life, 40.0)
    assert life.place("s3") == 9
    assert conflicts(life)[-1]["used"] == spot(9)


def test_the_rate_of_the_line_is_found_again(bench: Bench) -> None:
    life = bench.sensors(3, 4, 5)
    for slave in (3, 4, 5):
        sensor = bench.line.sensor(slave)
        sensor.format, sensor.words[4] = Format(19200), 2
    bench.go(life, 5.0)
    recalled(bench, life, 19200, s3=3, s4=4, s5=5)
    bench.go(life, 20.0)
    assert life.running.now.config.line.baudrate == 19200
    assert [each["used"]["baudrate"] for each in conflicts(life)] == [19200]
    assert all(good_since(bench, life, name) >= 8 for name in ("s3", "s4", "s5"))
    bench.cut()
    assert bench.begin().running.now.config.line.baudrate == 19200


def test_an_id_that_was_handed_on_keeps_its_name(bench: Bench) -> None:
    """s2 went to 9, then s3 to 2: who answers at 2 is not s2, whatever the file says."""
    life = moved(bench, 2, 3, s2=9, s3=2)
    recalled(bench, life, s2=9, s3=2)
    begun = len(life.readings)
    bench.go(life, 20.0)
    assert (life.place("s2"), life.place("s3")) == (9, 2)
    assert not life.running.now.conflicts
    values = [reading for reading in life.readings[begun:] if reading.device == "s2" and reading.values]
    assert len(values) >= 8
    asked = [request.body[0] for request in bench.line.log if request.begun > 1_000_000_000 and request.answers]
    assert {2, 9} <= set(asked)


def test_a_newcomer_at_an_id_where_another_was_verified_yields(bench: Bench) -> None:
    life = moved(bench, 3, 4, s3=9)
    bench.cut()
    bench.file.write_text(bench.file.read_text().replace("slaves: [", "slaves: [{id: 9, name: new}, "))
    life = bench.begin()
    recalled(bench, life, s3=9, s4=4)
    bench.go(life, 15.0)
    assert life.place("s3") == 9
    assert list(life.running.now.conflicts) == ["new"]
    before = len(life.readings)
    bench.go(life, 5.0)
    assert not any(reading.device == "new" for reading in life.readings[before:])


def test_a_disk_that_keeps_nothing_does_not_hide_a_sensor(bench: Bench) -> None:
    life = moved(bench, 3, 4, s3=9)
    bench.files.full = 0
    recalled(bench, life, s3=9, s4=4)
    bench.go(life, 10.0)
    assert life.place("s3") == 9
    assert any(news.storage is not None for news in life.news)


@settings(
    max_examples=25, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow]
)
@given(
    where=st.permutations([2, 3, 4, 8, 9]).map(lambda ids: ids[:3]),
    told=st.lists(st.integers(1, 10), min_size=3, max_size=3),
    before=st.sampled_from([0.0, 5.0]),
)
def test_whatever_is_retained_no_two_devices_share_an_id_and_what_answers_nowhere_is_offline(
    bench: Bench, where: list[int], told: list[int], before: float
) -> None:
    bench.renew()
    life = bench.sensors(2, 3, 4)
    for sensor, at in zip([bench.line.sensor(each) for each in (2, 3, 4)], where, strict=True):
        put(sensor, at)
    bench.go(life, before)
    recalled(bench, life, s2=told[0], s3=told[1], s4=told[2])
    bench.go(life, 40.0)
    polled = [slave.id for slave in life.running.now.polled.slaves]
    assert len(set(polled)) == len(polled)
    since = len(life.readings)
    bench.go(life, 5.0)
    for slave in life.running.now.polled.slaves:
        heard = any(each.values is not None for each in life.readings[since:] if each.device == slave.name)
        assert heard is (slave.id in where)


def test_who_may_be_where_another_was_waits_for_that_one() -> None:
    waiting = {"a": (Place(2), Place(9)), "b": (Place(3), Place(2)), "c": (Place(5), Place(6))}
    assert in_turn(waiting) == {"b", "c"}


def test_where_each_waits_for_another_all_are_asked() -> None:
    assert in_turn({"a": (Place(2), Place(3)), "b": (Place(3), Place(2))}) == {"a", "b"}
    assert in_turn({}) == frozenset()
