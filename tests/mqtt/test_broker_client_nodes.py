"""A connection that comes back, to the node of several that accepts us."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import socket
import time
from collections.abc import Iterator

import pytest

from lfs10d.errors import BrokerError
from lfs10d.mqtt.broker_client import BrokerClient
from tests.support.broker_clients import PATIENCE, Witness, connecting, settings_of
from tests.support.brokers import Mosquitto


def test_a_lost_connection_comes_back(mosquitto: Mosquitto, caplog: pytest.LogCaptureFixture) -> None:
    async def scenario() -> None:
        async with connecting(settings_of(mosquitto.port)) as (client, witness):
            await client.opened(PATIENCE)
            mosquitto.kill()
            await witness.until(lambda: "ended" in witness.told)
            assert client.connection is None
            assert client.version is None
            mosquitto.start()
            await witness.until(lambda: witness.told == ["accepted", "ended", "accepted"])

    caplog.set_level(logging.INFO, "lfs10d.mqtt.broker_client")
    asyncio.run(scenario())
    told = [record.getMessage() for record in caplog.records if record.name == "lfs10d.mqtt.broker_client"]
    place = f"broker 127.0.0.1:{mosquitto.port}"
    assert told[0] == f"{place}: connected by MQTT 5"
    assert any(each.startswith(f"{place}: the connection is lost: ") for each in told)
    assert len(told) == len(set(told)) + 1, "each change of state is told once, connecting twice"


def test_a_dropped_connection_is_made_anew(mosquitto: Mosquitto) -> None:
    async def scenario() -> None:
        async with connecting(settings_of(mosquitto.port)) as (client, witness):
            await client.opened(PATIENCE)
            client.drop("of no use")
            assert [ended.message for ended in witness.endings] == [f"broker 127.0.0.1:{mosquitto.port}: of no use"]
            await witness.until(lambda: len(witness.acceptances) == 2)

    asyncio.run(scenario())


BACK_WITHIN = 3.0
"""Seconds from a broker's return to our connection."""


def test_a_broker_that_was_away_for_long_has_us_back_within_3_s(
    mosquitto: Mosquitto, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As many attempts as fit into 10 min fail, in a second: only the return is in real time."""

    async def scenario() -> None:
        async with connecting(settings_of(mosquitto.port)) as (client, witness):
            await client.opened(PATIENCE)
            monkeypatch.setattr("lfs10d.mqtt.reconnect.AWAY_EVERY", 0.01)
            mosquitto.kill()
            await witness.until(lambda: "ended" in witness.told)
            await asyncio.sleep(1.0)
            monkeypatch.setattr("lfs10d.mqtt.reconnect.AWAY_EVERY", 1.0)
            mosquitto.start()
            returned = time.monotonic()
            await witness.until(lambda: witness.told == ["accepted", "ended", "accepted"])
            assert time.monotonic() - returned < BACK_WITHIN

    asyncio.run(scenario())


def test_of_several_nodes_the_one_that_accepts_us_is_kept_until_it_is_gone(
    mosquitto: Mosquitto, second_mosquitto: Mosquitto, unused_port: int, caplog: pytest.LogCaptureFixture
) -> None:
    first, second = ("127.0.0.1", mosquitto.port), ("127.0.0.1", second_mosquitto.port)

    async def scenario() -> None:
        async with connecting(settings_of(unused_port, others=(first, second))) as (client, witness):
            await client.opened(PATIENCE)
            assert client.settings.port == mosquitto.port
            mosquitto.kill()
            await witness.until(lambda: len(witness.acceptances) == 2)
            assert client.settings.port == second_mosquitto.port
            mosquitto.start()
            await asyncio.sleep(1.5)
            assert client.settings.port == second_mosquitto.port
            second_mosquitto.kill()
            await witness.until(lambda: len(witness.acceptances) == 3)
            assert client.settings.port == mosquitto.port

    caplog.set_level(logging.INFO, "lfs10d.mqtt.broker_client")
    asyncio.run(scenario())
    told = [record.getMessage() for record in caplog.records if record.name == "lfs10d.mqtt.broker_client"]
    places = {port: f"broker 127.0.0.1:{port}" for port in (unused_port, mosquitto.port, second_mosquitto.port)}
    refused = f"{places[unused_port]}: connection refused: is the broker running, and mqtt.port right?"
    assert told[:2] == [
        f"{refused}; trying {places[mosquitto.port]} next",
        f"{places[mosquitto.port]}: connected by MQTT 5",
    ]


def test_a_verb_gives_up_when_no_node_accepts_it(unused_port: int) -> None:
    async def scenario() -> None:
        settings = settings_of(unused_port, others=(("localhost", unused_port),))
        async with connecting(settings) as (client, _):
            with pytest.raises(BrokerError, match=f"broker localhost:{unused_port}: connection refused"):
                await client.opened(PATIENCE)

    asyncio.run(scenario())


@contextlib.contextmanager
def black_hole() -> Iterator[int]:
    """Give a port where no connection is ever made: the kernel drops what its full queue cannot take."""
    with contextlib.ExitStack() as open_sockets:
        server = open_sockets.enter_context(socket.socket())
        server.bind(("127.0.0.1", 0))
        server.listen(0)
        for _ in range(4):
            filler = open_sockets.enter_context(socket.socket())
            filler.settimeout(0)
            filler.connect_ex(server.getsockname())
        yield server.getsockname()[1]


def test_a_host_that_swallows_everything_holds_up_neither_the_loop_nor_the_end() -> None:
    async def scenario(port: int) -> float:
        witness = Witness()
        client = BrokerClient(settings_of(port), witness)
        client.start()
        began = time.monotonic()
        with pytest.raises(BrokerError, match=r"no answer within 0\.2 s"):
            await client.opened(0.2)
        await client.leave(1.0)
        return time.monotonic() - began

    with black_hole() as port:
        assert asyncio.run(scenario(port)) < 1.5


def test_two_nodes_that_swallow_everything_do_not_keep_us_from_the_third(
    mosquitto: Mosquitto,
) -> None:
    async def scenario(holes: list[tuple[str, int]]) -> None:
        (host, port), *others = *holes, ("127.0.0.1", mosquitto.port)
        async with connecting(settings_of(port, host=host, others=tuple(others))) as (client, witness):
            await client.opened(PATIENCE)
            assert client.settings.port == mosquitto.port
            mosquitto.kill()
            await witness.until(lambda: len(witness.endings) == 1)
            mosquitto.start()
            returned = time.monotonic()
            await witness.until(lambda: len(witness.acceptances) == 2)
            assert time.monotonic() - returned < BACK_WITHIN

    with black_hole() as first, black_hole() as second:
        began = time.monotonic()
        asyncio.run(scenario([("127.0.0.1", first), ("127.0.0.1", second)]))
    assert mosquitto.log.count("as tester") == 2, "one session at a time"
    assert time.monotonic() - began < 2 * 5.0, "nobody waited for both"
