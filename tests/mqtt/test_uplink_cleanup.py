"""Retained topics of devices that are gone are read beside the samples, by real brokers."""

from __future__ import annotations

import asyncio
import logging
import subprocess
from collections.abc import Callable

import pytest

from lfs10d.mqtt.messages import Incoming
from lfs10d.mqtt.settings import Version
from lfs10d.system.secret import Secret
from tests.support.brokers import Mosquitto
from tests.support.uplinks import B, Site, running, until

PASSWORD = "correct-horse"  # noqa: S105 - of a broker in this test


@pytest.mark.parametrize("version", list(Version))
def test_what_is_left_over_comes_by_a_connection_of_its_own(
    mosquitto: Mosquitto, version: Version, monkeypatch: pytest.MonkeyPatch
) -> None:
    """So that the acknowledgements of samples do not wait behind it."""
    stranger = mosquitto.subscribe("x")
    gone = {f"{B}/device/gone-{number}/state" for number in range(500)}
    for topic in gone:
        stranger.publish(topic, "x", retain=True)

    async def scenario() -> None:
        listener = mosquitto.subscribe(f"{B}/device/+/state")
        site = Site(mosquitto.port, version=version)
        first: list[str] = []
        arrived = site.uplink.arrived

        def note(message: Incoming) -> None:
            first.append(message.topic)
            arrived(message)

        monkeypatch.setattr(site.uplink, "arrived", note)
        async with running(site) as uplink:
            await until(lambda: {each.topic for each in listener.heard if not each.payload} >= gone, "all cleared")
            assert uplink.connected
            assert gone.isdisjoint(first)
            assert f"{B}/availability" in first

    asyncio.run(scenario())
    assert " as gateway-retained " in mosquitto.log


@pytest.mark.needs("mosquitto_passwd")
def test_a_broker_that_gives_a_user_one_client_id_has_what_is_left_over_cleared_by_the_first(
    mosquitto: Mosquitto, program: Callable[[str], str], caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.INFO, logger="lfs10d.mqtt")
    passwords = mosquitto.folder / "passwords"
    passwords.touch()
    for user in ("gateway", "visitor"):
        subprocess.run([program("mosquitto_passwd"), "-b", str(passwords), user, PASSWORD], check=True)
    mosquitto.stop()
    mosquitto.configuration = [f"password_file {passwords}", "use_username_as_clientid true"]
    mosquitto.start()
    listener = mosquitto.subscribe(f"{B}/device/gone/state", username="visitor", password=PASSWORD)
    listener.publish(f"{B}/device/gone/state", "x", retain=True)

    async def scenario() -> None:
        site = Site(mosquitto.port, username="gateway", password=lambda: Secret(PASSWORD))
        async with running(site) as uplink:
            await until(lambda: any(not each.payload for each in listener.heard), "cleared")
            assert uplink.connected
            assert not uplink.duplicate
            assert site.changes == [True, False, True]

    asyncio.run(scenario())
    assert "the broker may permit one connection only" in caplog.text
    assert "is another client using our id" not in caplog.text
