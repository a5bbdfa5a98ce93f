"""Searching and freeing the line from outside: `mosquitto_pub` and `lfs10d request` at a running daemon."""

from __future__ import annotations

import json
import subprocess
import sys
from typing import Any

import pytest

from docs.generate.contract import check
from lfs10d.simulator.sensor import Sensor
from lfs10d.simulator.wire import Format
from tests.support import forked
from tests.support.brokers import Mosquitto
from tests.support.sites import Site, View, eventually, good, tell

pytestmark = pytest.mark.needs("mosquitto_pub")

BASE = "lfs10d/line0"

LOCKING = """\
import fcntl, os, sys
port = os.open(sys.argv[1], os.O_RDWR | os.O_NOCTTY)
fcntl.flock(port, fcntl.LOCK_EX | fcntl.LOCK_NB)
print("ours", flush=True)
sys.stdin.read()
"""
"""Another program that wants the port for itself until its input ends."""


def send(mosquitto: Mosquitto, name: str, **parameters: Any) -> None:  # noqa: ANN401 - any JSON
    topic = ["-t", f"{BASE}/request/{name}", "-m", json.dumps(parameters)]
    subprocess.run(["mosquitto_pub", "-h", "127.0.0.1", "-p", str(mosquitto.port), *topic], check=True)


def answer(view: View, mosquitto: Mosquitto, name: str, **parameters: Any) -> dict[str, Any]:  # noqa: ANN401 - plain data of any shape
    """Send a request and return its one response."""
    before = len(view.history_of(f"response/{name}"))
    send(mosquitto, name, **parameters)
    return response(view, name, before)


def response(view: View, name: str, before: int = 0) -> dict[str, Any]:
    eventually(lambda: len(view.history_of(f"response/{name}")) > before, f"a response to {name}", within=60.0)
    (one,) = view.history_of(f"response/{name}")[before:]
    check(f"response/{name}", json.dumps(one))
    return dict(one)


def asked(site: Site, name: str, *parameters: str) -> subprocess.CompletedProcess[str]:
    """Send a request as a person does."""
    return forked.run(["request", name, *parameters, "-c", str(site.file)])


def events(view: View, kind: str) -> list[dict[str, Any]]:
    return [each for each in view.history_of("event") if each["type"] == kind]


def activities(view: View) -> list[str]:
    told = [state["activity"] for state in view.history_of("line/state")]
    return [each for number, each in enumerate(told) if number == 0 or told[number - 1] != each]


def places(found: list[dict[str, Any]]) -> list[tuple[int, int, bool]]:
    return [(each["id"], each["baudrate"], each["known"]) for each in found]


def test_a_scan_finds_everybody_while_polling_goes_on_and_tells_how_far_it_is(
    site: Site, mosquitto: Mosquitto, view: View
) -> None:
    served = site.line((1, 2, 5))
    tell(served, lambda line: line.add(Sensor(9, format=Format(9600))))
    site.write()
    site.run()
    view.wait("device/slave-2/state", good)
    before = len(view.samples("slave-2"))

    send(mosquitto, "line/scan", id="s1", ids="1-12", share=60)
    view.wait("line/state", lambda state: state["activity"] == "scanning")
    assert answer(view, mosquitto, "line/scan", id="s2")["error"]["code"] == "busy"
    refused = answer(view, mosquitto, "device/readdress", device="slave-1", to=44)
    assert refused["error"]["code"] == "busy"
    assert "line/scan" in refused["error"]["message"]
    assert answer(view, mosquitto, "line/pause")["error"]["code"] == "busy"
    done = response(view, "line/scan", before=1)

    assert (done["status"], done["id"], done["error"]) == ("ok", "s1", None)
    assert places(done["data"]["found"]) == [(9, 9600, False), (1, 19200, True), (2, 19200, True), (5, 19200, False)]
    assert not any(each["suspect"] for each in done["data"]["found"])
    assert done["data"].keys() == {"found"}
    eventually(lambda: events(view, "scan_progress")[-1]["percent"] == 100, "the last progress")
    progress = events(view, "scan_progress")
    percents = [each["percent"] for each in progress]
    assert percents == sorted(percents)
    assert (percents[0], percents[-1]) == (0, 100)
    assert 3 <= len(percents) <= 12
    assert progress[0]["remaining_s"] > progress[-1]["remaining_s"] == 0
    # All of them are good in tests/line/test_scan_and_pause.py, in virtual time; here the simulator shares a processor
    # with other tests, and may read a request only after the rate has changed.
    assert len(list(filter(good, view.samples("slave-2")))) > before + 3
    assert view.newest("device/slave-2/availability") == "online"
    eventually(lambda: activities(view) == ["polling", "scanning", "polling"], "polling again")
    assert [one["id"] for one in view.newest("devices")] == [1, 2], "nobody is added unless wanted"


def test_what_is_new_and_beyond_doubt_is_added(site: Site, view: View) -> None:
    served = site.line((1, 2, 5, 250))
    tell(served, lambda line: line.add(Sensor(9, format=Format(9600))))
    site.write(slaves=[1, {"id": 2, "name": "mast-top"}])
    run = site.run()
    view.wait("device/mast-top/state", good)

    done = asked(site, "line/scan", "ids=1-9,250", "share=90", "add=true", "--json")
    assert done.returncode == 0, done.stderr
    data = json.loads(done.stdout)["data"]
    assert [(each["device"], each["slave"]) for each in data["added"]] == [("slave-5", 5)]
    assert data["not_added"] == []
    assert [each["id"] for each in data["found"] if each["suspect"]] == [250]
    view.wait("device/slave-5/state", good)
    eventually(lambda: [each["device"] for each in events(view, "change_applied")] == ["slave-5"], "the change is told")

    run.ends(15)
    view.clear()
    site.run()
    view.wait("device/slave-5/state", good)
    assert view.newest("device/slave-9/state") is None


def test_a_cancelled_scan_tells_what_it_found(site: Site, mosquitto: Mosquitto, view: View) -> None:
    site.line((1, 2))
    site.write()
    site.run()
    view.wait("device/slave-2/state", good)
    send(mosquitto, "line/scan", baudrates=[19200], share=90, id="s")
    eventually(lambda: any(each["found"] == 2 for each in events(view, "scan_progress")), "both are found")
    assert answer(view, mosquitto, "line/cancel")["data"] == {"cancelled": ["scan"]}
    done = response(view, "line/scan")
    assert (done["status"], done["error"]["code"]) == ("failed", "cancelled")
    assert places(done["data"]["found"]) == [(1, 19200, True), (2, 19200, True)]
    view.wait("line/state", lambda state: state["activity"] == "polling")
    assert answer(view, mosquitto, "line/scan", ids=[1])["status"] == "ok", "the place is free again"


def test_a_scan_whose_port_is_lost_fails_with_what_it_found(site: Site, mosquitto: Mosquitto, view: View) -> None:
    served = site.line((1, 2))
    site.write()
    site.run()
    view.wait("device/slave-2/state", good)
    send(mosquitto, "line/scan", baudrates=[19200], share=90)
    eventually(lambda: any(each["found"] == 2 for each in events(view, "scan_progress")), "both are found")
    served.stop()
    done = response(view, "line/scan")
    assert (done["status"], done["error"]["code"]) == ("failed", "line_error")
    assert len(done["data"]["found"]) == 2


def test_two_sensors_with_one_id_are_reported(site: Site, mosquitto: Mosquitto, view: View) -> None:
    served = site.line((1, 2))
    tell(served, lambda line: line.add(Sensor(7, format=Format(19200), turnaround=0.003)))
    tell(served, lambda line: line.add(Sensor(7, format=Format(19200), turnaround=0.004)))
    site.write()
    site.run()
    view.wait("device/slave-2/state", good)
    done = answer(view, mosquitto, "line/scan", ids=[7], baudrates=[19200], share=90, add=True)
    (found,) = done["data"]["found"]
    assert (found["id"], found["duplicate"], found["known"]) == (7, True, False)
    assert done["data"]["added"] == []
    eventually(
        lambda: [(each["slave"], each["baudrate"]) for each in events(view, "duplicate_id")] == [(7, 19200)],
        "two with id 7 are told",
    )


def test_a_pause_frees_the_port_for_another_program_and_ends_by_itself(
    site: Site, mosquitto: Mosquitto, view: View
) -> None:
    site.line((1, 2))
    site.write()
    run = site.run()
    view.wait("device/slave-2/state", good)

    assert answer(view, mosquitto, "line/pause", **{"for": "10m"})["data"] == {"for": 600}
    state = view.wait("line/state", lambda state: state["activity"] == "paused" and not state["open"])
    assert not state["open"]
    other = subprocess.Popen(
        [sys.executable, "-c", LOCKING, str(site.tty)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    assert other.stdout is not None
    assert other.stdout.readline() == "ours\n"
    for device in ("slave-1", "slave-2"):
        view.wait(f"device/{device}/availability", "offline".__eq__)
        bad = [one for one in view.samples(device) if not good(one)]
        assert [one["error"] for one in bad] == ["port_lost"]
        assert view.newest(f"device/{device}/error")["active"] is False
    assert answer(view, mosquitto, "line/scan")["error"]["code"] == "line_error"
    assert answer(view, mosquitto, "device/read", device="slave-1")["error"]["code"] == "line_error"
    assert not any(error["active"] for error in view.history_of("line/error"))

    done = asked(site, "line/pause", "for=1s", "--json")
    assert json.loads(done.stdout)["data"] == {"for": 1.0}, "the second replaces the first"
    error = view.wait("line/error", lambda error: error["active"])
    assert error["code"] == "port_busy", "the other program still has it"
    other.communicate("")
    assert other.wait() == 0
    for device in ("slave-1", "slave-2"):
        view.wait(f"device/{device}/availability", "online".__eq__)
    assert view.newest("line/error")["active"] is False
    assert activities(view) == ["polling", "paused", "polling"]
    assert run.log.count(f"{site.tty}: freed for another program") == 1, "the second pause is no news"


def test_a_pause_is_cancelled_though_the_port_is_gone_by_then(site: Site, mosquitto: Mosquitto, view: View) -> None:
    served = site.line((1, 2))
    site.write()
    site.run()
    view.wait("device/slave-2/state", good)
    answer(view, mosquitto, "line/pause")
    served.stop()
    assert not view.newest("line/error")["active"]
    assert answer(view, mosquitto, "line/cancel")["data"] == {"cancelled": ["pause"]}
    assert view.wait("line/error", lambda error: error["active"])["code"] == "port_lost"
    assert answer(view, mosquitto, "line/cancel")["data"] == {"cancelled": []}
