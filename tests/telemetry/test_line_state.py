"""The state, error and statistics of the line."""

from __future__ import annotations

from dataclasses import replace

from lfs10d.reading import Exchanged, Fault, FaultCode, PortChanged, Purpose
from lfs10d.telemetry.line_state import PAUSED, POLLING, LineState
from lfs10d.telemetry.publication import BacklogStats
from tests.support.stations import LINE, LOCKED, LOST, fields, instant, topics


def line() -> LineState:
    return LineState(LINE, instant(0))


def test_a_line_begins_closed_polling_and_without_error() -> None:
    state, error = line().state(), line().error()
    assert (state.topic, state.retain, state.qos) == ("line/state", True, 1)
    assert fields(state.payload, "open", "activity", "requests") == (False, POLLING, "ok")
    assert fields(error.payload, "active", "code") == (False, None)
    assert not line().masked


def test_a_lost_port_masks_the_devices_and_is_counted() -> None:
    lost = line()
    assert topics(lost.on_port_changed(PortChanged(1, None), instant(1))) == ["line/state"]
    assert topics(lost.on_port_changed(PortChanged(2, LOST), instant(3))) == ["line/state", "line/error"]
    assert lost.masked
    assert fields(lost.error().payload, "code", "since") == ("port_lost", instant(2).ts())
    assert fields(lost.stats(instant(4), BacklogStats()).payload, "errors") == ({"port_lost": 1},)
    assert topics(lost.on_port_changed(PortChanged(5, None), instant(5))) == ["line/state", "line/error"]
    assert not lost.masked


def test_another_reason_changes_the_error_alone() -> None:
    lost = line()
    lost.on_port_changed(PortChanged(1, LOST), instant(1))
    assert lost.on_port_changed(PortChanged(2, LOST), instant(2)) == []
    assert topics(lost.on_port_changed(PortChanged(3, LOCKED), instant(3))) == ["line/error"]
    assert fields(lost.error().payload, "code") == ("port_busy",)


def test_a_fault_of_the_port_of_any_other_code_is_a_lost_port() -> None:
    lost = line()
    lost.on_port_changed(PortChanged(1, Fault(FaultCode.COLLISION, "odd")), instant(1))
    assert fields(lost.error().payload, "code") == ("port_lost",)


def test_a_pause_masks_the_devices_and_clears_the_error_of_the_port() -> None:
    paused = line()
    paused.on_port_changed(PortChanged(1, LOST), instant(1))
    assert topics(paused.on_activity(PAUSED, instant(2))) == ["line/state", "line/error"]
    assert paused.masked
    assert paused.on_activity(PAUSED, instant(3)) == []
    assert paused.on_port_changed(PortChanged(4, LOCKED), instant(4)) == []
    assert fields(paused.stats(instant(5), BacklogStats()).payload, "errors") == ({"port_lost": 1},)
    assert topics(paused.on_activity(POLLING, instant(6))) == ["line/state"]


def test_refused_requests_are_in_the_state() -> None:
    denied = line()
    assert denied.on_requests("ok") == []
    (state,) = denied.on_requests("denied")
    assert fields(state.payload, "requests") == ("denied",)


def test_another_gap_forgets_the_measured_ones() -> None:
    fast = line()
    fast.counters.exchanged(Exchanged(1, 1, 1, 0.0037, 2, Purpose.POLL, None, b"", b""))
    assert fast.reconfigure(LINE) == []
    assert fields(fast.stats(instant(2), BacklogStats()).payload, "gap_us") == (
        {"min": 3700.0, "p50": 3700.0, "p99": 3700.0},
    )
    assert topics(fast.reconfigure(replace(LINE, baudrate=19200, gap_required=0.0018))) == ["line/state"]
    stats = fast.stats(instant(2), BacklogStats(5, 3, 2))
    assert (stats.topic, stats.qos, stats.refresh) == ("line/stats", 0, True)
    assert fields(stats.payload, "gap_required_us", "gap_us", "store") == (
        1800.0,
        {"min": None, "p50": None, "p99": None},
        {"depth": 5, "oldest_ts": 3, "dropped": 2},
    )


def test_an_error_of_the_line_is_raised_once_and_cleared_once() -> None:
    full = line()
    assert topics(full.failed(FaultCode.STORAGE_FULL, "no space", 7)) == ["line/error"]
    assert full.failed(FaultCode.STORAGE_FULL, "no space", 8) == []
    assert topics(full.recovered(frozenset({FaultCode.STORAGE_FULL}), instant(9))) == ["line/error"]
    assert full.recovered(frozenset({FaultCode.STORAGE_FULL}), instant(10)) == []


def test_a_snapshot_holds_state_pace_and_error() -> None:
    snapshot = line().snapshot(instant(2))
    assert fields(snapshot, "name", "open", "load_pct") == ("line0", False, 0.0)
    assert fields(snapshot["error"], "active") == (False,)
