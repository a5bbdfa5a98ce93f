"""What requests change of the configuration, from outside: over MQTT, across a kill, beside a person's edits."""

from __future__ import annotations

import json
import signal
import subprocess
from collections.abc import Callable
from typing import Any

import pytest

from tests.support.brokers import Mosquitto
from tests.support.sites import Run, Site, View, eventually, good

pytestmark = pytest.mark.needs("mosquitto", "mosquitto_pub")

B = "lfs10d/line0"


@pytest.fixture
def publish(mosquitto: Mosquitto, program: Callable[[str], str]) -> Callable[..., None]:
    """Give what sends a request as a person at a shell does."""

    def publish(name: str, /, **parameters: Any) -> None:  # noqa: ANN401 - plain data of any shape
        topic = f"{B}/request/{name}"
        command = [program("mosquitto_pub"), "-p", str(mosquitto.port), "-q", "1", "-t", topic, "-s"]
        subprocess.run(command, input=json.dumps(parameters).encode(), check=True, timeout=20)

    return publish


@pytest.fixture
def request_of(publish: Callable[..., None], view: View) -> Callable[..., dict[str, Any]]:
    """Give what sends a request and returns its response."""
    asked = 0

    def request_of(name: str, /, **parameters: Any) -> dict[str, Any]:  # noqa: ANN401 - plain data of any shape
        nonlocal asked
        asked += 1
        publish(name, id=asked, **parameters)
        response: dict[str, Any] = view.wait(f"response/{name}", lambda newest: newest["id"] == asked)
        return response

    return request_of


def started(site: Site, view: View, slaves: tuple[int, ...] = (1, 2)) -> Run:
    """Start a daemon and wait until it is connected and measures."""
    run = site.run()
    run.ready()
    view.wait("availability", lambda word: word == "online")
    for slave in slaves:
        view.wait(f"device/slave-{slave}/availability", lambda word: word == "online")
    return run


def started_again(site: Site, view: View, run: Run, slaves: tuple[int, ...] = (1, 2)) -> Run:
    """Kill a daemon at once, start another one and forget what the first one said."""
    run.process.kill()
    run.process.wait()
    view.clear()
    return started(site, view, slaves)


def events(view: View, kind: str) -> list[dict[str, Any]]:
    """Return the events of a kind, of which one at least must come: they follow what they tell of."""
    return eventually(lambda: [event for event in view.history_of("event") if event["type"] == kind], kind)  # type: ignore[no-any-return]  # parsed JSON


def test_a_device_that_answers_is_added_measured_and_there_again_after_a_kill(
    site: Site, view: View, request_of: Callable[..., dict[str, Any]]
) -> None:
    site.line((1, 2, 5))
    site.write()
    run = started(site, view)
    response = request_of("device/add", slave=5, name="roof", label="Roof, east", interval="250ms")
    again = started_again(site, view, run)
    assert (response["status"], response["data"]) == (
        "ok",
        {
            "device": "roof",
            "slave": 5,
            "label": "Roof, east",
            "profile": "lfs10",
            "interval": 0.25,
            "enabled": True,
            "response_timeout": "auto",
        },
    )
    content = (site.folder / "state" / "changes.yaml").read_text()
    assert "roof:" in content
    assert again.process.poll() is None
    view.wait_samples("roof", 2, good)
    assert view.newest("info")["changes"] == 1
    assert [entry["name"] for entry in view.newest("devices")] == ["slave-1", "slave-2", "roof"]
    answer = request_of("config/get")["data"]
    assert answer["origins"]["slaves[2].interval"] == "changes.yaml"
    assert answer["config"]["slaves"][2]["label"] == "Roof, east"


def test_nothing_is_added_where_nobody_answers_unless_told_not_to_ask(
    site: Site, view: View, request_of: Callable[..., dict[str, Any]]
) -> None:
    site.line()
    site.write()
    started(site, view)
    response = request_of("device/add", slave=7)
    assert (response["status"], response["error"]["code"]) == ("rejected", "timeout")
    assert response["error"].keys() == {"code", "message", "param"}
    assert not (site.folder / "state" / "changes.yaml").exists()
    assert request_of("device/add", slave=7, probe=False)["status"] == "ok"
    view.wait_samples("slave-7", 3, lambda sample: sample["error"] == "timeout")
    assert {each["device"] for each in events(view, "device_added")} == {"slave-7"}
    (audit,) = events(view, "change_applied")
    assert (audit["request"], audit["id"], audit["device"], audit["from"]) == ("device/add", 2, "slave-7", None)


def test_a_device_that_is_removed_leaves_no_retained_topic_and_stays_removed(
    site: Site, view: View, request_of: Callable[..., dict[str, Any]], mosquitto: Mosquitto
) -> None:
    site.line()
    site.write()
    run = started(site, view)
    assert any("/device/slave-2/" in topic for topic in mosquitto.retained(f"{B}/#"))
    assert request_of("device/remove", device="slave-2")["status"] == "ok"
    started_again(site, view, run, (1,))
    eventually(
        lambda: not any("/device/slave-2/" in topic for topic in mosquitto.retained(f"{B}/#")), "slave-2 is cleared"
    )
    view.wait_samples("slave-1", 3, good)
    assert view.samples("slave-2") == []
    again = request_of("device/remove", device="slave-2")
    assert (again["status"], again["error"]["code"]) == ("rejected", "unknown_device")
    request_of("config/reset", device="slave-2")
    view.wait_samples("slave-2", 2, good)


def test_options_apply_at_once_and_a_person_s_edit_wins_over_them(
    site: Site, view: View, request_of: Callable[..., dict[str, Any]]
) -> None:
    site.line()
    site.write(slaves=[{"id": 1, "interval": "200ms"}, 2])
    run = started(site, view)
    response = request_of("device/options", device="slave-1", interval="500ms", label="One")
    assert response["data"] == {
        "from": {"interval": 0.2, "label": None},
        "to": {"interval": 0.5, "label": "One"},
    }
    view.wait("device/slave-1/config", lambda config: config["interval"] == 0.5 and config["label"] == "One")
    (audit,) = events(view, "change_applied")
    assert (audit["device"], audit["from"], audit["to"]) == ("slave-1", *response["data"].values())
    run = started_again(site, view, run)
    assert view.newest("device/slave-1/config")["interval"] == 0.5
    site.write(slaves=[{"id": 1, "interval": "300ms"}, {"id": 2, "label": "Two"}])
    run.reload()
    view.wait("device/slave-1/config", lambda config: config["interval"] == 0.3)
    assert view.newest("device/slave-1/config")["label"] == "One"
    view.wait("info", lambda info: info["changes"] == 1)
    (lost,) = events(view, "change_dropped")
    assert (lost["key"], lost["device"], lost["lost"]) == ("slaves.slave-1.interval", "slave-1", 0.5)
    run.says("slaves.slave-1.interval: the file has another value now")
    site.write(slaves=[{"id": 1, "interval": "300ms", "label": "One"}, 2])
    run.reload()
    view.wait("info", lambda info: info["changes"] == 0)
    assert len(events(view, "change_dropped")) == 1


def test_a_file_of_changes_that_nobody_understands_is_put_aside_and_measuring_goes_on(site: Site, view: View) -> None:
    site.line()
    site.write()
    state = site.folder / "state"
    state.mkdir()
    (state / "changes.yaml").write_text("version: 99\n")
    run = started(site, view)
    view.wait_samples("slave-1", 2, good)
    run.says("a newer lfs10d wrote this file")
    assert (state / "changes.yaml.unreadable").read_text() == "version: 99\n"
    assert [lost["key"] for lost in events(view, "change_dropped")] == ["changes.yaml"]
    assert run.ends(signal.SIGTERM) == 0


def test_what_cannot_be_kept_is_not_done(site: Site, view: View, request_of: Callable[..., dict[str, Any]]) -> None:
    site.line()
    site.write()
    (site.folder / "state").write_text("a file where the state directory should be")
    started(site, view)
    response = request_of("device/options", device="slave-1", interval="5s")
    assert (response["status"], response["error"]["code"]) == ("rejected", "storage_full")
    assert view.newest("device/slave-1/config")["interval"] == 0.2
    assert view.newest("line/error")["code"] == "storage_full"
    assert request_of("device/remove", device="slave-1")["error"]["code"] == "storage_full"


def test_of_two_devices_with_one_id_the_one_verified_there_is_polled(
    site: Site, view: View, request_of: Callable[..., dict[str, Any]]
) -> None:
    site.line((1, 2, 5))
    site.write()
    run = started(site, view)
    assert request_of("device/add", slave=5, name="roof")["status"] == "ok"
    view.wait_samples("roof", 1, good)
    site.write(slaves=[1, 2, {"id": 5, "name": "tower"}])
    run.reload()
    error = view.wait("device/tower/error", lambda error: error["active"])
    assert (error["code"], "roof" in error["message"]) == ("config_conflict", True)
    assert view.newest("device/tower/availability") == "offline"
    reading = request_of("device/read", device="tower")
    assert (reading["status"], reading["error"]["code"]) == ("failed", "line_error")
    count = len(view.samples("roof"))
    view.wait_samples("roof", count + 3, good)
    assert [sample["error"] for sample in view.samples("tower")] == ["config_conflict"]
    assert request_of("device/remove", device="roof")["status"] == "ok"
    view.wait_samples("tower", 2, good)
    view.wait("device/tower/error", lambda error: not error["active"])
