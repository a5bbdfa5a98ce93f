"""SIGHUP and `config/reload`: what changed is applied, what did not is not disturbed."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from dataclasses import replace
from importlib.resources import files
from pathlib import Path
from statistics import median
from typing import Any

import pytest

from lfs10d.simulator.line import SimulatedLine
from tests.support.brokers import Mosquitto
from tests.support.sites import Site, View, eventually, good, tell

INTERVAL = 200
"""ms between two polls of a device, unless a test says otherwise."""


def phase(samples: list[dict[str, Any]], origin: int) -> float:
    """Return where between two points of the grid that has one at `origin` the samples lie, ms; 100 is on it."""
    return median(float((one["ts"] - origin + INTERVAL / 2) % INTERVAL) for one in samples)


def test_slaves_come_go_and_change_and_the_others_keep_their_grid_and_numbers(
    site: Site, mosquitto: Mosquitto, view: View
) -> None:
    site.line((1, 2, 3))
    site.write(slaves=[1, 2, {"id": 3, "name": "mast", "label": "old"}])
    run = site.run()
    view.wait_samples("slave-1", 12)
    view.wait_samples("mast", 3)
    hashed = view.newest("info")["config_hash"]
    mosquitto.publish("lfs10d/line0/device/forgotten/state", "{}", retain=True)

    site.write(slaves=[1, {"id": 3, "name": "mast", "label": "new"}, {"id": 2, "name": "roof"}])
    run.reload()
    changed = view.samples("slave-1")[-1]["seq"]
    view.wait_samples("roof", 1, good)
    samples = view.wait_samples("slave-1", changed + 12)

    assert "reloaded: slaves.mast.label, slaves.roof, slaves.slave-2" in run.log
    assert [one["seq"] for one in samples] == list(range(1, len(samples) + 1))
    origin = samples[0]["ts"]
    assert abs(phase(samples[changed + 2 :], origin) - phase(samples[:changed], origin)) < INTERVAL / 4
    assert view.newest("device/mast/config")["label"] == "new"
    assert [one["seq"] for one in view.samples("mast")][:4] == [1, 2, 3, 4]
    eventually(lambda: not mosquitto.retained("lfs10d/line0/device/slave-2/#"), "slave-2 is cleared")
    eventually(lambda: not mosquitto.retained("lfs10d/line0/device/forgotten/#"), "an orphan is cleared")
    assert [one["name"] for one in view.newest("devices")] == ["slave-1", "mast", "roof"]
    assert view.wait("info")["config_hash"] != hashed
    events = [(event["type"], event["device"]) for event in view.history_of("event")]
    assert events == [("device_removed", "slave-2"), ("device_added", "roof")]


def test_how_is_polled_logged_and_obeyed_changes(site: Site, view: View) -> None:
    site.line()
    site.write()
    run = site.run()
    view.wait_samples("slave-1", 3)
    assert " debug " not in run.log

    site.write(
        poll={"interval": "50ms", "offline_after": 1, "retries": 0},
        slaves=[1, {"id": 2, "enabled": False}],
        log={"level": "debug"},
        commands=[],
    )
    run.reload()

    run.says(" debug slave 1: sent 01 03 00 01 00 02")
    assert view.wait("device/slave-1/config", lambda config: config["interval"] == 0.05)
    state = view.wait("device/slave-2/state", lambda state: state["error"] == "disabled")
    assert (state["quality"], state["wind_speed"]) == ("bad", None)
    assert view.newest("device/slave-2/error")["active"] is False
    disabled = state["seq"]
    begun = view.samples("slave-1")[-1]
    last = view.wait_samples("slave-1", begun["seq"] + 20)[-1]
    assert (last["ts"] - begun["ts"]) / (last["seq"] - begun["seq"]) < INTERVAL / 2
    assert view.samples("slave-2")[-1]["seq"] == disabled
    view.listener.publish("lfs10d/line0/request/config/reload", "{}")
    answer = view.wait("response/config/reload")
    assert (answer["status"], answer["error"]["code"]) == ("rejected", "not_allowed")

    site.write(log={"level": "info"})
    run.reload()
    view.wait("device/slave-2/state", good)
    log = len(run.log)
    view.wait_samples("slave-1", 3, lambda one: one["seq"] > last["seq"] + 5)
    assert " debug " not in run.log[log:]


def test_the_line_changes_its_rate_and_its_gap(site: Site, view: View) -> None:
    served = site.line()
    site.write(poll={"interval": "50ms"})
    run = site.run()
    view.wait_samples("slave-1", 5, good)

    def faster(line: SimulatedLine) -> None:
        for sensor in line.sensors:
            sensor.format = replace(sensor.format, baudrate=9600)

    tell(served, faster)
    site.write(
        line={"baudrate": 9600, "extra_gap": "15ms", "echo": "off", "turnaround_delay": "200ms", "low_latency": False},
        poll={"interval": "50ms"},
    )
    run.reload()
    known = view.samples("slave-1")[-1]["seq"]
    view.wait_samples("slave-1", 3, lambda one: good(one) and one["seq"] > known)
    assert view.newest("line/state")["baudrate"] == 9600

    tell(served, lambda line: setattr(line.judge, "min_gap", None))
    known = view.samples("slave-1")[-1]["seq"]
    view.wait_samples("slave-1", 10, lambda one: good(one) and one["seq"] > known)
    assert served.line.judge.min_gap is not None
    assert served.line.judge.min_gap >= (3.5 * 10 / 9600 + 0.015) * 1e9
    assert "line.baudrate" in run.log
    assert "line.extra_gap" in run.log


@pytest.fixture
def other(tmp_path: Path, mosquitto: Mosquitto) -> Iterator[Mosquitto]:
    """Give a second broker."""
    folder = tmp_path / "other"
    folder.mkdir()
    made = Mosquitto(mosquitto.executable, folder)
    made.start()
    yield made
    made.close()


def test_another_broker_takes_over_and_the_old_one_is_told_good_bye(
    site: Site, mosquitto: Mosquitto, view: View, other: Mosquitto
) -> None:
    site.line()
    site.write()
    run = site.run()
    view.wait_samples("slave-1", 3)
    elsewhere = View(other.subscribe())

    site.write(mqtt={"port": other.port, "client_id": "another"})
    run.reload()
    elsewhere.wait("availability", "online".__eq__)
    elsewhere.wait_samples("slave-1", 3)

    view.wait("availability", "offline".__eq__)
    assert b"online" not in mosquitto.retained("lfs10d/line0/availability").values()
    assert len(other.retained("lfs10d/line0/#")) == 5 + 2 * 6 + 1
    assert "as another (" in other.log
    assert "reloaded: mqtt.port, mqtt.client_id" in run.log
    numbers = sorted({one["seq"] for here in (view, elsewhere) for one in here.samples("slave-1")})
    assert numbers == list(range(1, len(numbers) + 1))


def test_what_the_topics_hang_on_waits_for_a_restart(site: Site, view: View) -> None:
    site.write(slaves=[])
    run = site.run()
    view.wait("availability", "online".__eq__)

    site.write(line={"name": "other"}, mqtt={"base_topic": "elsewhere"}, commands=["polling"], slaves=[7])
    view.listener.publish("lfs10d/line0/request/config/reload", "{}")
    answer = view.wait("response/config/reload")

    assert answer["status"] == "ok"
    assert answer["data"]["restart_required"] == ["line.name", "mqtt.base_topic"]
    assert answer["data"]["applied"] == ["commands", "slaves.slave-7"]
    run.reload()
    run.says("takes effect at the next restart only: line.name, mqtt.base_topic")
    assert view.newest("device/slave-7/config")
    assert not [each.topic for each in view.listener.heard if each.topic.startswith("elsewhere")]


def test_a_broken_file_changes_nothing_and_every_error_is_told(site: Site, view: View) -> None:
    site.line()
    site.write()
    run = site.run()
    view.wait_samples("slave-1", 3)

    site.write(poll={"interval": "soon"}, slaves=[1, 2, 300])
    run.reload()
    known = view.samples("slave-1")[-1]["seq"]
    view.wait_samples("slave-1", known + 5)

    run.says("the configuration is not reloaded: the running one stays")
    assert f"error {site.file}:" in run.log
    assert "poll.interval" in run.log
    assert "slaves[2].id" in run.log or "slaves[2]" in run.log
    view.listener.publish("lfs10d/line0/request/config/reload", "{}")
    answer = view.wait("response/config/reload")
    assert (answer["status"], answer["error"]["code"]) == ("rejected", "invalid_param")
    assert str(site.file) in answer["error"]["message"]

    site.write(slaves=[1])
    run.reload()
    assert [one["name"] for one in view.wait("devices", lambda found: len(found) == 1)] == ["slave-1"]


def test_a_profile_file_that_changed_is_taken_up(site: Site, view: View) -> None:
    profile = site.folder / "vane.yaml"

    def write(unit: str) -> None:
        text = (files("lfs10d.profiles") / "lfs10.yaml").read_text()
        profile.write_text(text.replace("unit: m/s", f"unit: {unit}"))

    write("m/s")
    site.line()
    site.write(slaves=[{"id": 1, "profile": "vane.yaml"}])
    run = site.run()
    view.wait("device/slave-1/state", good)

    write("kn")
    run.reload()

    assert view.wait("device/slave-1/state", lambda state: good(state) and state["unit"] == "kn")
    assert "reloaded: slaves.slave-1.profile" in run.log


def test_many_hang_ups_at_once_are_all_obeyed(site: Site, view: View) -> None:
    site.line()
    site.write()
    run = site.run()
    view.wait_samples("slave-1", 2)

    for interval in (100, 150, 300):
        site.write(poll={"interval": f"{interval}ms"})
        os.kill(run.process.pid, 1)

    assert view.wait("device/slave-1/config", lambda config: config["interval"] == 0.3)
    known = view.samples("slave-1")[-1]["seq"]
    view.wait_samples("slave-1", known + 3)
    assert json.loads(site.file.read_text())["poll"]["interval"] == "300ms"
