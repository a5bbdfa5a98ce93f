"""Where the file and the place verified last differ the line is asked, and no value is published before."""

from __future__ import annotations

import pytest

from tests.support.lives import Bench, Life


def moved_and_edited(bench: Bench) -> Life:
    """Move s3 from 3 to 9 by request; then a person writes 7 into the file, and the daemon starts again."""
    life = bench.sensors(3, 4)
    bench.go(life, 3.0)
    assert bench.readdress(life, "s3", 9).status == "ok"
    bench.cut()
    bench.file.write_text(bench.file.read_text().replace("id: 3", "id: 7"))
    return bench.begin()


def spot(slave: int) -> dict[str, int]:
    return {"slave": slave, "baudrate": 9600}


@pytest.mark.parametrize("where", [7, 9])
def test_what_answers_is_used_and_both_are_told(bench: Bench, where: int) -> None:
    life = moved_and_edited(bench)
    bench.line.sensor(9).slave = where
    bench.go(life, 12.0)
    (told,) = life.told("change_conflict")
    assert told == {"device": "s3", "file": spot(7), "last": spot(9), "used": spot(where)}
    assert life.place("s3") == where
    good = [reading for reading in life.readings if reading.device == "s3" and reading.values]
    assert len(good) >= 5
    first = next(request for request in bench.line.log if request.body[:2] == bytes((where, 3)) and request.answers)
    assert first.body[2:4] == b"\x00\x05", "asked who it is before its first value"
    bench.cut()
    life = bench.begin()
    bench.go(life, 3.0)
    assert life.place("s3") == where
    assert not life.told("change_conflict"), "it is settled"


def test_the_files_place_goes_first(bench: Bench) -> None:
    life = moved_and_edited(bench)
    bench.go(life, 12.0)
    asked = [request.body[0] for request in bench.line.log if request.begun > bench.born]
    assert asked.index(7) < asked.index(9)


def test_where_nobody_answers_the_files_place_is_kept_and_both_are_asked_on(bench: Bench) -> None:
    life = moved_and_edited(bench)
    sensor = bench.line.sensor(9)
    sensor.powered = False
    bench.go(life, 20.0)
    (told,) = life.told("change_conflict")
    assert told["used"] is None
    assert life.place("s3") == 7
    assert {reading.fault is None for reading in life.readings if reading.device == "s3"} == {False}
    sensor.power_up()
    bench.go(life, 60.0)
    assert life.place("s3") == 9
    assert [each["used"] for each in life.told("change_conflict")] == [None, spot(9)]
    before = len(life.readings)
    bench.go(life, 10.0)
    assert len([each for each in life.readings[before:] if each.device == "s3" and each.values]) >= 8
