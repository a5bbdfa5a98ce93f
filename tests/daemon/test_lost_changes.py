"""`changes.yaml` is gone (a new SD card): what the broker keeps of us tells where to look, the line decides."""

from __future__ import annotations

import json
import shutil
import signal
from collections.abc import Callable
from typing import Any

import pytest

from lfs10d.simulator.pty import PtyLine
from tests.support.brokers import Mosquitto
from tests.support.sites import QUICK, SPARSE, Run, Site, View, eventually, good, tell

pytestmark = pytest.mark.needs("mosquitto")

B = "lfs10d/line0"


@pytest.fixture
def view(mosquitto: Mosquitto) -> View:
    """Give a subscriber at a broker that keeps what is retained across a restart of its own."""
    mosquitto.stop()
    mosquitto.configuration += ["persistence true", f"persistence_location {mosquitto.folder}/"]
    mosquitto.start()
    return View(mosquitto.subscribe())


@pytest.fixture
def asked(mosquitto: Mosquitto, view: View) -> Callable[..., None]:
    """Give what sends a request and waits until it is done."""

    def asked(name: str, /, **parameters: Any) -> None:  # noqa: ANN401 - plain data of any shape
        mosquitto.publish(f"{B}/request/{name}", json.dumps(parameters))
        response = view.wait(f"response/{name}")
        assert response["status"] == "ok", response

    return asked


def started(site: Site, view: View, **options: Any) -> Run:  # noqa: ANN401 - plain data of any shape
    run = site.run(**options)
    run.ready()
    view.wait("availability", lambda word: word == "online")
    return run


def with_a_new_card(site: Site, run: Run, view: View, mosquitto: Mosquitto) -> None:
    """Stop the daemon and the broker; the broker comes back, the daemon's state does not."""
    assert run.ends(signal.SIGTERM) == 0
    shutil.rmtree(site.folder / "state")
    mosquitto.stop()
    mosquitto.start()
    view.listener.close()
    view.listener = mosquitto.subscribe()
    view.clear()


def conflicts(view: View) -> list[dict[str, Any]]:
    keys = ("device", "file", "last", "used")
    events = [event for event in view.history_of("event") if event["type"] == "change_conflict"]
    return [{key: event[key] for key in keys} for event in events]


def spot(slave: int, baudrate: int = 19200) -> dict[str, int]:
    return {"slave": slave, "baudrate": baudrate}


def test_a_sensor_that_was_moved_is_found_kept_and_told(
    site: Site, view: View, mosquitto: Mosquitto, asked: Callable[..., None]
) -> None:
    site.line((1, 2))
    site.pace = QUICK
    site.write(poll=SPARSE)
    run = started(site, view)
    view.wait("device/slave-2/state", good)
    asked("device/readdress", device="slave-2", to=9)
    view.wait("device/slave-2/config", lambda config: config["slave"] == 9)
    with_a_new_card(site, run, view, mosquitto)
    run = started(site, view)
    view.wait("device/slave-2/config", lambda config: config["slave"] == 9)
    samples = view.wait_samples("slave-2", 3, good)
    assert conflicts(view) == [{"device": "slave-2", "file": spot(2), "last": spot(9), "used": spot(9)}]
    run.says(
        "slave-2: the file has it at slave id 2, 19200 baud; it was last verified at 9, 19200 baud: it answers at slave"
    )
    assert view.samples("slave-1")[0]["quality"] == "good", "the others are measured from the first poll on"
    assert samples[0]["boot"] == view.newest("info")["boot"]
    run.process.kill()
    run.process.wait()
    view.clear()
    started(site, view)
    view.wait_samples("slave-2", 3, good)
    assert conflicts(view) == [], "it is settled"
    assert [sample["quality"] for sample in view.samples("slave-2")[:3]] == ["good"] * 3


@pytest.mark.long(11)
def test_the_rate_of_the_line_is_found_again(
    site: Site, view: View, mosquitto: Mosquitto, asked: Callable[..., None]
) -> None:
    site.line((1, 2))
    site.write()
    run = started(site, view)
    view.wait("device/slave-1/state", good)
    view.wait("device/slave-2/state", good)
    asked("line/baudrate", to=9600)
    with_a_new_card(site, run, view, mosquitto)
    started(site, view)
    view.wait("line/state", lambda state: state["baudrate"] == 9600)
    view.wait_samples("slave-1", 3, good)
    view.wait_samples("slave-2", 3, good)
    (told,) = conflicts(view)
    assert (told["file"]["baudrate"], told["last"]["baudrate"], told["used"]["baudrate"]) == (19200, 9600, 9600)
    assert "now: 9600" in (site.folder / "state" / "changes.yaml").read_text()


@pytest.mark.long(12)
def test_measuring_waits_for_no_broker_and_the_sensor_is_found_when_one_comes(
    site: Site, view: View, mosquitto: Mosquitto, asked: Callable[..., None]
) -> None:
    served = site.line((1, 2))
    site.pace = QUICK
    site.write()
    run = started(site, view)
    view.wait("device/slave-2/state", good)
    asked("device/readdress", device="slave-2", to=9)
    with_a_new_card(site, run, view, mosquitto)
    mosquitto.stop()
    run = site.run()
    run.ready()
    eventually(lambda: len(requests_to(served, 1)) > 20, "slave-1 is polled while no broker is there")
    assert not [request for request in requests_to(served, 9) if request.begun > requests_to(served, 2)[-1].begun]
    mosquitto.start()
    view.listener.close()
    view.listener = mosquitto.subscribe()
    view.wait("device/slave-2/config", lambda config: config["slave"] == 9)
    view.wait_samples("slave-2", 3, good)


@pytest.mark.long(15)
def test_who_answers_at_an_id_that_was_another_s_is_not_measured_under_a_guessed_name(
    site: Site, view: View, mosquitto: Mosquitto
) -> None:
    served = site.line((1, 2))
    site.write(slaves=[1, 2, {"id": 7, "name": "roof"}])
    mosquitto.publish(f"{B}/device/slave-2/config", '{"slave": 9}', retain=True)
    mosquitto.publish(f"{B}/device/roof/config", '{"slave": 2}', retain=True)
    started(site, view)
    view.wait("device/roof/config", lambda config: config["slave"] == 2)
    view.wait("device/slave-2/error", lambda error: error["code"] == "config_conflict")
    view.wait_samples("roof", 3, good)
    (sought, *_) = eventually(lambda: requests_to(served, 9), "slave-2 is looked for where it was")
    before = [each for each in requests_to(served, 2) if 0 < sought.begun - each.begun < 1_500_000_000]
    # Each of the three questions to 7 takes longer than an interval of 200 ms: five polls would have found place.
    assert sum(each.body[2:4] == b"\x00\x01" for each in before) <= 2
    assert view.newest("device/slave-2/availability") == "offline"


def requests_to(served: PtyLine, slave: int) -> list[Any]:
    found: list[Any] = []
    tell(served, lambda line: found.extend(request for request in line.log if request.body[:1] == bytes([slave])))
    return found


def test_where_the_file_s_place_answers_nothing_is_kept(site: Site, view: View, mosquitto: Mosquitto) -> None:
    site.line((1, 2))
    site.write()
    mosquitto.publish(f"{B}/device/slave-2/config", '{"slave": 9}', retain=True)
    mosquitto.publish(f"{B}/line/state", '{"baudrate": 9600}', retain=True)
    run = started(site, view)
    view.wait_samples("slave-1", 3, good)
    view.wait_samples("slave-2", 3, good)
    eventually(lambda: conflicts(view), "the event")
    assert all(told["used"] == told["file"] for told in conflicts(view))
    view.wait("info", lambda info: info["changes"] == 0)
    assert view.newest("line/state")["baudrate"] == 19200
    assert run.ends(signal.SIGTERM) == 0


@pytest.mark.parametrize("version", ["5", "3.1.1"])
def test_hostile_words_under_our_topics_change_nothing(
    site: Site, view: View, mosquitto: Mosquitto, version: str
) -> None:
    site.line((1,))
    site.write(mqtt={"version": version})
    for slave, payload in enumerate(
        (b"", b"[" * 5000, b'{"slave": 300}', b'{"slave": true}', b"\xff\xfe", b"{" * 9), 1
    ):
        mosquitto.publish(f"{B}/device/slave-{slave}/config", payload, retain=True)
    mosquitto.publish(f"{B}/line/state", b'{"baudrate": 1e400}', retain=True)
    mosquitto.publish(f"{B}/device/stranger/config", b'{"slave": 1}', retain=True)
    run = started(site, view)
    view.wait_samples("slave-1", 3, good)
    view.wait("device/slave-2/availability", lambda word: word == "offline")
    assert conflicts(view) == []
    assert not (site.folder / "state" / "changes.yaml").exists()
    assert run.ends(signal.SIGTERM) == 0


def test_a_daemon_that_nobody_remembers_begins_all_the_same(site: Site, view: View) -> None:
    site.line((1, 2))
    site.write()
    started(site, view)
    samples = view.wait_samples("slave-1", 3)
    assert [sample["seq"] for sample in samples[:3]] == [1, 2, 3], "what was measured meanwhile is not lost"
    assert conflicts(view) == []
