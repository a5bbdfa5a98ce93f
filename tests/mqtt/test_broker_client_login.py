"""Passwords and certificates, and the words where they are refused."""

from __future__ import annotations

import asyncio
import logging
import subprocess
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from lfs10d.config.models import TlsConfig
from lfs10d.errors import BrokerError
from lfs10d.mqtt.settings import BrokerSettings
from lfs10d.system.secret import Secret
from tests.support.broker_clients import PATIENCE, connecting, settings_of
from tests.support.brokers import Authority, Mosquitto


async def refusal(settings: BrokerSettings) -> str:
    """Return what a person is told when no connection can be made."""
    async with connecting(settings) as (client, _):
        with pytest.raises(BrokerError) as caught:
            await client.opened(PATIENCE)
        return str(caught.value)


# Names and passwords


def with_password(broker: Mosquitto, program: Callable[[str], str], folder: Path) -> None:
    """Let only `gate` with password `correct-horse` in."""
    subprocess.run(
        [program("mosquitto_passwd"), "-b", "-c", str(folder / "passwords"), "gate", "correct-horse"], check=True
    )
    broker.stop()
    broker.configuration = ["allow_anonymous false", f"password_file {folder / 'passwords'}"]
    broker.start()


def test_the_password_is_read_at_each_connect(
    mosquitto: Mosquitto, program: Callable[[str], str], tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.DEBUG)
    with_password(mosquitto, program, tmp_path)
    passwords = iter(["hunter2", "correct-horse"])

    async def scenario() -> None:
        settings = settings_of(mosquitto.port, username="gate", password=lambda: Secret(next(passwords)))
        async with connecting(settings) as (client, witness):
            with pytest.raises(BrokerError, match="not authorized: check"):
                await client.opened(PATIENCE)
            await witness.until(lambda: bool(witness.acceptances))

    asyncio.run(scenario())
    assert "hunter2" not in caplog.text
    assert "correct-horse" not in caplog.text


def test_a_password_that_cannot_be_read_is_said(mosquitto: Mosquitto, tmp_path: Path) -> None:
    def password() -> Secret:
        return Secret((tmp_path / "gone").read_text())

    told = asyncio.run(refusal(settings_of(mosquitto.port, username="gate", password=password)))
    assert told == f"broker 127.0.0.1:{mosquitto.port}: {tmp_path / 'gone'}: no such file or directory"


# TLS


def with_tls(broker: Mosquitto, authority: Authority, *names: str, more: tuple[str, ...] = ()) -> None:
    """Let the broker speak TLS with a certificate for these names."""
    certificate, key = authority.issue("broker", *names)
    broker.stop()
    broker.listener = [f"cafile {authority.ca}", f"certfile {certificate}", f"keyfile {key}", *more]
    broker.start()


def test_tls_with_the_right_authority_connects(mosquitto: Mosquitto, authority: Authority) -> None:
    with_tls(mosquitto, authority, "DNS:localhost")

    async def scenario() -> None:
        settings = settings_of(mosquitto.port, host="localhost", tls=TlsConfig(ca=authority.ca))
        async with connecting(settings) as (client, witness):
            await client.opened(PATIENCE)
            connection = client.connection
            assert connection is not None
            mid = connection.publish("t", b"x" * 100_000)
            await witness.until(lambda: mid in witness.acknowledgements)

    asyncio.run(scenario())


def test_tls_with_a_certificate_of_our_own_connects(mosquitto: Mosquitto, authority: Authority) -> None:
    with_tls(mosquitto, authority, "DNS:localhost", more=("require_certificate true",))
    certificate, key = authority.issue("gate")

    async def scenario() -> None:
        tls = TlsConfig(ca=authority.ca, cert=certificate, key=key)
        async with connecting(settings_of(mosquitto.port, host="localhost", tls=tls)) as (client, _):
            await client.opened(PATIENCE)

    asyncio.run(scenario())


def test_an_unknown_authority_is_not_accepted(mosquitto: Mosquitto, authority: Authority) -> None:
    with_tls(mosquitto, authority, "DNS:localhost")
    told = asyncio.run(refusal(settings_of(mosquitto.port, host="localhost", tls=TlsConfig())))
    assert "the certificate is not accepted: " in told
    assert "check mqtt.host, mqtt.tls.ca and the clock" in told


def test_another_host_name_is_not_accepted(mosquitto: Mosquitto, authority: Authority) -> None:
    with_tls(mosquitto, authority, "DNS:elsewhere.example")
    told = asyncio.run(refusal(settings_of(mosquitto.port, host="localhost", tls=TlsConfig(ca=authority.ca))))
    assert "Hostname mismatch" in told


def test_tls_1_1_is_not_spoken(unused_port: int, authority: Authority, program: Callable[[str], str]) -> None:
    """OpenSSL's own server offers what mosquitto no longer can."""
    certificate, key = authority.issue("broker", "DNS:localhost")
    with subprocess.Popen(
        [program("openssl"), "s_server", "-accept", f"127.0.0.1:{unused_port}", "-cert", certificate,
         "-key", key, "-tls1_1", "-cipher", "ALL:@SECLEVEL=0", "-quiet"],
        stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    ) as server:  # fmt: skip
        try:
            told = "connection refused"
            deadline = time.monotonic() + PATIENCE
            while "connection refused" in told and time.monotonic() < deadline:
                told = asyncio.run(refusal(settings_of(unused_port, host="localhost", tls=TlsConfig(ca=authority.ca))))
        finally:
            server.kill()
    assert "no TLS: " in told


def test_a_plain_port_spoken_to_by_tls_is_said(mosquitto: Mosquitto) -> None:
    told = asyncio.run(refusal(settings_of(mosquitto.port, tls=TlsConfig())))
    assert "check mqtt.port" in told
    assert "TLS" in told


def test_a_tls_port_spoken_to_in_plain_is_said(mosquitto: Mosquitto, authority: Authority) -> None:
    with_tls(mosquitto, authority, "DNS:localhost")
    told = asyncio.run(refusal(settings_of(mosquitto.port)))
    assert told.endswith("closed the connection without an answer: check mqtt.port and mqtt.tls")


# Brokers that are not there


def test_a_refused_connection_is_said_and_tried_again(unused_port: int) -> None:
    told = asyncio.run(refusal(settings_of(unused_port)))
    assert told == f"broker 127.0.0.1:{unused_port}: connection refused: is the broker running, and mqtt.port right?"


def test_a_name_that_does_not_exist_is_said() -> None:
    told = asyncio.run(refusal(settings_of(1883, host="broker.invalid")))
    assert told.startswith("broker broker.invalid:1883: the name broker.invalid cannot be resolved")


def test_a_name_that_is_none_is_said() -> None:
    told = asyncio.run(refusal(settings_of(1883, host="a" * 70 + ".example")))
    assert told.startswith(f"broker {'a' * 70}.example:1883: ")
