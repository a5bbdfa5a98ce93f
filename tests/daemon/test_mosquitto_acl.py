"""The example files for mosquitto, tried on a real one: what each role may read and write, and what not."""

from __future__ import annotations

import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from docs.generate.contract import OUTBOUND
from lfs10d.commands.handlers.registry import HANDLERS
from tests.support.brokers import Listener, Mosquitto

pytestmark = pytest.mark.needs("mosquitto", "mosquitto_passwd")

FILES = Path(__file__).parents[2] / "config" / "mosquitto"

DAEMON, DASHBOARD, OPERATOR, ADMINISTRATOR = "daemon-line0", "dashboard", "operator", "administrator"
ROLES = (DAEMON, DASHBOARD, OPERATOR, ADMINISTRATOR)

NOT_AUTHORIZED = 0x87
"""Reason code of a refused publish (MQTT 5.0, section 3.4.2.1)."""

B = "lfs10d/line0"

CLASSES = {
    "health": "always",
    "republish": "always",
    "config/get": "always",
    "config/reload": "polling",
    "config/reset": "polling",
    "device/add": "polling",
    "device/remove": "polling",
    "device/options": "polling",
    "device/read": "polling",
    "device/readdress": "sensors",
    "line/baudrate": "sensors",
    "line/scan": "sensors",
    "line/adopt": "sensors",
    "line/trace": "sensors",
    "line/pause": "sensors",
    "line/cancel": "sensors",
    "register/read": "registers",
    "register/write": "registers",
} | {name: request.spec.klass for name, request in HANDLERS.items()}
"""Every request of the contract, and every one that the daemon knows, with its class."""

PUBLISHED = ["availability", *(row.topic.replace("+", "mast-top") for row in OUTBOUND if row.topic != "response/+/+")]
RESPONSES = {topic for topic in PUBLISHED if topic.startswith("response/")}


@pytest.fixture(name="broker")
def _broker(mosquitto: Mosquitto, program: Callable[[str], str]) -> Iterator[Mosquitto]:
    """Give a mosquitto with the example's rules, in which each role's password is its name."""
    mosquitto.stop()
    passwords = mosquitto.folder / "lfs10d.passwd"
    passwords.touch()
    for role in ROLES:
        # As docs/mqtt-security.md makes it, but for the question.
        subprocess.run([program("mosquitto_passwd"), "-b", str(passwords), role, role], check=True, capture_output=True)
    mosquitto.configuration = ["allow_anonymous false", f"password_file {passwords}", f"acl_file {FILES / 'acl'}"]
    mosquitto.start()
    yield mosquitto
    mosquitto.close()


def entered(broker: Mosquitto, role: str, filters: str = "#") -> Listener:
    return broker.subscribe(filters, username=role, password=role)


def test_without_a_login_nobody_gets_in(broker: Mosquitto, program: Callable[[str], str]) -> None:
    refused = subprocess.run(
        [program("mosquitto_pub"), "-p", str(broker.port), "-t", f"{B}/info", "-m", "x"],
        capture_output=True,
        text=True,
        check=False,
        timeout=30,
    )
    assert refused.returncode != 0
    assert "not authorised" in refused.stderr.lower()


@pytest.mark.parametrize("topic", PUBLISHED)
def test_the_daemon_may_publish_all_that_is_promised(broker: Mosquitto, topic: str) -> None:
    assert entered(broker, DAEMON, f"{B}/#").publish(f"{B}/{topic}", "x") != NOT_AUTHORIZED


@pytest.mark.parametrize("topic", ["lfs10d/line1/info", "lfs10d/line1/request/health", "lfs10d", "other/line0/info"])
def test_the_daemon_may_publish_nothing_outside_its_line(broker: Mosquitto, topic: str) -> None:
    listener = entered(broker, ADMINISTRATOR)
    daemon = entered(broker, DAEMON)
    assert daemon.publish(topic, "x") == NOT_AUTHORIZED
    daemon.publish(f"{B}/info", "end")
    listener.wait_for(f"{B}/info")
    assert not listener.on(topic)


def test_the_daemon_hears_requests_to_its_own_line_only(broker: Mosquitto) -> None:
    daemon = entered(broker, DAEMON)
    administrator = entered(broker, ADMINISTRATOR)
    administrator.publish("lfs10d/line1/request/health", "{}")
    administrator.publish(f"{B}/request/health", "{}")
    daemon.wait_for(f"{B}/request/health")
    assert not daemon.on("lfs10d/line1/request/health")


@pytest.mark.parametrize("role", [DASHBOARD, OPERATOR, ADMINISTRATOR])
def test_each_reader_hears_what_its_role_says(broker: Mosquitto, role: str) -> None:
    reader = entered(broker, role)
    administrator = entered(broker, ADMINISTRATOR, "lfs10d/never")
    for topic in (*PUBLISHED, "request/health"):
        administrator.publish(f"{B}/{topic}", "x")
    administrator.publish("lfs10d/line1/info", "end")
    reader.wait_for("lfs10d/line1/info")
    heard = {each.topic.removeprefix(f"{B}/") for each in reader.heard} - {"lfs10d/line1/info"}
    hidden = {*RESPONSES, "request/health"} if role == DASHBOARD else set()
    assert heard == {*PUBLISHED, "request/health"} - hidden


def test_what_is_retained_is_hidden_as_well(broker: Mosquitto) -> None:
    administrator = entered(broker, ADMINISTRATOR, "lfs10d/never")
    administrator.publish(f"{B}/request/health", "{}", retain=True)
    administrator.publish(f"{B}/info", "x", retain=True)
    dashboard = entered(broker, DASHBOARD)
    dashboard.wait_for(f"{B}/info")
    administrator.publish(f"{B}/event", "end")
    dashboard.wait_for(f"{B}/event")
    assert not dashboard.on(f"{B}/request/health")


def test_a_dashboard_may_publish_nothing(broker: Mosquitto) -> None:
    dashboard = entered(broker, DASHBOARD)
    topics = (*PUBLISHED, *(f"request/{name}" for name in CLASSES))
    assert {dashboard.publish(f"{B}/{topic}", "{}") for topic in topics} == {NOT_AUTHORIZED}


def test_an_operator_may_publish_no_readings(broker: Mosquitto) -> None:
    operator = entered(broker, OPERATOR)
    assert {operator.publish(f"{B}/{topic}", "{}") for topic in PUBLISHED} == {NOT_AUTHORIZED}


def test_an_operator_may_send_the_requests_of_always_and_polling_alone(broker: Mosquitto) -> None:
    operator = entered(broker, OPERATOR)
    sent = {name for name in CLASSES if operator.publish(f"{B}/request/{name}", "{}") != NOT_AUTHORIZED}
    assert sent == {name for name, klass in CLASSES.items() if klass in {"always", "polling"}}


def test_an_administrator_may_send_every_request(broker: Mosquitto) -> None:
    administrator = entered(broker, ADMINISTRATOR)
    assert NOT_AUTHORIZED not in {administrator.publish(f"{B}/request/{name}", "{}") for name in CLASSES}


def test_the_rule_for_many_daemons_gives_each_the_line_of_its_name(mosquitto: Mosquitto, tmp_path: Path) -> None:
    rule = next(line for line in (FILES / "acl").read_text().splitlines() if line.startswith("# pattern"))
    rules = tmp_path / "acl"
    rules.write_text(f"{rule.removeprefix('# ')}\n")
    mosquitto.stop()
    mosquitto.configuration = ["allow_anonymous true", f"acl_file {rules}"]
    mosquitto.start()
    daemon = mosquitto.subscribe("lfs10d/roof/#", username="roof")
    assert daemon.publish("lfs10d/roof/info", "x") != NOT_AUTHORIZED
    assert daemon.publish("lfs10d/mast/info", "x") == NOT_AUTHORIZED


def test_the_running_daemon_is_content_with_its_role(broker: Mosquitto, tmp_path: Path) -> None:
    (tmp_path / "password").write_text(f"{DAEMON}\n")
    file = tmp_path / "lfs10d.yaml"
    file.write_text(
        f"line: {{port: {tmp_path}/absent}}\nslaves: [2]\n"
        f"mqtt: {{host: 127.0.0.1, port: {broker.port}, username: {DAEMON}, password_file: password}}\n"
    )
    operator = entered(broker, OPERATOR)
    command = [sys.executable, "-m", "lfs10d", "run", "-c", str(file), "--state-dir", str(tmp_path / "state")]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as daemon:
        try:
            operator.wait_for(f"{B}/availability")
            operator.publish(f"{B}/request/health", '{"id": 1}')
            answer = operator.wait_for(f"{B}/response/health")[0]
        finally:
            daemon.send_signal(signal.SIGTERM)
            _, said = daemon.communicate(timeout=30)
    assert b'"status":"ok"' in answer.payload
    assert operator.wait_for(f"{B}/availability", 2)[-1].payload == b"offline"
    assert "refuses" not in said


@pytest.mark.needs("openssl")
def test_mosquitto_starts_with_the_example_of_a_listener(
    mosquitto: Mosquitto, tmp_path: Path, unused_port: int, program: Callable[[str], str]
) -> None:
    certificate, key, passwords = tmp_path / "broker.pem", tmp_path / "broker.key", tmp_path / "lfs10d.passwd"
    subprocess.run(
        [program("openssl"), "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes",
         "-days", "2", "-subj", "/CN=localhost", "-keyout", str(key), "-out", str(certificate)],
        check=True, capture_output=True,
    )  # fmt: skip
    subprocess.run([program("mosquitto_passwd"), "-c", "-b", str(passwords), OPERATOR, OPERATOR], check=True)
    text = (FILES / "listener.conf").read_text()
    for ours, theirs in (
        ("/etc/mosquitto/certs/broker.pem", certificate),
        ("/etc/mosquitto/certs/broker.key", key),
        ("/etc/mosquitto/lfs10d.passwd", passwords),
        ("/etc/mosquitto/lfs10d.acl", FILES / "acl"),
        ("listener 1883 127.0.0.1", f"listener {mosquitto.port} 127.0.0.1"),
        ("listener 8883", f"listener {unused_port}"),
    ):
        assert text.count(ours) >= 1
        text = text.replace(ours, str(theirs))
    mosquitto.stop()
    lines = [line for line in text.splitlines() if line and not line.startswith("#")]
    first = lines.index(f"listener {mosquitto.port} 127.0.0.1")
    mosquitto.configuration = [*lines[:first], *lines[first + 1 :], f"persistence_location {tmp_path}/"]
    mosquitto.start()
    assert f"Opening ipv4 listen socket on port {unused_port}" in mosquitto.log
    operator = entered(mosquitto, OPERATOR)
    assert operator.publish(f"{B}/request/health", "{}") != NOT_AUTHORIZED
