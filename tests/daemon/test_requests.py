"""Requests from outside: each rule of admission as any MQTT client sees it, and one response to each request."""

from __future__ import annotations

import json
import signal
import subprocess
import time
from collections.abc import Callable
from dataclasses import dataclass
from itertools import count
from typing import Any

import pytest

from lfs10d.simulator.line import SimulatedLine
from lfs10d.telemetry.contract import check
from tests.support.brokers import Heard, Listener, Mosquitto
from tests.support.sites import Run, Site, View, eventually, good, tell

BASE = "lfs10d/line0"


@dataclass
class Operator:
    """Somebody who sends requests and hears every response."""

    listener: Listener
    run: Run

    def __post_init__(self) -> None:
        self._fences = count()

    def send(self, name: str, payload: object = None, **how: Any) -> None:  # noqa: ANN401 - as Listener.publish
        """Publish a request and wait until the broker has it; "." is the topic above all requests."""
        content = payload if isinstance(payload, bytes) else json.dumps({} if payload is None else payload)
        topic = f"{BASE}/request" if name == "." else f"{BASE}/request/{name}"
        self.listener.publish(topic, content, **how)

    @property
    def responses(self) -> list[Heard]:
        """Every response so far, each as the documentation promises."""
        found = [each for each in list(self.listener.heard) if each.topic.startswith(f"{BASE}/response/")]
        for each in found:
            levels = each.topic.removeprefix(f"{BASE}/").split("/")
            check("/".join(levels if len(levels) < 3 else ["response", "any", "topic"]), each.payload.decode())
            assert not each.retain
            assert each.qos == 1
        return found

    def settled(self) -> list[Heard]:
        """Return every response once the daemon has answered all that was sent before, without the question for it."""
        token = f"fence-{next(self._fences)}"
        self.send("health", {"id": token})
        eventually(lambda: any(_id(each) == token for each in self.responses), "the answer to the last request")
        return [each for each in self.responses if not str(_id(each)).startswith("fence-")]

    def ask(self, name: str, payload: object = None, **how: Any) -> dict[str, Any]:  # noqa: ANN401 - plain data of any shape
        """Send one request and return its one response."""
        before = len(self.responses)
        self.send(name, payload, **how)
        eventually(lambda: len(self.responses) > before, f"a response to {name}")
        (response,) = self.responses[before:]
        parsed: dict[str, Any] = json.loads(response.payload)
        return parsed


def _id(heard: Heard) -> object:
    return json.loads(heard.payload)["id"]


def codes(heard: list[Heard]) -> list[str | None]:
    errors = [json.loads(each.payload)["error"] for each in heard]
    return [error and error["code"] for error in errors]


def operator_of(site: Site, mosquitto: Mosquitto, **sections: Any) -> Operator:  # noqa: ANN401 - plain data of any shape
    """Start the daemon and return somebody who is subscribed before anything is answered."""
    listener = mosquitto.subscribe(f"{BASE}/#")
    site.write(**sections)
    run = site.run()
    listener.wait_for(f"{BASE}/availability")
    eventually(lambda: listener.on(f"{BASE}/availability")[-1].payload == b"online", "online")
    return Operator(listener, run)


@pytest.fixture
def operator(site: Site, mosquitto: Mosquitto) -> Operator:
    site.line()
    return operator_of(site, mosquitto)


def test_every_kind_of_wrong_request_has_its_one_answer_where_it_belongs(operator: Operator) -> None:
    wrong: list[tuple[str, object, str | None, str]] = [
        ("health", b"nonsense", "invalid_json", "health"),
        ("health", b"[]", "invalid_json", "health"),
        ("health", b'{"id":NaN}', "invalid_json", "health"),
        ("health", b"[" * 4000, "invalid_json", "health"),
        ("health", b"\xff\xfe", "invalid_json", "health"),
        ("health", b'{"id":"big",' + b" " * 4096 + b"}", "too_large", "health"),
        ("no/such/thing", {"id": 1}, "unknown_request", "unknown"),
        ("", {"id": 2}, "unknown_request", "unknown"),
        ("register/peek", {"id": 3}, "unknown_request", "unknown"),
        ("health", {"id": 4, "verbose": True}, "invalid_param", "health"),
        ("device/read", {"id": 5}, "invalid_param", "device/read"),
        ("device/read", {"id": 6, "device": 1}, "invalid_param", "device/read"),
        ("device/read", {"id": True, "device": "slave-1"}, "invalid_param", "device/read"),
        ("device/read", {"id": 7, "device": "nobody"}, "unknown_device", "device/read"),
        (".", {"id": 8}, "unknown_request", "unknown"),
        ("republish", {"id": 9}, None, "republish"),
    ]
    for name, payload, _, _ in wrong:
        operator.send(name, payload)
    # What is refused at once is answered in the order of the requests; what is performed, when it is done.
    done_later = {None, "unknown_device"}
    heard = operator.settled()
    answers = [(each.topic, code) for each, code in zip(heard, codes(heard), strict=True)]
    wanted = [(f"{BASE}/response/{topic}", code) for _, _, code, topic in wrong]
    assert [each for each in answers if each[1] not in done_later] == [
        each for each in wanted if each[1] not in done_later
    ]
    assert sorted(answers, key=str) == sorted(wanted, key=str)


def test_an_empty_payload_has_no_answer(operator: Operator) -> None:
    operator.send("health", b"")
    operator.send("health", b"", retain=True)
    assert operator.settled() == []


def test_a_retained_request_is_rejected_cleared_and_never_executed(operator: Operator, mosquitto: Mosquitto) -> None:
    operator.send("line/trace", {"id": "r", "for": 5}, retain=True)
    operator.send("no/such", {"id": "u"}, retain=True)
    assert codes(operator.settled()) == ["retained", "retained"]
    eventually(lambda: not mosquitto.retained(f"{BASE}/request/#"), "the retained requests are cleared")
    assert operator.listener.on(f"{BASE}/trace") == []


def test_a_request_retained_while_the_daemon_was_away_is_rejected_when_it_comes(
    site: Site, mosquitto: Mosquitto
) -> None:
    site.line()
    mosquitto.publish(f"{BASE}/request/device/read", '{"id":"old","device":"slave-1"}', retain=True)
    operator = operator_of(site, mosquitto)
    (response,) = operator.settled()
    assert (codes([response]), _id(response)) == (["retained"], "old")
    assert mosquitto.retained(f"{BASE}/request/#") == {}


def test_a_response_topic_and_correlation_data_are_obeyed_if_they_are_ours(operator: Operator) -> None:
    topics = {
        f"{BASE}/response/me/1": f"{BASE}/response/me/1",
        f"{BASE}/elsewhere": f"{BASE}/response/health",
        "lfs10d/line1/response/x": f"{BASE}/response/health",
        f"{BASE}/response": f"{BASE}/response/health",
    }
    for asked in topics:
        operator.send("health", {}, response_topic=asked, correlation=b"\x00\xff" + asked.encode())
    heard = operator.settled()
    assert [each.topic for each in heard] == list(topics.values())
    assert [each.correlation for each in heard] == [b"\x00\xff" + asked.encode() for asked in topics]


def test_a_repeat_gets_the_first_response_again_to_its_own_place_and_nothing_is_done_twice(
    operator: Operator,
) -> None:
    content = {"id": "again", "device": "slave-1"}
    operator.send("device/read", content, response_topic=f"{BASE}/response/one", correlation=b"1")
    operator.send("device/read", content, response_topic=f"{BASE}/response/two", correlation=b"2")
    eventually(lambda: len(operator.responses) == 2, "both are answered")
    operator.send("device/read", {"device": "slave-1", "transaction": "again"})
    operator.send("device/read", {"id": "again", "device": "slave-2"})
    one, two, third, conflict = operator.settled()
    first = json.loads(one.payload)
    assert first["status"] == "ok"
    assert (one.topic, one.correlation, two.topic, two.correlation) == (
        f"{BASE}/response/one",
        b"1",
        f"{BASE}/response/two",
        b"2",
    )
    assert json.loads(two.payload) == first
    assert json.loads(third.payload) == {**first, "id": None, "transaction": "again"}
    assert codes([conflict]) == ["duplicate_conflict"]
    seq = first["data"]["seq"]
    assert (
        sum(json.loads(each.payload)["seq"] == seq for each in operator.listener.on(f"{BASE}/device/slave-1/telemetry"))
        == 1
    )


def test_a_burst_beyond_64_is_rate_limited_and_every_request_of_it_is_answered(operator: Operator) -> None:
    begun = time.monotonic()
    for number in range(100):
        operator.listener._client.publish(f"{BASE}/request/republish", json.dumps({"id": number}), 1)
    eventually(lambda: len(operator.responses) == 100, "100 answers")
    told = codes(operator.responses)
    assert 64 <= told.count(None) <= 64 + 20 * (time.monotonic() - begun)
    assert told.count(None) + told.count("rate_limited") == 100
    assert sorted(str(_id(each)) for each in operator.responses) == sorted(str(number) for number in range(100))


def test_with_no_class_allowed_only_looking_is(site: Site, mosquitto: Mosquitto) -> None:
    site.line()
    operator = operator_of(site, mosquitto, commands=[])
    assert operator.ask("device/read", {"device": "slave-1"})["error"]["code"] == "not_allowed"
    assert operator.ask("line/trace")["error"]["code"] == "not_allowed"
    assert operator.ask("config/reload")["error"]["code"] == "not_allowed"
    assert operator.ask("config/get")["data"]["config"]["commands"] == []
    site.write(commands=["polling"])
    operator.run.reload()
    assert operator.ask("device/read", {"device": "slave-1"})["status"] == "ok"
    assert operator.ask("line/trace")["error"]["code"] == "not_allowed"


def test_device_read_polls_now_and_its_sample_is_on_telemetry_too(site: Site, mosquitto: Mosquitto, view: View) -> None:
    served = site.line((1, 2, 3))
    tell(served, lambda line: _silence(line, 2))
    slaves = [1, 2, {"id": 3, "enabled": False}]
    operator = operator_of(site, mosquitto, slaves=slaves, poll={"interval": "1h", "retries": 0})
    response = operator.ask("device/read", {"id": "r", "device": "slave-1"})
    (sample,) = view.wait_samples("slave-1", 1, lambda one: one["seq"] == response["data"]["seq"])
    assert (response["status"], response["data"]) == ("ok", sample)
    assert good(sample)

    silent = operator.ask("device/read", {"device": "slave-2"})
    assert (silent["status"], silent["error"]["code"]) == ("failed", "timeout")
    assert (silent["data"]["quality"], silent["data"]["error"]) == ("bad", "timeout")

    disabled = operator.ask("device/read", {"device": "slave-3"})
    assert (disabled["status"], disabled["data"]["quality"]) == ("ok", "good")
    assert view.newest("device/slave-3/state")["wind_speed"] is None

    served.stop()
    view.wait("line/error", lambda error: error["active"])
    lost = operator.ask("device/read", {"device": "slave-1"})
    assert (lost["status"], lost["error"]["code"], lost["data"]["error"]) == ("failed", "line_error", "port_lost")


def _silence(line: SimulatedLine, slave: int) -> None:
    for sensor in line.sensors:
        if sensor.slave == slave:
            sensor.powered = False


def test_a_trace_tells_frames_until_it_ends_by_itself_or_is_cancelled(operator: Operator) -> None:
    topic = f"{BASE}/trace"
    assert operator.ask("line/trace", {"for": "400ms"})["data"] == {"for": 0.4}
    operator.listener.wait_for(topic, 4)
    eventually(_stands_still(operator.listener, topic), "the trace ends by itself")
    for each in operator.listener.on(topic):
        check("trace", each.payload.decode())
    texts = [json.loads(each.payload)["text"] for each in operator.listener.on(topic)]
    assert "slave-1: read 2 registers at 0x0001 of slave 1" in texts

    operator.ask("line/trace", {"for": "10m"})
    operator.listener.wait_for(topic, len(texts) + 2)
    assert operator.ask("line/cancel")["data"] == {"cancelled": ["trace"]}
    eventually(_stands_still(operator.listener, topic), "the trace is cancelled")
    assert operator.ask("line/cancel")["data"] == {"cancelled": []}


def _stands_still(listener: Listener, topic: str) -> Callable[[], bool]:
    """Return the claim that telemetry went on twenty times since a topic was heard last."""

    def still() -> bool:
        heard = [each.topic for each in list(listener.heard) if each.topic == topic or each.topic.endswith("telemetry")]
        return topic not in heard[-20:]

    return still


def test_config_reload_tells_what_it_did_and_a_broken_file_changes_nothing(operator: Operator, site: Site) -> None:
    site.write(slaves=[1, 2, 3], poll={"interval": "300ms"})
    done = operator.ask("config/reload")
    assert done["status"] == "ok"
    assert "slaves.slave-3" in done["data"]["applied"]
    site.file.write_text("slaves: [1, 1]\n")
    broken = operator.ask("config/reload")
    assert (broken["status"], broken["error"]["code"]) == ("rejected", "invalid_param")
    assert broken["error"]["message"].startswith(f"{site.file}:1:")
    assert "\n" not in broken["error"]["message"]
    assert len(operator.ask("health")["data"]["devices"]) == 3


def test_a_request_that_runs_when_the_daemon_ends_is_answered(site: Site, mosquitto: Mosquitto) -> None:
    served = site.line((1,))
    tell(served, lambda line: _silence(line, 1))
    operator = operator_of(site, mosquitto, slaves=[{"id": 1, "response_timeout": "10s"}])
    operator.send("device/read", {"id": "r", "device": "slave-1"})
    operator.send("device/read", {"id": "r", "device": "slave-1"}, correlation=b"repeat")
    operator.settled()
    assert operator.run.ends(signal.SIGTERM) == 0
    heard = [each for each in operator.responses if _id(each) == "r"]
    assert codes(heard) == ["cancelled", "cancelled"]


@pytest.mark.needs("mosquitto_pub")
def test_by_3_1_1_a_request_is_told_apart_by_its_id(site: Site, mosquitto: Mosquitto) -> None:
    """The daemon and the one who asks both speak 3.1.1; who listens does not matter."""
    site.line()
    mosquitto.publish(f"{BASE}/request/republish", '{"id":"kept"}', retain=True)
    operator = operator_of(site, mosquitto, mqtt={"version": "3.1.1"})
    for number, name in enumerate(("device/read", "health", "no/such")):
        payload = json.dumps({"id": number, **({"device": "slave-1"} if number == 0 else {})})
        command = ["mosquitto_pub", "-V", "mqttv311", "-p", str(mosquitto.port), "-q", "1"]
        subprocess.run([*command, "-t", f"{BASE}/request/{name}", "-m", payload], check=True, timeout=20)
    eventually(lambda: any(_id(each) == 0 for each in operator.responses), "the reading, which waits for the line")
    heard = operator.settled()
    assert {_id(each): code for each, code in zip(heard, codes(heard), strict=True)} == {
        "kept": "retained",
        0: None,
        1: None,
        2: "unknown_request",
    }
    assert len(heard) == 4


def test_nothing_of_a_request_reaches_the_log_as_it_came(operator: Operator) -> None:
    hostile = "\x1b[31m\u202e\r\nfake line"
    operator.send("no/\u202e\u2028", {"id": hostile, hostile: hostile})  # mosquitto takes no control characters there
    operator.send("device/read", {"id": hostile, "device": hostile})
    operator.send("health", b"\x1b[2J")
    assert codes(operator.settled()) == ["unknown_request", "invalid_param", "invalid_json"]
    assert all(line.isprintable() for line in operator.run.log.splitlines())
    assert "\nfake line" not in operator.run.log
