"""Recorded values from a CSV file."""

from __future__ import annotations

import math
import subprocess
import sys
from pathlib import Path

import pytest

from lfs10d.errors import ConfigError
from lfs10d.simulator import recorded
from lfs10d.simulator.blueprint import LFS10, Blueprint
from lfs10d.simulator.builder import LinePlan, build
from lfs10d.simulator.memory import Memory
from lfs10d.simulator.recorded import RecordedValue, Recording, load_recording, parse_recording
from lfs10d.simulator.signals import READ_COILS, Signal
from lfs10d.simulator.wind import Unique
from lfs10d.simulator.wire import SECOND

DEVICES = {1: ["wind_speed"], 3: ["wind_speed", "wind_direction"]}
WIND = "time,wind_speed\n"


def read(text: str) -> Recording:
    return parse_recording(text, "w.csv", DEVICES)


def problems(text: str) -> list[str]:
    with pytest.raises(ConfigError) as caught:
        read(text)
    return str(caught.value).splitlines()


def played(text: str, *seconds: float, slave: int = 1, name: str = "wind_speed") -> list[float | None]:
    column = read(text).of_slave(slave)[name]
    return [column(round(each * SECOND)) for each in seconds]


def test_a_value_holds_until_the_next_row_and_the_last_as_long_as_the_one_before() -> None:
    text = f"{WIND}0,4.2\n10,5\n12.5,6.1\n"
    assert played(text, 0, 9.999, 10, 12.4, 12.5, 14.999, 15, 25) == [4.2, 4.2, 5, 5, 6.1, 6.1, 4.2, 5]


@pytest.mark.parametrize(
    "times",
    [
        ("2026-11-21T12:00:00Z", "2026-11-21T12:00:02.5Z"),
        ("2026-11-21 12:00:00+01:00", "2026-11-21 11:00:02.500+00:00"),
        ("2026-11-21 12:00:00", "2026-11-21 12:00:02.5"),
        ("1795298022.5", "1795298025"),
        ("-2.5", "0"),
    ],
)
def test_times_count_from_the_first_row_however_they_are_written(times: tuple[str, str]) -> None:
    assert played(f"{WIND}{times[0]},1\n{times[1]},2\n", 0, 2.4999, 2.5, 4.9999, 5) == [1, 1, 2, 2, 1]


def test_a_single_row_holds_for_ever() -> None:
    assert played(f"{WIND}7,4.5\n", 0, 0.5, 1, 3600) == [4.5] * 4


def test_times_that_differ_by_less_than_a_nanosecond_are_no_division_by_zero() -> None:
    assert played(f"{WIND}0,1\n0.0000000001,2\n", 0, 1) == [2, 2]


def test_an_empty_cell_is_a_time_without_a_value() -> None:
    assert played(f"{WIND}0,1\n1,\n2, \n3,4\n", 0, 1, 2, 3) == [1, None, None, 4]


def test_a_sensors_own_column_goes_before_the_one_for_all() -> None:
    recording = read("time,wind_speed,3.wind_speed,wind_direction\n0,1,2,350\n")
    assert {name: column(0) for name, column in recording.of_slave(1).items()} == {
        "wind_speed": 1,
        "wind_direction": 350,
    }
    assert {name: column(0) for name, column in recording.of_slave(3).items()} == {
        "wind_speed": 2,
        "wind_direction": 350,
    }


@pytest.mark.parametrize("delimiter", [",", ";", "\t", " , "])
def test_spreadsheets_write_it_in_their_ways(delimiter: str) -> None:
    text = '# exported\r\n"time","wind_speed"\r\n\r\n0,"4.2"\r\n"1",.5\r\n'.replace(".5", "5").replace(",", delimiter)
    assert played(text, 0, 1) == [4.2, 5]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("", ["1:1: is empty; the first line names the columns: time,wind_speed"]),
        ("\n# nothing\n", ["1:1: is empty; the first line names the columns: time,wind_speed"]),
        ("wind_speed\n1\n", ['1:1: the first column must be named time, not "wind_speed"']),
        ("time\n1\n", ["1:1: there is no column beside time; a value is a column: time,wind_speed"]),
        (WIND, ["1:1: there is no row below the names of the columns"]),
        ("time,Speed\n0,1\n", ['1:6: "Speed" names no value; write wind_speed or 3.wind_speed']),
        ("time,wind_speed,2.wind_speed\n0,1,1\n", ["1:17: slave 2 is not on this line; see --slaves"]),
        ("time,rain\n0,1\n", ["1:6: rain is no value of any sensor; known: wind_direction, wind_speed"]),
        ("time,1.wind_direction\n0,1\n", ["1:6: wind_direction is no value of slave 1; known: wind_speed"]),
        ("time,wind_speed, wind_speed\n0,1,1\n", ["1:18: wind_speed is there twice"]),
        (f"{WIND}0,1\n1,2,3\n", ["3:1: the row has 3 cells, the first line has 2"]),
        (f"{WIND}0,1\n0,2\n2,3\n", ['3:1: the time "0" is not after that of the row before']),
        (f"{WIND}noon,1\n", ['2:1: "noon" is no time; write it in seconds, or as 2026-11-21T12:00:00Z']),
        (f"{WIND},1\n", ['2:1: "" is no time; write it in seconds, or as 2026-11-21T12:00:00Z']),
        (f"{WIND}0,1\n2026-11-21T12:00,1\n", ['3:1: "2026-11-21T12:00" is no time; write it as in the first row']),
        (f"{WIND}0,1\n 1,x\n2,nan\n", ['3:4: "x" is no number; write 4.2, or nothing for no value',
                                      '4:3: "nan" is no number; write 4.2, or nothing for no value']),
        (f"{WIND}0,1e99\n", ['2:3: "1e99" is no number; write 4.2, or nothing for no value']),
        ("time;wind_speed\n0;4,2\n", ['2:3: "4,2" is no number; write 4.2, or nothing for no value']),
        ("time;wind_speed\r\n0;4.2\r\n1;x\r\n", ['3:3: "x" is no number; write 4.2, or nothing for no value']),
        (f"{WIND}0,1\r1,x\r", ['3:3: "x" is no number; write 4.2, or nothing for no value']),
        (f"{WIND}0,1\x0c\n1,2\u2028\n2,x\n", ['4:3: "x" is no number; write 4.2, or nothing for no value']),
        (f"{WIND}0,1\n1,calm\n2,inf\n2,3\n", ['3:3: "calm" is no number; write 4.2, or nothing for no value',
                                              '4:3: "inf" is no number; write 4.2, or nothing for no value',
                                              '5:1: the time "2" is not after that of the row before']),
        (f"{WIND}1795298022003,1\n",
         ['2:1: "1795298022003" is no time; write it in seconds, or as 2026-11-21T12:00:00Z']),
        (f"{WIND}0,1\n1e300,1\n", ['3:1: "1e300" is no time; write it as in the first row']),
        (f"{WIND}1926-01-01T00:00Z,1\n2026-11-21T12:00Z,1\n",
         ['3:1: the time "2026-11-21T12:00Z" is over 100 years after the first']),
        (f"{WIND}0,\x1b[31m\n", ['2:3: "\\u001b[31m" is no number; write 4.2, or nothing for no value']),
    ],
)  # fmt: skip
def test_every_error_has_its_place(text: str, expected: list[str]) -> None:
    assert problems(text) == [f"w.csv:{each}" for each in expected]


def test_a_file_of_another_kind_is_no_flood_of_errors() -> None:
    rows = "".join(f"{n},x\n" for n in range(1000))
    found = problems(WIND + rows)
    assert len(found) == recorded.MOST_PROBLEMS
    assert found[0].startswith("w.csv:2:3: ")


def test_a_file_is_read_with_and_without_byte_order_mark(tmp_path: Path) -> None:
    file = tmp_path / "w.csv"
    file.write_bytes(b"\xef\xbb\xbftime,wind_speed\n0,1\n")
    assert load_recording(file, DEVICES).of_slave(1)["wind_speed"](0) == 1


def test_a_file_that_cannot_be_read_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(ConfigError, match=r"none\.csv:1:1: cannot be read: No such file or directory"):
        load_recording(tmp_path / "none.csv", DEVICES)
    file = tmp_path / "w.csv"
    file.write_bytes(b"time,wind_speed\n0,1 \xb0\n")
    with pytest.raises(ConfigError, match=r"w\.csv:2:5: byte 0xb0 is not UTF-8; save the file as UTF-8"):
        load_recording(file, DEVICES)
    file.write_bytes(b"\xef\xbb\xbftime,wind_speed\n0,1 \xb0\n")
    with pytest.raises(ConfigError, match=r"w\.csv:2:5: byte 0xb0 is not UTF-8; save the file as UTF-8"):
        load_recording(file, DEVICES)
    file.write_bytes("time,wind_speed\n0,1\n".encode("utf-16"))
    with pytest.raises(ConfigError, match=r"w\.csv:1:1: byte 0xff is not UTF-8; save the file as UTF-8"):
        load_recording(file, DEVICES)
    with pytest.raises(ConfigError, match=r": cannot be read: Is a directory"):
        load_recording(tmp_path, DEVICES)
    monkeypatch.setattr(recorded, "LARGEST_FILE", 3)
    with pytest.raises(ConfigError, match=r"w\.csv:1:1: the file is too large"):
        load_recording(file, DEVICES)


def test_millions_of_rows_take_little_more_than_their_numbers(tmp_path: Path) -> None:
    file = tmp_path / "w.csv"
    file.write_text("time,wind_speed,wind_direction\n" + "".join(f"{n / 4},4.2,{n % 360}\n" for n in range(100_000)))
    program = (
        "import sys, resource; from pathlib import Path; from lfs10d.simulator.recorded import load_recording\n"
        "before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss\n"
        f"load_recording(Path({str(file)!r}), {{1: ['wind_speed', 'wind_direction']}})\n"
        "print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before)"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    kilobytes = int(done.stdout)
    assert kilobytes < 25_000  # the numbers are 2.4 MB, the file 2 MB; an object for each cell would be 80 MB


def test_the_sensors_of_a_line_play_it() -> None:
    recording = parse_recording("time,2.wind_speed\n0,12.34\n", "w.csv", {1: ["wind_speed"], 2: ["wind_speed"]})
    one, two = build(LinePlan((1, 2), recorded=recording)).sensors
    request = bytes.fromhex("03 00 01 00 02")
    replies = [sensor.hear(bytes((sensor.slave,)) + request, SECOND) for sensor in (one, two)]
    assert replies[1] is not None
    assert replies[1].measured == (("wind_speed", 12.34),)
    assert replies[0] is not None
    assert replies[0].measured != replies[1].measured


def test_a_time_without_a_value_reads_as_nan_and_what_is_out_of_range_as_it_is() -> None:
    column = RecordedValue((0, SECOND), (math.nan, 250.0), 2 * SECOND)
    memory = Memory(LFS10, {"wind_speed": column})
    request = bytes.fromhex("01 03 00 01 00 02")
    answer, measured = memory.read(request, "rtu", Unique(), 0, {})
    assert (answer[3:].hex(), measured) == ("ffffffff", (("wind_speed", None),))
    answer, measured = memory.read(request, "rtu", Unique(), SECOND, {})
    assert (answer[3:].hex(), measured) == ("437a0000", (("wind_speed", 250.0),))


def test_a_bit_without_a_value_stays_as_it_was() -> None:
    door = Blueprint("door", (Signal(0, "bool", name="open", function=READ_COILS),), functions=frozenset({READ_COILS}))
    memory = Memory(door, {"open": RecordedValue((0, SECOND), (1.0, math.nan), 2 * SECOND)})
    request = bytes.fromhex("01 01 00 00 00 01")
    assert memory.read(request, "rtu", Unique(), 0, {}) == (bytes.fromhex("01 01 01 01"), (("open", True),))
    assert memory.read(request, "rtu", Unique(), SECOND, {}) == (bytes.fromhex("01 01 01 01"), (("open", None),))
