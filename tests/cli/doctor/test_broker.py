"""What the doctor says of a broker: a real mosquitto that is away, denies, has an expired certificate, is far off."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from bench.broker import free_port
from lfs10d.cli.doctor.broker import limits, look, reach
from lfs10d.cli.doctor.finding import Finding
from lfs10d.cli.login import Login, log_in
from lfs10d.config.models import TlsConfig
from lfs10d.mqtt.messages import Accepted
from lfs10d.mqtt.settings import BrokerSettings, Version
from tests.support.brokers import Authority, Mosquitto

pytestmark = pytest.mark.needs("mosquitto")


def login_to(folder: Path, port: int, more: str = "") -> Login:
    file = folder / "lfs10d.yaml"
    file.write_text(f"line: {{port: /dev/null}}\nslaves: [2]\nmqtt: {{host: localhost, port: {port}}}\n{more}")
    return log_in(file, "doctor", username=None, password_file=None)


def bad(findings: list[Finding]) -> list[Finding]:
    return [each for each in findings if each.level != "ok"]


def test_a_broker_that_is_well(mosquitto: Mosquitto, tmp_path: Path) -> None:
    found = asyncio.run(look(login_to(tmp_path, mosquitto.port), 2.0))
    assert bad(found) == []
    assert "logged in as no name by MQTT 5" in [each.text for each in found]
    assert "publishing below the base topic works" in found[-1].text
    assert mosquitto.retained() == {}, "nothing of it is left at the broker"


def test_a_broker_that_is_away_and_a_name_that_is_not_known(tmp_path: Path) -> None:
    (found,) = asyncio.run(look(login_to(tmp_path, free_port()), 2.0))
    assert (found.level, "connection refused" in found.text) == ("fail", True)
    (found,) = reach(BrokerSettings("nowhere.invalid", 1883, "x"))
    assert (found.level, "nowhere.invalid is not known" in found.text) == ("fail", True)


@pytest.mark.parametrize(
    ("rule", "words"),
    [("topic read lfs10d/#", "it refuses to publish"), ("topic write lfs10d/#", "does not arrive")],
)
def test_a_broker_that_denies_what_the_daemon_needs(
    rule: str, words: str, mosquitto: Mosquitto, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("lfs10d.cli.doctor.broker.ANSWERED_WITHIN", 2.0)
    mosquitto.stop()
    (mosquitto.folder / "acl").write_text(f"{rule}\n")
    mosquitto.configuration += [f"acl_file {mosquitto.folder / 'acl'}"]
    mosquitto.start()
    (found,) = bad(asyncio.run(look(login_to(tmp_path, mosquitto.port), 2.0)))
    assert found.level == "fail"
    assert words in found.text
    assert "ACL" in found.advice


def test_a_broker_that_wants_a_password(mosquitto: Mosquitto, tmp_path: Path) -> None:
    mosquitto.stop()
    mosquitto.configuration[:] = ["allow_anonymous false"]
    mosquitto.start()
    (found,) = bad(asyncio.run(look(login_to(tmp_path, mosquitto.port), 2.0)))
    assert (found.level, "not authorized" in found.text) == ("fail", True)


@pytest.mark.parametrize(
    ("name", "days", "level", "words", "advice"),
    [
        ("DNS:localhost", -1, "fail", "expired", "renew the broker's certificate"),
        ("DNS:localhost", 2, "warn", "its certificate ends on", "renew it before"),
        ("DNS:elsewhere", 2, "fail", "mismatch", "set mqtt.host to a name"),
    ],
)
def test_a_certificate_that_is_wrong_or_soon_will_be(
    name: str, days: int, level: str, words: str, advice: str, mosquitto: Mosquitto, authority: Authority,
    program: Callable[[str], str],
) -> None:  # fmt: skip
    program("openssl")
    mosquitto.stop()
    certificate, key = authority.issue("broker", name, days=days)
    mosquitto.listener += [f"certfile {certificate}", f"keyfile {key}"]
    mosquitto.start()
    (found,) = reach(BrokerSettings("localhost", mosquitto.port, "x", tls=TlsConfig(ca=authority.ca)))
    assert found.level == level
    assert words in found.text
    assert advice in found.advice


def test_a_certificate_for_years_and_a_plain_port(mosquitto: Mosquitto, authority: Authority) -> None:
    (found,) = reach(BrokerSettings("localhost", mosquitto.port, "x", tls=TlsConfig(ca=authority.ca)))
    assert (found.level, "is this the broker's TLS port" in found.advice) == ("fail", True)
    mosquitto.stop()
    certificate, key = authority.issue("broker", "DNS:localhost", days=400)
    mosquitto.listener += [f"certfile {certificate}", f"keyfile {key}"]
    mosquitto.start()
    (found,) = reach(BrokerSettings("localhost", mosquitto.port, "x", tls=TlsConfig(ca=authority.ca)), time.time())
    assert (found.level, "certificate until" in found.text) == ("ok", True)


def test_limits_are_compared_with_what_the_polls_need() -> None:
    (well,) = limits(Accepted(Version.V5, 20), 0.05, 10.0)
    assert well.text.endswith("round trip 50 ms, window 20: 400 messages/s, needed 10.0")
    (slow,) = limits(Accepted(Version.V5, 10), 1.0, 32.0)
    assert (slow.level, "mqtt.telemetry: false" in slow.advice) == ("warn", True)
    *_, small = limits(Accepted(Version.V5, 20, 4096), 0.05, 10.0)
    assert (small.level, "at most 4096 bytes" in small.text) == ("warn", True)


def test_discovery_that_nobody_announced_is_named(
    mosquitto: Mosquitto, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("lfs10d.cli.doctor.broker.RETAINED_WITHIN", 0.3)
    login = login_to(tmp_path, mosquitto.port, "homeassistant: {discovery: true}\n")
    (found,) = bad(asyncio.run(look(login, 2.0)))
    assert (found.area, found.level) == ("integrations", "fail")
    mosquitto.publish("homeassistant/device/lfs10d_lfs10d_line0/config", "{}", retain=True)
    assert bad(asyncio.run(look(login, 2.0))) == []
