"""Who answers after the port was opened is one line of the log."""

from __future__ import annotations

import logging

from lfs10d.reading import Fault, FaultCode, Reading
from lfs10d.telemetry.start_report import NAMED, WITHIN, StartReport


def reading(device: str, code: FaultCode | None = None, *, online: bool = False) -> Reading:
    fault = None if code is None else Fault(code, "why")
    return Reading(device, 1.0, None if fault else {"a": 1.0}, fault, None, online or fault is None, 0.2)


def test_it_is_due_when_each_has_answered_or_failed_three_times() -> None:
    report = StartReport()
    assert report.entry(0.0) is None
    report.on_port_open(["a", "b", "c", "d"], 100.0)
    for device, code in (("a", None), ("b", FaultCode.TIMEOUT), ("c", FaultCode.CRC), ("x", None)):
        report.on_reading(reading(device, code))
    report.on_reading(reading("d", FaultCode.EXCEPTION, online=True))
    for _ in range(2):
        assert report.entry(101.0) is None
        report.on_reading(reading("b", FaultCode.TIMEOUT))
        report.on_reading(reading("c", FaultCode.CRC))
    text = "2 of 4 devices answer; silent: b; answering badly: c (crc)"
    assert report.entry(101.0) == (logging.WARNING, text)
    assert report.entry(200.0) is None
    report.on_reading(reading("b"))
    assert report.entry(300.0) is None


def test_where_all_answer_it_is_no_warning() -> None:
    report = StartReport()
    report.on_port_open(["a", "b"], 0.0)
    report.on_reading(reading("a", FaultCode.TIMEOUT))
    report.on_reading(reading("a"))
    assert report.entry(0.1) is None
    report.on_reading(reading("b"))
    assert report.entry(0.2) == (logging.INFO, "2 of 2 devices answer")


def test_it_comes_within_ten_seconds_also_where_not_all_were_asked() -> None:
    report = StartReport()
    report.on_port_open((str(number) for number in range(40)), 5.0)
    report.on_reading(reading("0"))
    report.on_reading(reading("1", FaultCode.CRC))
    report.on_reading(reading("1", FaultCode.TIMEOUT))
    assert report.due == 5.0 + WITHIN < 15.0
    assert report.entry(report.due - 0.1) is None
    entry = report.entry(report.due)
    assert entry is not None
    assert entry.text.startswith("1 of 40 devices answer; silent: 1, 2, 3, ")
    assert entry.text.endswith(f", {NAMED} and 7 more")


def test_a_lost_port_is_no_silence_of_the_devices() -> None:
    report = StartReport()
    report.on_port_open(["a"], 0.0)
    for _ in range(3):
        report.on_reading(reading("a", FaultCode.PORT_LOST))
    assert report.entry(1.0) is None
    report.on_port_lost()
    assert report.entry(100.0) is None


def test_with_nobody_to_poll_there_is_nothing_to_report() -> None:
    report = StartReport()
    report.on_port_open([], 0.0)
    assert report.entry(100.0) is None
