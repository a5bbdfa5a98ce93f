"""Hostile payloads and floods of them at a running daemon: answered or dropped, and the line goes on."""

from __future__ import annotations

import json
import signal
import subprocess
from collections.abc import Callable

import pytest

from docs.generate.contract import check
from soak.attestation import Oracle, epoch_of, parsed
from tests.support.brokers import Mosquitto
from tests.support.sites import Site, View, eventually, good

pytestmark = [pytest.mark.needs("mosquitto"), pytest.mark.needs("mosquitto_pub")]

BASE = "lfs10d/line0"
HOSTILE = {
    "nesting": (b"[" * 4000, "invalid_json"),
    "nested objects": (b'{"a":' * 600 + b"1" + b"}" * 600, "invalid_json"),
    "a huge number": (b'{"device":1e999}', "invalid_json"),
    "a long number": (b'{"device":' + b"9" * 4000 + b"}", "invalid_param"),
    "control characters": (b'{"device":"\\u001b]0;x\\u0007\\u0000"}', "invalid_param"),
    "no UTF-8": (b'{"device":"\xff\xfe"}', "invalid_json"),
    "UTF-16": ('{"device":"slave-1"}'.encode("utf-16"), "invalid_json"),
    "as large as is delivered": (b'{"device":"' + b"x" * 100_000 + b'"}', "too_large"),
}
MEGABYTE = b'{"device":"' + b"x" * 1_000_000 + b'"}'
FLOOD = 2000
"""Messages of each of two floods at once."""


def send(mosquitto: Mosquitto, pub: str, file: str, repeat: int) -> subprocess.Popen[bytes]:
    """Publish a file over and over, in a process of its own."""
    topic = f"{BASE}/request/device/read"
    command = [pub, "-p", str(mosquitto.port), "-t", topic, "-q", "0", "-f", file, "--repeat", str(repeat)]
    return subprocess.Popen(command)


@pytest.mark.parametrize("name", HOSTILE)
def test_a_hostile_payload_has_one_answer_with_its_code(
    site: Site, view: View, mosquitto: Mosquitto, name: str
) -> None:
    payload, code = HOSTILE[name]
    site.line()
    site.write()
    run = site.run()
    view.wait_samples("slave-1", 1, good)
    mosquitto.publish(f"{BASE}/request/device/read", payload)
    answer = view.wait("response/device/read")
    assert (answer["status"], answer["error"]["code"]) == ("rejected", code)
    view.wait_samples("slave-1", len(view.samples("slave-1")) + 2, good)
    assert len(view.history_of("response/device/read")) == 1
    assert "\x1b" not in run.log
    assert run.ends(signal.SIGTERM) == 0


@pytest.mark.parametrize("version", ["5", "3.1.1"])
def test_a_megabyte_stops_nothing_and_is_answered_where_the_broker_delivers_it(
    site: Site, view: View, mosquitto: Mosquitto, version: str
) -> None:
    """By MQTT 5 the broker keeps back what is larger than our Maximum Packet Size (MQTT 5.0, section 3.1.2.11.4)."""
    site.line()
    site.write(mqtt={"version": version})
    run = site.run()
    view.wait_samples("slave-1", 1, good)
    before = len(view.samples("slave-1"))
    mosquitto.publish(f"{BASE}/request/device/read", MEGABYTE)
    mosquitto.publish(f"{BASE}/request/device/read", json.dumps({"id": "next", "device": "slave-1"}))
    view.wait("response/device/read", lambda answer: answer["id"] == "next")
    answers = {each["id"]: each["error"] and each["error"]["code"] for each in view.history_of("response/device/read")}
    assert answers == {"next": None} | ({None: "too_large"} if version == "3.1.1" else {})
    view.wait_samples("slave-1", before + 2, good)
    assert view.history_of("availability") == ["online"], "the connection has lasted"
    assert run.ends(signal.SIGTERM) == 0


def test_during_a_flood_polls_go_on_and_no_number_is_wrong(
    site: Site, view: View, mosquitto: Mosquitto, program: Callable[[str], str]
) -> None:
    line = site.line()
    epoch = epoch_of(line.now)
    site.write(poll={"interval": "100ms"})
    run = site.run()
    view.wait_samples("slave-1", 5, good)
    small, large = site.folder / "small", site.folder / "large"
    small.write_bytes(b'{"device":')
    large.write_bytes(b'{"a":"' + b"x" * 100_000)
    pub = program("mosquitto_pub")
    before = len(view.samples("slave-1"))
    floods = [send(mosquitto, pub, str(file), FLOOD) for file in (small, large)]
    assert [flood.wait(60) for flood in floods] == [0, 0]
    mosquitto.publish(f"{BASE}/request/health", json.dumps({"id": "last"}))
    eventually(
        lambda: any(each["id"] == "last" for each in view.history_of("response/health")), "the answer after the flood"
    )
    view.wait_samples("slave-1", before + 5, good)
    assert run.ends(signal.SIGTERM) == 0
    for slave in (1, 2):
        samples = parsed((each.topic, each.payload) for each in view.heard)[f"slave-{slave}"]
        assert samples.judge(max(samples.by_seq)) == []
        found = Oracle(line.line.log, [], epoch=epoch).judge(f"slave-{slave}", slave, samples.in_order())
        assert (found.wrong, found.good > before) == ([], True)
    answers = [each for each in view.heard if each.topic == f"{BASE}/response/device/read"]
    assert answers
    for each in answers:
        check("response/device/read", each.payload.decode())
