"""Requests from outside: each rule of admission as any MQTT client sees it, and one response to each request."""

from __future__ import annotations

import json
import signal
import subprocess
import time

import pytest

from tests.support.brokers import Heard, Mosquitto
from tests.support.operators import BASE, Operator, id_of, operator_of, silence
from tests.support.sites import Site, eventually, tell


def codes(heard: list[Heard]) -> list[str | None]:
    errors = [json.loads(each.payload)["error"] for each in heard]
    return [error and error["code"] for error in errors]


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
    assert (codes([response]), id_of(response)) == (["retained"], "old")
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
    assert sorted(str(id_of(each)) for each in operator.responses) == sorted(str(number) for number in range(100))


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
    tell(served, lambda line: silence(line, 1))
    operator = operator_of(site, mosquitto, slaves=[{"id": 1, "response_timeout": "10s"}])
    operator.send("device/read", {"id": "r", "device": "slave-1"})
    operator.send("device/read", {"id": "r", "device": "slave-1"}, correlation=b"repeat")
    operator.settled()
    assert operator.run.ends(signal.SIGTERM) == 0
    heard = [each for each in operator.responses if id_of(each) == "r"]
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
    eventually(lambda: any(id_of(each) == 0 for each in operator.responses), "the reading, which waits for the line")
    heard = operator.settled()
    assert {id_of(each): code for each, code in zip(heard, codes(heard), strict=True)} == {
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
