"""The broker: absent, killed, forgetful, refusing, old."""

from __future__ import annotations

import json
import select
import socket
import threading
import time
from collections.abc import Iterator
from contextlib import suppress
from functools import partial
from pathlib import Path

import pytest

from tests.support.brokers import Mosquitto
from tests.support.sites import PATIENCE, QUICK, Site, View, eventually, good

LIVE_FOR = 3.0
"""Seconds after which a sample is history (contract, section 3)."""

CONNECT = 0x10
LEVEL_AT = 8
"""Place of the protocol level in a CONNECT whose length has one byte more than its first (3.1.1, section 3.1)."""


def whole(view: View, device: str) -> bool:
    """Tell whether no sample of a device is missing up to the newest heard."""
    numbers = sorted(one["seq"] for one in view.samples(device))
    return numbers == list(range(1, len(numbers) + 1))


def test_online_and_samples_follow_a_connect_within_3_s_whatever_the_burst_holds(
    site: Site, mosquitto: Mosquitto
) -> None:
    site.line()
    site.write()
    run = site.run()
    view = View(mosquitto.subscribe())
    run.says("connected by MQTT 5")
    connected = time.monotonic()
    view.wait("availability", "online".__eq__)
    view.wait("line/stats")
    view.wait_samples("slave-1", 1)
    assert time.monotonic() - connected < 3.0


@pytest.mark.long(16)
def test_what_was_measured_before_the_broker_came_is_history(site: Site, mosquitto: Mosquitto) -> None:
    mosquitto.stop()
    site.line()
    site.write(poll={"interval": "100ms"})
    run = site.run()
    run.says("connection refused")
    time.sleep(LIVE_FOR + 1.5)  # until something is history

    mosquitto.start()
    view = View(mosquitto.subscribe())
    view.wait("availability", "online".__eq__)
    eventually(lambda: whole(view, "slave-1") and view.history_of("device/slave-1/history"), "all of it")

    arrays = view.history_of("device/slave-1/history")
    assert all(len(array) <= 100 and {one["boot"] for one in array} == {array[0]["boot"]} for array in arrays)
    assert all(one["historical"] is True for array in arrays for one in array)
    numbers = [one["seq"] for array in arrays for one in array]
    assert numbers == sorted(numbers)
    assert numbers[0] == 1
    live = [each for each in view.heard if each.topic.endswith("slave-1/telemetry")]
    first = json.loads(live[0].payload)
    assert first["seq"] > 1
    assert run.log.count("connection refused") == 1


@pytest.mark.long(10)
def test_nothing_is_lost_when_the_broker_is_killed_at_full_rate(site: Site, mosquitto: Mosquitto) -> None:
    site.line()
    site.pace = QUICK
    site.write(poll={"interval": 0})
    run = site.run()
    view = View(mosquitto.subscribe())
    view.wait_samples("slave-1", 50)

    mosquitto.kill()
    run.says("connection is lost")
    time.sleep(LIVE_FOR + 1.0)  # until something is history
    mosquitto.start()
    view.wait("device/slave-1/state", good)
    newest = max(one["seq"] for one in view.samples("slave-1"))
    for device in ("slave-1", "slave-2"):
        view.wait_samples(device, 1, lambda one: one["seq"] > newest + 10)
        # The past is sent 10 s after the reconnect.
        eventually(partial(whole, view, device), f"all of {device}", within=PATIENCE + 10)

    assert not view.newest("event")  # nothing had to be dropped
    repeated: dict[int, set[str]] = {}
    for one in view.samples("slave-1", once=False):
        repeated.setdefault(one["seq"], set()).add(str(one["wind_speed"]))
    assert all(len(values) == 1 for values in repeated.values())


def test_after_a_restart_that_forgot_everything_all_retained_topics_are_there_again(
    site: Site, mosquitto: Mosquitto, view: View
) -> None:
    site.line()
    site.write()
    site.run()
    view.wait("device/slave-1/state", good)
    before = set(mosquitto.retained("lfs10d/line0/#"))

    mosquitto.kill()
    mosquitto.start()
    eventually(lambda: set(mosquitto.retained("lfs10d/line0/#")) == before, "all retained topics")

    assert len(before) == 5 + 2 * 6 + 1
    state = json.loads(mosquitto.retained("lfs10d/line0/device/slave-1/state")["lfs10d/line0/device/slave-1/state"])
    assert state["seq"] > 0


def test_what_is_retained_of_a_slave_that_is_gone_is_cleared_at_the_next_connect(
    site: Site, mosquitto: Mosquitto, view: View
) -> None:
    mosquitto.publish("lfs10d/line0/device/old/state", "{}", retain=True)
    mosquitto.publish("lfs10d/line0/device/old/error", "{}", retain=True)
    mosquitto.publish("lfs10d/line0/note", "of somebody else", retain=True)
    mosquitto.publish("lfs10d/line1/device/old/state", "{}", retain=True)
    site.write(slaves=[1])
    site.run()

    eventually(lambda: not mosquitto.retained("lfs10d/line0/device/old/#"), "cleared")

    assert mosquitto.retained("lfs10d/line0/note")
    assert mosquitto.retained("lfs10d/line1/#")
    assert view.newest("device/slave-1/config")


def test_offline_said_by_somebody_else_is_contradicted(site: Site, mosquitto: Mosquitto, view: View) -> None:
    site.write(slaves=[])
    site.run()
    view.wait("availability", "online".__eq__)

    mosquitto.publish("lfs10d/line0/availability", "offline", retain=True)

    eventually(lambda: view.history_of("availability")[-2:] == ["offline", "online"], "contradiction")


WITHHOLDING = {
    "defaultACLAccess": {
        "publishClientSend": True,
        "publishClientReceive": True,
        "subscribe": True,
        "unsubscribe": True,
    },
    "roles": [
        {
            "rolename": "measuring",
            "acls": [{"acltype": "subscribePattern", "topic": "+/+/request/#", "priority": 0, "allow": False}],
        }
    ],
    "groups": [{"groupname": "everybody", "roles": [{"rolename": "measuring"}]}],
    "anonymousGroup": "everybody",
    "clients": [],
}
"""Mosquitto's dynamic security: its acl_file refuses no subscription, it only hands nothing over."""


def test_a_broker_that_withholds_requests_is_told_in_the_state_of_the_line(site: Site, mosquitto: Mosquitto) -> None:
    plugin = next(Path("/usr/lib").glob("**/mosquitto_dynamic_security.so"))
    rules = mosquitto.folder / "rules.json"
    rules.write_text(json.dumps(WITHHOLDING))
    rules.chmod(0o600)
    allowing = list(mosquitto.configuration)
    mosquitto.stop()
    mosquitto.configuration += [f"plugin {plugin}", f"plugin_opt_config_file {rules}"]
    mosquitto.start()
    view = View(mosquitto.subscribe("lfs10d/line0/#"))
    site.write(slaves=[])
    run = site.run()

    assert view.wait("line/state", lambda state: state["requests"] == "denied")
    run.says("refuses to let us subscribe to lfs10d/line0/request/#")

    mosquitto.stop()
    mosquitto.configuration = allowing
    mosquitto.start()
    assert view.wait("line/state", lambda state: state["requests"] == "ok")


def test_mqtt_3_1_1_is_spoken_where_it_is_configured(site: Site, mosquitto: Mosquitto, view: View) -> None:
    site.line()
    site.write(mqtt={"version": "3.1.1"})
    run = site.run()
    view.wait("device/slave-1/state", good)

    assert "connected by MQTT 3.1.1" in run.log
    assert "(p2, " in mosquitto.log  # mosquitto's word for level 4
    assert view.wait("info", lambda info: info["mqtt"]["version"] == "3.1.1")
    mosquitto.publish("lfs10d/line0/request/health", "{}")
    assert view.wait("response/health")["status"] == "ok"


class Gate:
    """Stands before a broker and knows no MQTT 5: its clients are told so and shown out."""

    def __init__(self, port: int) -> None:
        self._port = port
        self._server = socket.create_server(("127.0.0.1", 0))
        self.port: int = self._server.getsockname()[1]
        self.levels: list[int] = []
        threading.Thread(target=self._serve, daemon=True).start()

    def _serve(self) -> None:
        with suppress(OSError):
            while True:
                client, _ = self._server.accept()
                threading.Thread(target=self._admit, args=(client,), daemon=True).start()

    def _admit(self, client: socket.socket) -> None:
        with client, suppress(OSError):
            first = client.recv(4096)
            if not first:  # it hung up before it said a word: a connection begun as the daemon ended
                return
            level = first[first.index(b"MQTT") + 4]
            self.levels.append(level)
            if level == 5:
                client.sendall(b"\x20\x02\x00\x01")
                return
            with socket.create_connection(("127.0.0.1", self._port)) as broker:
                broker.sendall(first)
                other = {client: broker, broker: client}
                while True:
                    for ready in select.select(list(other), [], [])[0]:
                        data = ready.recv(65536)
                        if not data:
                            return
                        other[ready].sendall(data)

    def close(self) -> None:
        """Let nobody in any more."""
        self._server.close()


@pytest.fixture
def gate(mosquitto: Mosquitto) -> Iterator[Gate]:
    made = Gate(mosquitto.port)
    yield made
    made.close()


def test_a_broker_that_refuses_mqtt_5_is_spoken_to_in_3_1_1_with_one_warning(
    site: Site, view: View, gate: Gate
) -> None:
    site.line()
    site.write(mqtt={"port": gate.port})
    run = site.run()

    view.wait("device/slave-1/state", good)

    assert gate.levels[0] == 5
    assert gate.levels[-1] == 4
    assert run.log.count("refuses MQTT 5") == 1
    assert " warning " in next(line for line in run.log.splitlines() if "refuses MQTT 5" in line)
    assert view.wait("info", lambda info: info["mqtt"]["version"] == "3.1.1")


def test_a_second_daemon_with_our_client_id_is_told_of(site: Site, mosquitto: Mosquitto, view: View) -> None:
    site.write(slaves=[], mqtt={"client_id": "twin"})
    run = site.run()
    view.wait("availability", "online".__eq__)

    mosquitto.subscribe("$never/heard", client_id="twin")

    run.says("another client")
    status = eventually(
        lambda: "duplicate_client" in run.status.read_text() if run.status.exists() else "", "status.json"
    )
    assert status


def test_a_gateway_moves_to_another_node_with_its_backlog_its_requests_and_its_will(
    site: Site, mosquitto: Mosquitto, second_mosquitto: Mosquitto
) -> None:
    site.line()
    nodes = [f"127.0.0.1:{broker.port}" for broker in (mosquitto, second_mosquitto)]
    site.pace = QUICK
    site.write(mqtt={"host": nodes}, poll={"interval": "100ms"})
    run = site.run()
    before, after = View(mosquitto.subscribe()), View(second_mosquitto.subscribe())
    before.wait("availability", "online".__eq__)
    before.wait_samples("slave-1", 20)

    mosquitto.kill()
    killed = time.monotonic()
    after.wait("availability", "online".__eq__)
    assert time.monotonic() - killed < 3.0
    for topic in ("info", "devices", "line/state", "device/slave-1/config"):
        after.wait(topic)
    after.wait_samples("slave-1", 20)

    def all_of_it() -> bool:
        """Tell whether nothing is missing."""
        seen = {one["seq"] for view in (before, after) for one in view.samples("slave-1")}
        return seen == set(range(1, max(seen) + 1))

    eventually(all_of_it, "all samples at one of the two", within=PATIENCE + 10)
    status = f"broker {nodes[1]} connected"
    eventually(lambda: [one for one in run.manager.all("STATUS=") if status in one], status)
    second_mosquitto.publish("lfs10d/line0/request/health", "{}")
    after.wait("response/health")
    run.process.kill()
    after.wait("availability", "offline".__eq__)
