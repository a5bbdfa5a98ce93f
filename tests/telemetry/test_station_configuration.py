"""Another configuration: devices added, removed, renamed, disabled."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import cast

from lfs10d.reading import Exchanged, Purpose
from lfs10d.telemetry.publication import PublicationKind
from tests.support.stations import (
    LINE,
    LINE_TOPICS,
    ONE_VALUE,
    THIRD,
    TWO_VALUES,
    fields,
    good,
    instant,
    shown,
    station,
    topics,
)

# -- configuration ------------------------------------------------------------------------------------------------


def test_the_same_configuration_again_says_nothing() -> None:
    assert station().configure(LINE, [ONE_VALUE, TWO_VALUES], instant(1)) == []


def test_an_added_device_is_announced_with_all_its_topics() -> None:
    running = station()
    published = running.configure(LINE, [ONE_VALUE, TWO_VALUES, THIRD], instant(1))
    assert topics(published) == [
        "event",
        *(f"device/c/{leaf}" for leaf in ("state", "config", "availability", "error", "stats")),
        "devices",
    ]
    assert fields(published[0].payload, "type", "device", "slave") == ("device_added", "c", 4)
    assert published[0].kind is PublicationKind.EVENT
    assert fields(published[1].payload, "quality", "seq", "error") == ("bad", 0, "starting")


def test_of_a_removed_device_every_topic_is_cleared() -> None:
    running = station()
    published = running.configure(LINE, [ONE_VALUE], instant(1))
    cleared = {each.topic for each in published if each.payload is None}
    assert cleared == {f"device/b/{leaf}" for leaf in ("state", "config", "availability", "error", "stats", "wind")}
    assert all(each.retain for each in published if each.payload is None)
    (event,) = [each for each in published if each.topic == "event"]
    assert fields(event.payload, "type", "device", "slave") == ("device_removed", "b", 3)
    assert published[-1].payload == [ONE_VALUE.entry()]
    assert running.topics() == LINE_TOPICS | {
        f"device/a/{leaf}" for leaf in ("state", "config", "availability", "error", "stats")
    }


def test_a_renamed_device_is_one_removed_and_one_added() -> None:
    published = station().configure(LINE, [ONE_VALUE, replace(TWO_VALUES, name="fan")], instant(1))
    types = [fields(each.payload, "type")[0] for each in published if each.topic == "event"]
    assert types == ["device_removed", "device_added"]


def test_the_key_of_a_sample_is_not_used_twice_when_a_device_comes_back() -> None:
    running = station()
    running.on_event(good("a", 1), instant(1))
    running.on_event(good("a", 2), instant(2))
    running.configure(LINE, [TWO_VALUES], instant(3))
    running.configure(LINE, [TWO_VALUES, ONE_VALUE], instant(4))
    assert fields(shown(running, "device/a/state"), "seq") == (0,)
    assert fields(running.on_event(good("a", 5), instant(5))[0].payload, "seq") == (3,)


def test_a_changed_option_changes_config_and_list() -> None:
    running = station()
    slower = replace(ONE_VALUE, interval=5.0)
    published = running.configure(LINE, [slower, TWO_VALUES], instant(1))
    assert topics(published) == ["device/a/config", "devices"]


def test_a_changed_time_out_is_no_matter_of_the_list() -> None:
    published = station().configure(LINE, [replace(ONE_VALUE, response_timeout=0.5), TWO_VALUES], instant(1))
    assert topics(published) == ["device/a/config"]


def test_disabling_is_one_sample_and_then_none() -> None:
    running = station()
    running.on_event(good("a", 1), instant(1))
    published = running.configure(LINE, [replace(ONE_VALUE, enabled=False), TWO_VALUES], instant(2))
    assert topics(published) == [
        "device/a/config",
        "device/a/telemetry",
        "device/a/state",
        "device/a/availability",
        "devices",
    ]
    assert fields(published[1].payload, "error", "seq") == ("disabled", 2)
    assert running.on_event(good("a", 2.1), instant(2.1)) == []


def test_a_device_on_another_profile_starts_anew_but_for_its_numbers() -> None:
    running = station()
    running.on_event(good("a", 1), instant(1))
    turned = replace(ONE_VALUE, profile="ld-e", value_names=("displacement",), units={"displacement": "1"})
    published = running.configure(LINE, [turned, TWO_VALUES], instant(2))
    assert "event" not in topics(published)
    state = published[0].payload
    assert "wind_speed" not in cast("Mapping[str, object]", state)
    assert fields(state, "displacement", "seq") == (None, 0)
    answer = replace(good("a", 3), values={"displacement": 53493})
    assert fields(running.on_event(answer, instant(3))[0].payload, "seq", "displacement") == (2, 53493)


def test_another_rate_is_shown_and_its_gaps_are_measured_anew() -> None:
    running = station()
    running.on_event(Exchanged(1, 1, 1, 0.0037, 2, Purpose.POLL, None, b"", b""), instant(1))
    faster = replace(LINE, baudrate=19200, gap_required=0.0018229)
    assert topics(running.configure(faster, [ONE_VALUE, TWO_VALUES], instant(2))) == ["line/state"]
    stats = shown(running, "line/stats")
    assert fields(stats, "gap_required_us", "gap_us") == (1822.9, {"min": None, "p50": None, "p99": None})


def test_another_port_keeps_the_gaps() -> None:
    running = station()
    running.on_event(Exchanged(1, 1, 1, 0.0037, 2, Purpose.POLL, None, b"", b""), instant(1))
    moved = replace(LINE, port="/dev/ttyUSB1")
    assert topics(running.configure(moved, [ONE_VALUE, TWO_VALUES], instant(2))) == ["line/state"]
    assert fields(shown(running, "line/stats"), "gap_us") == ({"min": 3700.0, "p50": 3700.0, "p99": 3700.0},)


def test_another_pace_of_states_is_taken_up_by_a_reload() -> None:
    slow = replace(ONE_VALUE, state_every=600.0)
    running = station(slow)
    running.on_event(good("a", 1.0), instant(1.0))
    running.on_event(good("a", 2.0), instant(2.0))
    assert running.due() == 30.0
    running.configure(LINE, [replace(slow, state_every=5.0)], instant(3.0))
    assert running.due() == 8.0
    assert [each.topic for each in running.tick(instant(8.0))] == ["device/a/state"]


def test_a_state_that_a_burst_has_shown_meanwhile_is_not_published_again() -> None:
    slow = replace(ONE_VALUE, state_every=10.0)
    running = station(slow)
    running.on_event(good("a", 1.0), instant(1.0))
    running.on_event(good("a", 2.0), instant(2.0))
    assert running.due() == 11.0
    running.burst(instant(3.0))
    assert running.tick(instant(11.0)) == []
    assert running.due() == 30.0
