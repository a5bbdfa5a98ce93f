"""A whole line from a few words."""

from __future__ import annotations

from lfs10d.simulator.blueprint import Blueprint
from lfs10d.simulator.builder import LinePlan, build
from lfs10d.simulator.fault_file import parse_faults
from lfs10d.simulator.line import SimulatedLine
from lfs10d.simulator.signals import Signal
from lfs10d.simulator.wind import Unique
from lfs10d.simulator.wire import SECOND, Format, seal


def ask(line: SimulatedLine, body: str, now: int) -> None:
    line.transmit(seal(bytes.fromhex(body)), now, line.format)
    line.advance(now + SECOND)


def test_a_well_line_needs_no_file() -> None:
    line = build(LinePlan((1, 2, 255)))
    assert [sensor.slave for sensor in line.sensors] == [1, 2, 255]
    assert not any(sensor.faults for sensor in line.sensors)
    assert not line.keep_log


def test_sensors_have_winds_of_their_own_unless_values_shall_be_unique() -> None:
    sources = [sensor.source for sensor in build(LinePlan((1, 2))).sensors]
    assert sources[0](SECOND) != sources[1](SECOND)
    same = [sensor.source for sensor in build(LinePlan((1, 2), unique=True)).sensors]
    assert same[0] is same[1]
    assert isinstance(same[0], Unique)


def test_the_file_says_where_a_sensor_differs() -> None:
    text = "all: {fault: noisy, rate: 0.1}\nslaves: {2: {turnaround: 20ms, jitter: 1ms, baudrate: 19200, copies: 2}}"
    line = build(LinePlan((1, 2)), parse_faults(text, "f", (1, 2)))
    one, *two = line.sensors
    assert [sensor.slave for sensor in two] == [2, 2]
    assert {(sensor.turnaround, sensor.jitter, sensor.format) for sensor in two} == {(0.02, 0.001, Format(19200))}
    assert (one.turnaround, one.jitter, one.format) == (0.005, 0.0, Format())
    assert all(len(sensor.faults) == 1 for sensor in line.sensors)


def test_the_file_says_what_troubles_the_line() -> None:
    text = "line: {babble: [{after: 5s, for: 100ms}], noise: [{for: 3s, bytes: 2, delay: 0.5s}], second_master: \
[{slave: 1, every: 10s, after: 4s}]}"
    line = build(LinePlan((1,)), parse_faults(text, "f", (1,)), keep_log=True)
    ask(line, "01 03 00 05 00 01", 0)
    assert line.next_event() == 4 * SECOND
    line.advance(6 * SECOND)
    assert [request.speaker for request in line.log] == ["master", "second master"]
    assert line.log[1].body == bytes.fromhex("01 03 00 01 00 02")


def test_a_second_master_reads_what_the_device_measures() -> None:
    device = Blueprint("vane", (Signal(0x20, "uint16"),))
    text = "line: {second_master: [{slave: 1, every: 10s}]}"
    line = build(LinePlan((1,), blueprint=device), parse_faults(text, "f", (1,)), keep_log=True)
    line.advance(SECOND)
    assert line.log[0].body == bytes.fromhex("01 03 00 20 00 01")
