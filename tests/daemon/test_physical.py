"""Physical changes from outside: a pseudo terminal, a real broker, `mosquitto_pub` and `lfs10d request`, SIGKILL."""

from __future__ import annotations

import json
import random
import re
import subprocess
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from lfs10d.simulator.line import SimulatedLine
from lfs10d.simulator.pty import PtyLine
from lfs10d.simulator.sensor import Sensor
from lfs10d.simulator.wire import Format
from tests.support import forked
from tests.support.brokers import Mosquitto
from tests.support.sites import QUICK, SPARSE, Site, View, eventually, good, tell

BASE = "lfs10d/line0"


def places(served: PtyLine) -> list[int]:
    """Return where the sensors are, asked in the line's own thread."""
    found: list[int] = []
    tell(served, lambda line: found.extend(sensor.slave for sensor in line.sensors))
    return sorted(found)


def all_places(served: PtyLine) -> list[int]:
    """Return where the sensors are, in the order they were put on the line."""
    found: list[int] = []
    tell(served, lambda line: found.extend(sensor.slave for sensor in line.sensors))
    return found


def written(line: SimulatedLine) -> int:
    """Return how many writes the line heard."""
    return sum(request.frame[1:2] == b"\x06" for request in line.log)


def publish(mosquitto: Mosquitto, topic: str, payload: dict[str, Any]) -> None:
    """Publish by mosquitto_pub."""
    broker = ["mosquitto_pub", "-h", "127.0.0.1", "-p", str(mosquitto.port)]
    subprocess.run([*broker, "-t", topic, "-m", json.dumps(payload)], check=True)


def asked(site: Site, name: str, *parameters: str) -> subprocess.CompletedProcess[str]:
    """Send a request as a person does."""
    return forked.run(["request", name, *parameters, "-c", str(site.file)])


def published(view: View, mosquitto: Mosquitto, name: str, payload: dict[str, Any]) -> dict[str, Any]:
    """Send a request by mosquitto_pub and return its one response."""
    topic = f"response/{name}"
    before = len(view.history_of(topic))
    publish(mosquitto, f"{BASE}/request/{name}", payload)
    eventually(lambda: len(view.history_of(topic)) > before, f"a response to {name}", within=60.0)
    (response,) = view.history_of(topic)[before:]
    return dict(response)


@pytest.mark.needs("mosquitto_pub")
@pytest.mark.long(12)
def test_a_sensor_gets_another_id_by_either_way(site: Site, mosquitto: Mosquitto, view: View) -> None:
    served = site.line((1, 2))
    site.pace = QUICK
    site.write(poll=SPARSE)
    run = site.run()
    view.wait("device/slave-2/state", good)
    request = {"id": "m1", "device": "slave-2", "to": 9, "dry_run": True}
    answer = published(view, mosquitto, "device/readdress", request)
    assert answer["data"] == {"device": "slave-2", "from": 2, "to": 9, "dry_run": True}
    assert places(served) == [1, 2]
    request = {"id": "m2", "device": "slave-2", "to": 9}
    answer = published(view, mosquitto, "device/readdress", request)
    assert (answer["status"], answer["id"], answer["error"]) == ("ok", "m2", None)
    assert places(served) == [1, 9]
    view.wait("device/slave-2/config", lambda config: config["slave"] == 9)
    before = view.samples("slave-2")[-1]["seq"]
    view.wait_samples("slave-2", 3, lambda sample: sample["seq"] > before and good(sample))
    assert [each["type"] for each in view.history_of("event") if each["type"] == "readdressed"] == ["readdressed"]

    done = asked(site, "device/readdress", "device=slave-2", "to=11", "--json")
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["data"]["to"] == 11
    assert places(served) == [1, 11]
    refused = asked(site, "device/readdress", "device=slave-2", "to=1")
    assert refused.returncode == 1
    assert "slave id 1 is that of slave-1" in refused.stdout + refused.stderr

    run.ends(15)
    view.clear()
    site.run()
    view.wait("device/slave-2/state", good)
    again = published(view, mosquitto, "device/readdress", {"id": "m2", "device": "slave-2", "to": 9})
    assert again["data"] == {"device": "slave-2", "from": 2, "to": 9}, "the first answer, though it moved since"
    assert places(served) == [1, 11]


@pytest.mark.needs("strace")
def test_the_intent_is_on_the_disk_before_the_first_byte_of_the_write(
    site: Site, mosquitto: Mosquitto, view: View
) -> None:
    site.line((1, 2))
    site.pace = QUICK
    site.write(poll=SPARSE)
    trace = site.folder / "trace"
    run = site.run()
    view.wait("device/slave-2/state", good)
    tracer = subprocess.Popen(
        [
            "strace",
            "-f",
            "-y",
            "-xx",
            "-e",
            "trace=write,fsync,rename,renameat",
            "-o",
            str(trace),
            "-p",
            str(run.process.pid),
        ],
        stderr=subprocess.DEVNULL,
    )
    eventually(lambda: trace.exists() and trace.stat().st_size > 0, "strace follows")
    assert published(view, mosquitto, "device/readdress", {"device": "slave-2", "to": 9})["status"] == "ok"
    tracer.terminate()
    tracer.wait()
    calls = [re.sub(r"\\x([0-9a-f]{2})", lambda m: chr(int(m[1], 16)), line) for line in trace.read_text().splitlines()]
    raw = trace.read_text().splitlines()
    written = next(n for n, line in enumerate(raw) if r'"\x02\x06\x00\x05\x00\x09' in line)
    journal = [n for n, line in enumerate(calls) if "fsync" in line and "journal.json" in line]
    renamed = [n for n, line in enumerate(calls) if "rename" in line and "journal.json" in line]
    folder = [
        n for n, line in enumerate(calls) if "fsync" in line and line.rstrip().endswith("= 0") and "/state>" in line
    ]
    assert journal[0] < renamed[0] < min(n for n in folder if n > renamed[0]) < written


@pytest.mark.long(12)
def test_at_sigterm_a_change_ends_is_answered_and_settled_at_the_next_start(
    site: Site, mosquitto: Mosquitto, view: View
) -> None:
    served = site.line((1, 2))
    site.write(poll=SPARSE)
    request = {"id": "t1", "device": "slave-2", "to": 9}
    run = site.run()
    view.wait("device/slave-2/state", good)
    publish(mosquitto, f"{BASE}/request/device/readdress", request)
    journal = site.folder / "state" / "journal.json"
    eventually(lambda: journal.exists() and '"kind":' in journal.read_text().replace(" ", ""), "the intent")
    writes: list[int] = []
    run.process.send_signal(15)
    tell(served, lambda line: writes.append(written(line)))
    assert run.ends(within=5.0) == 0
    tell(served, lambda line: writes.append(written(line)))
    assert writes[1] <= max(writes[0], 1), "the one write at most"
    (answer,) = view.history_of("response/device/readdress")
    assert answer["id"] == "t1"
    assert answer["status"] == "ok" or answer["error"]["code"] == "cancelled"
    view.clear()
    site.run()
    (place,) = set(places(served)) - {1}
    view.wait("device/slave-2/config", lambda config: config["slave"] == place)
    view.wait_samples("slave-2", 3, good)
    again = published(view, mosquitto, "device/readdress", request)
    assert {**again, "took_ms": 0} == {**answer, "took_ms": 0}
    assert set(places(served)) == {1, place}


KILLS = 10
"""Of each of the daemons side by side."""


@dataclass
class Victim:
    """A daemon on a line of its own that is killed again and again while `what` is done."""

    site: Site
    view: View
    mosquitto: Mosquitto
    what: str
    number: int = 0

    def begin(self) -> PtyLine:
        """Put up the line."""
        served = self.site.line((1, 2) if self.what != "line/adopt" else (2,))
        name = self.view.base.split("/")[-1]
        self.site.write(line={"name": name}, slaves=[1, 2] if self.what != "line/adopt" else [2])
        return served

    def asked(self) -> dict[str, Any]:
        """Return the next request's parameters."""
        self.number += 1
        if self.what == "device/readdress":
            return {"id": self.number, "device": "slave-2", "to": 20 + self.number}
        if self.what == "line/baudrate":
            return {"id": self.number, "to": 28800 - self.view.newest("line/state")["baudrate"]}
        return {"id": self.number}

    def round(self, served: PtyLine, rng: random.Random) -> None:
        """Start, see that everybody configured is found, ask, and kill."""
        self.view.clear()
        run = self.site.run()
        self.view.wait("device/slave-2/state", good)
        if self.what == "line/adopt" and 1 not in places(served):
            plug(served)
        publish(self.mosquitto, f"{self.view.base}/request/{self.what}", self.asked())
        time.sleep(rng.uniform(0.2, 6.0))
        run.process.kill()
        run.process.wait()
        assert len(set(places(served))) == len(places(served))

    def settled(self, served: PtyLine) -> None:
        """Start once more: everybody is found, at the place and the rate that the configuration says."""
        self.view.clear()
        self.site.run()

        def truth() -> bool:
            configured = {each["id"] for each in self.view.newest("devices") or []}
            rate = (self.view.newest("line/state") or {}).get("baudrate")
            found = dict(zip(all_places(served), rates(served), strict=True))
            at_rate = all(found[slave] == rate for slave in found if slave != 1 or self.what != "line/adopt")
            return set(found) - ({1} if self.what == "line/adopt" else set()) == configured and at_rate

        eventually(truth, f"the truth of {self.what}", within=60.0)
        self.view.wait_samples("slave-2", 3, good)


@pytest.mark.long(45)
def test_daemons_killed_at_any_moment_find_every_sensor_again(mosquitto: Mosquitto, tmp_path: Path) -> None:
    changes = ("device/readdress", "device/readdress", "line/baudrate", "line/adopt")
    victims: list[Victim] = []
    for number, what in enumerate(changes):
        folder = tmp_path / f"line{number}"
        folder.mkdir()
        view = View(mosquitto.subscribe(), f"lfs10d/line{number}")
        victims.append(Victim(Site(folder, mosquitto.port), view, mosquitto, what))

    def live(number: int) -> None:
        victim, rng = victims[number], random.Random(number)  # noqa: S311 - moments, no secrets
        try:
            served = victim.begin()
            for _ in range(KILLS):
                victim.round(served, rng)
            victim.settled(served)
        finally:
            victim.site.close()

    with ThreadPoolExecutor(len(victims)) as side_by_side:
        for done in [side_by_side.submit(live, number) for number in range(len(victims))]:
            done.result()


def test_the_line_and_its_sensors_change_their_rate_by_either_way(site: Site, mosquitto: Mosquitto, view: View) -> None:
    served = site.line((1, 2))
    site.write()
    run = site.run()
    view.wait("device/slave-2/state", good)
    answer = published(view, mosquitto, "line/baudrate", {"id": "r1", "to": 9600})
    assert (answer["status"], answer["data"]) == ("ok", {"from": 19200, "to": 9600, "pending": []})
    assert rates(served) == [9600, 9600]
    view.wait("line/state", lambda state: (state["baudrate"], state["activity"]) == (9600, "polling"))
    assert {state["activity"] for state in view.history_of("line/state")} >= {"changing_baudrate"}
    seq = view.samples("slave-2")[-1]["seq"]
    view.wait_samples("slave-2", 3, lambda sample: sample["seq"] > seq and good(sample))
    run.process.kill()
    run.process.wait()
    view.clear()
    site.run()
    view.wait("device/slave-2/state", good)
    assert view.newest("line/state")["baudrate"] == 9600
    done = asked(site, "line/baudrate", "to=19200", "--json")
    assert done.returncode == 0, done.stdout + done.stderr
    assert rates(served) == [19200, 19200]


@pytest.mark.long(18)
def test_newcomers_are_adopted_by_either_way(site: Site, mosquitto: Mosquitto, view: View) -> None:
    served = site.line((2,))
    # A change waits so that the others keep nine tenths of their polls: the rarer these are, the sooner it is over.
    site.pace = QUICK
    site.write(slaves=[2], poll={"interval": "1s"})
    site.run()
    view.wait("device/slave-2/state", good)
    plug(served)
    answer = published(view, mosquitto, "line/adopt", {"name": "north", "label": "Mast, 10 m"})
    assert (answer["status"], answer["data"]) == ("ok", {"device": "north", "slave": 3, "from": 1})
    view.wait_samples("north", 2, good)
    assert view.newest("device/north/config")["label"] == "Mast, 10 m"
    plug(served)
    done = asked(site, "line/adopt", "--json")
    assert done.returncode == 0, done.stdout + done.stderr
    assert json.loads(done.stdout)["data"]["slave"] == 4
    assert (places(served), rates(served)) == ([2, 3, 4], [19200] * 3)
    assert asked(site, "line/adopt").returncode == 1, "nobody is there any more"


def rates(served: PtyLine) -> list[int]:
    """Return at which rates the sensors are."""
    found: list[int] = []
    tell(served, lambda line: found.extend(sensor.format.baudrate for sensor in line.sensors))
    return found


def plug(served: PtyLine) -> None:
    """Connect a factory-new sensor."""
    tell(served, lambda line: line.add(Sensor(1, format=Format(9600))))
