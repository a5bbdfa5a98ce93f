"""The port is lost, paused or back: one error of the line, none of its devices."""

from __future__ import annotations

from lfs10d.reading import PortChanged
from tests.support.stations import (
    LOCKED,
    LOST,
    TIMEOUT,
    WALL,
    ail,
    failed,
    fields,
    instant,
    shown,
    station,
    topics,
)

# -- the port -----------------------------------------------------------------------------------------------------


def test_an_opened_port_is_shown_and_no_error() -> None:
    running = station()
    assert topics(running.on_event(PortChanged(1, None), instant(1))) == ["line/state"]
    assert fields(shown(running, "line/state"), "open") == (True,)


def test_a_lost_port_is_one_error_of_the_line_at_once() -> None:
    running = station()
    running.on_event(PortChanged(1, None), instant(1))
    assert topics(running.on_event(PortChanged(2, LOST), instant(2))) == ["line/state", "line/error"]
    assert fields(shown(running, "line/error"), "code", "message", "since") == (
        "port_lost",
        "absent: plug it in",
        round((WALL + 2) * 1000),
    )
    assert fields(shown(running, "line/stats"), "errors") == ({"port_lost": 1},)


def test_another_fault_of_the_port_changes_the_error() -> None:
    running = station()
    running.on_event(PortChanged(1, LOST), instant(1))
    assert topics(running.on_event(PortChanged(2, LOCKED), instant(2))) == ["line/error"]
    assert fields(shown(running, "line/error"), "code", "also") == ("port_busy", [])


def test_the_same_fault_of_the_port_again_is_nothing_new() -> None:
    running = station()
    running.on_event(PortChanged(1, LOST), instant(1))
    assert running.on_event(PortChanged(2, LOST), instant(2)) == []


def test_when_every_device_ails_and_the_port_goes_one_error_is_left() -> None:
    running = station()
    assert "device/a/error" in ail(running, "a")
    assert "device/b/error" in ail(running, "b")
    published = running.on_event(PortChanged(3, LOST), instant(3))
    assert topics(published) == ["line/error", "device/a/error", "device/b/error"]
    for device in ("a", "b"):
        running.on_event(failed(device, 3, LOST), instant(3))
        assert fields(shown(running, f"device/{device}/error"), "active", "last_code") == (False, "timeout")
        assert fields(shown(running, f"device/{device}/state"), "error") == ("port_lost",)
    assert fields(shown(running, "line/error"), "active") == (True,)


def test_the_loss_of_the_port_is_no_poll_and_one_loss_for_the_line() -> None:
    running = station()
    running.on_event(PortChanged(1, LOST), instant(1))
    for device in ("a", "b"):
        running.on_event(failed(device, 1, LOST), instant(1))
    assert fields(shown(running, "line/stats", 10), "errors", "polls_per_s") == ({"port_lost": 1}, 0.0)
    assert fields(shown(running, "device/a/stats"), "polls", "errors") == (0, {"port_lost": 1})


def test_when_the_port_is_back_the_line_is_fine_and_devices_ail_by_the_same_rule() -> None:
    running = station()
    ail(running)
    running.on_event(PortChanged(3, LOST), instant(3))
    running.on_event(failed("a", 3, LOST), instant(3))
    assert topics(running.on_event(PortChanged(4, None), instant(4))) == ["line/state", "line/error"]
    assert fields(shown(running, "line/error"), "active", "last_code") == (False, "port_lost")
    assert "device/a/error" not in topics(running.on_event(failed("a", 5, TIMEOUT), instant(5)))
    assert "device/a/error" in topics(running.on_event(failed("a", 6, TIMEOUT), instant(6)))


def test_a_pause_is_a_lost_port_without_an_error() -> None:
    running = station()
    running.on_event(PortChanged(0, None), instant(0))
    ail(running)
    assert topics(running.on_activity("paused", instant(2))) == ["line/state", "device/a/error"]
    assert topics(running.on_event(PortChanged(2, LOST), instant(2))) == ["line/state"]
    running.on_event(failed("a", 2, LOST), instant(2))
    assert fields(shown(running, "line/error"), "active") == (False,)
    assert fields(shown(running, "line/stats"), "errors") == ({"timeout": 2},)
    assert topics(running.on_activity("polling", instant(9))) == ["line/state"]
    assert topics(running.on_event(PortChanged(9, None), instant(9))) == ["line/state"]


def test_a_pause_takes_an_error_of_the_port_back() -> None:
    running = station()
    running.on_event(PortChanged(1, LOCKED), instant(1))
    assert topics(running.on_activity("paused", instant(2))) == ["line/state", "line/error"]


def test_while_the_port_is_lost_no_failure_is_held_against_a_device() -> None:
    running = station()
    running.on_event(PortChanged(0, LOST), instant(0))
    assert "device/a/error" not in ail(running, since=1)
    assert fields(shown(running, "device/a/error"), "active") == (False,)
