"""What the daemon says first in a life, and the first samples."""

from __future__ import annotations

import json
import signal
import time
from itertools import pairwise

from tests.support.brokers import Mosquitto
from tests.support.sites import Site, View, good

LINE_TOPICS = {"info", "devices", "line/state", "line/error", "line/stats"}
DEVICE_LEAVES = {"state", "config", "availability", "error", "stats", "wind"}
SAMPLE = {
    "v",
    "line",
    "device",
    "boot",
    "seq",
    "ts",
    "time",
    "clock",
    "wind_speed",
    "unit",
    "quality",
    "error",
    "rtt_ms",
}


def test_the_first_burst_says_that_nothing_is_known_and_ends_with_online(site: Site, view: View) -> None:
    site.line()
    site.write(slaves=[1, {"id": 2, "name": "mast-top", "label": "Mast, 10 m"}])

    site.run()
    view.wait("availability", "online".__eq__)

    burst = view.heard[: next(n for n, each in enumerate(view.heard) if each.topic.endswith("line0/availability")) + 1]
    topics = [each.topic.removeprefix("lfs10d/line0/") for each in burst]
    expected = LINE_TOPICS | {f"device/{name}/{leaf}" for name in ("slave-1", "mast-top") for leaf in DEVICE_LEAVES}
    assert set(topics) == expected | {"availability"}
    assert topics[-1] == "availability"
    assert all(each.retain for each in burst)
    assert {each.topic.rpartition("/")[2] for each in burst if each.qos == 0} == {"stats"}
    for name in ("slave-1", "mast-top"):
        state = view.history_of(f"device/{name}/state")[0]
        assert set(state) == SAMPLE
        assert (state["seq"], state["wind_speed"], state["quality"], state["error"]) == (0, None, "bad", "starting")
        assert view.history_of(f"device/{name}/availability")[0] == "offline"
        assert view.history_of(f"device/{name}/error")[0]["active"] is False
        assert view.history_of(f"device/{name}/error")[0]["last_code"] is None


def test_samples_follow_without_a_gap_each_as_the_sensor_sent_it(site: Site, view: View) -> None:
    served = site.line()
    site.write(poll={"interval": "50ms"})

    run = site.run()
    samples = view.wait_samples("slave-1", 30)
    view.wait("device/slave-1/state", good)
    view.wait("device/slave-1/availability", "online".__eq__)

    assert [one["seq"] for one in samples] == list(range(1, len(samples) + 1))
    assert all(set(one) == SAMPLE for one in samples)
    assert run.ends(signal.SIGTERM) == 0
    answers = [answer for each in served.line.log for answer in each.answers if answer.sensor.slave == 1]
    sent = [answer.values[0] for answer in answers if answer.values]
    published = [one["wind_speed"] for one in samples if good(one)]
    following = iter(sent)
    assert all(value in following for value in published), "in order, each once"
    # Where a busy machine made one late that one is not published, and its poll fails or begins anew with the id.
    unpublished = sent.index(published[-1]) + 1 - len(published)
    begun_anew = sum(each.frame.startswith(b"\x01\x03\x00\x05") for each in served.line.log)
    assert unpublished <= begun_anew + sum(not good(one) for one in samples)


def test_the_state_is_shown_at_most_once_a_second(site: Site, view: View) -> None:
    site.line()
    site.write(poll={"interval": "50ms"})

    site.run()
    view.wait_samples("slave-1", 60)

    clock = time.time() - time.monotonic()
    states = [
        (each.at + clock, json.loads(each.payload)) for each in view.listener.on(f"{view.base}/device/slave-1/state")
    ]
    shown = [(at, state["ts"] / 1000) for at, state in states if good(state)]
    assert 2 <= len(shown) <= shown[-1][0] - shown[0][0] + 2
    # Each was published between its sample and its arrival.
    assert all(arrived - measured >= 0.97 for (_, measured), (arrived, _) in pairwise(shown))


def test_what_was_retained_in_an_earlier_life_is_taken_back_before_anything_new(
    site: Site, mosquitto: Mosquitto, view: View
) -> None:
    site.line()
    site.write()
    first = site.run()
    view.wait("device/slave-1/state", good)
    first.process.kill()
    view.wait("availability", "offline".__eq__)
    view.clear()

    site.run()
    view.wait("device/slave-1/state", good)

    states = view.history_of("device/slave-1/state")
    assert (states[0]["seq"], states[0]["quality"], states[0]["error"]) == (0, "bad", "starting")
    assert not any(state["error"] == "starting" for state in states[1:])
    assert not any(error["active"] for error in view.history_of("device/slave-1/error"))
    assert view.history_of("device/slave-1/availability")[:2] == ["offline", "online"]
    boots = [view.newest("info")[key] for key in ("previous_boot", "boot")]
    assert boots == sorted(boots)
    assert boots[0] is not None
    assert mosquitto.retained("lfs10d/line0/availability") == {"lfs10d/line0/availability": b"online"}


def test_a_broker_that_comes_late_hears_first_that_nothing_was_known(site: Site, mosquitto: Mosquitto) -> None:
    mosquitto.stop()
    site.line()
    site.write()
    run = site.run()
    run.says("connection refused")
    run.ready()

    mosquitto.start()
    view = View(mosquitto.subscribe())
    view.wait("device/slave-1/state", good)

    assert view.history_of("device/slave-1/state")[0]["seq"] == 0
    assert view.history_of("device/slave-1/availability")[:2] == ["offline", "online"]
