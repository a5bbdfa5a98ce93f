"""The client finds, keeps and leaves a broker, and says in words why it cannot."""

from __future__ import annotations

import asyncio
import logging
import threading
from collections.abc import Callable
from contextlib import AbstractAsyncContextManager
from typing import TypeAlias

import pytest

from lfs10d.errors import BrokerError
from lfs10d.mqtt.broker_client import BrokerClient
from lfs10d.mqtt.messages import Filter, Incoming
from lfs10d.mqtt.reasons import DisconnectReason
from lfs10d.mqtt.settings import Version
from lfs10d.system.secret import Secret
from tests.support.broker_clients import PATIENCE, Witness, connecting, settings_of
from tests.support.brokers import Mosquitto
from tests.support.old_brokers import Answer, OldBroker

Serving: TypeAlias = Callable[[Answer], AbstractAsyncContextManager[int]]


# What a connection can do


def test_messages_go_and_come_with_all_that_belongs_to_them(mosquitto: Mosquitto) -> None:
    async def scenario() -> None:
        async with connecting(settings_of(mosquitto.port)) as (client, witness):
            accepted = await client.opened(PATIENCE)
            assert accepted is await client.opened(PATIENCE)
            assert accepted.version is Version.V5
            connection = client.connection
            assert connection is not None
            subscription = connection.subscribe([Filter("in/#"), Filter("in/too", qos=0)])
            await witness.until(lambda: subscription in witness.subscriptions)
            assert subscription is not None
            assert witness.subscriptions[subscription] == (1, 0)
            mid = connection.publish("in/x", b"payload", retain=True, correlation=b"\0\1")
            await witness.until(lambda: len(witness.messages) == 1 and mid in witness.acknowledgements)
            assert witness.messages == [Incoming("in/x", b"payload", retained=True, correlation=b"\0\1")]
            connection.unsubscribe(["in/#", "in/too"])
            later = connection.publish("in/y", b"")
            await witness.until(lambda: later in witness.acknowledgements)
            assert witness.acknowledgements == {mid: 0, later: 0x10}
            assert len(witness.messages) == 1

    asyncio.run(scenario())


def answering(*packets: bytes) -> Answer:
    """Return a broker that takes anybody, and then says this and nothing more."""

    async def answer(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        await reader.read(1000)
        writer.write(b"\x20\x03\x00\x00\x00" + b"".join(packets))
        while await reader.read(1000):
            pass

    return answer


def test_what_is_published_under_the_cork_goes_by_one_segment_when_it_is_taken_off(serving: Serving) -> None:
    segments: list[bytes] = []
    come = asyncio.Event()

    async def answer(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        await reader.read(1000)
        writer.write(b"\x20\x03\x00\x00\x00")
        while data := await reader.read(1000):
            segments.append(data)
            come.set()

    async def scenario() -> None:
        async with serving(answer) as port, connecting(settings_of(port)) as (client, _):
            await client.opened(PATIENCE)
            connection = client.connection
            assert connection is not None
            connection.cork(on=True)
            for number in range(3):
                connection.publish("t", b"%d" % number, qos=0)
                await asyncio.sleep(0.01)
            assert segments == []
            connection.cork(on=False)
            await asyncio.wait_for(come.wait(), PATIENCE)
            assert segments == [b"".join(b"\x30\x05\x00\x01t\x00%d" % number for number in range(3))]
            connection.abandon()
            connection.cork(on=True)  # of a socket that is closed: nothing to be said

    asyncio.run(scenario())


def test_a_topic_that_is_no_utf_8_is_passed_over(serving: Serving, caplog: pytest.LogCaptureFixture) -> None:
    """A broker should not forward one, but this one does."""
    broker = answering(b"\x30\x05\x00\x02\xc3\x28\x00", b"\x30\x04\x00\x01t\x00")

    async def scenario() -> None:
        async with serving(broker) as port, connecting(settings_of(port)) as (_, witness):
            await witness.until(lambda: bool(witness.messages))
            assert [each.topic for each in witness.messages] == ["t"]

    asyncio.run(scenario())
    assert "Traceback" not in caplog.text


@pytest.mark.parametrize("garbage", [b"\x00\x00", b"\x30\xff\xff\xff\xff\xff", b"\x40\x00"])
def test_garbage_from_a_broker_ends_the_connection_and_no_more(
    serving: Serving, garbage: bytes, caplog: pytest.LogCaptureFixture
) -> None:
    async def scenario() -> None:
        async with serving(answering(garbage)) as port, connecting(settings_of(port)) as (_, witness):
            await witness.until(lambda: "ended" in witness.told)

    asyncio.run(scenario())
    assert "Traceback" not in caplog.text


def test_a_reason_code_that_nobody_knows_is_an_answer_like_any_other(serving: Serving) -> None:
    broker = answering(b"\x40\x03\x00\x01\x95", b"\x40\x03\x00\x02\xf7", b"\xe0\x01\xd3")

    async def scenario() -> None:
        async with serving(broker) as port, connecting(settings_of(port)) as (_, witness):
            await witness.until(lambda: bool(witness.endings))
            [ended] = witness.endings[:1]
            assert (ended.ending, ended.reason, ended.by_message) == (DisconnectReason.LOST, 0xD3, True)

    asyncio.run(scenario())


@pytest.mark.parametrize("said", [b"\x20\x03\x00\x00\x00", b"\x20\x06\x00\x00\x03\x13\x00\x01"])
def test_a_broker_that_answers_no_ping_is_given_up(serving: Serving, said: bytes) -> None:
    """Where it names a keepalive, that one counts."""
    heard = bytearray()

    async def answer(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        await reader.read(1000)
        for byte in said:
            writer.write(bytes((byte,)))
            await writer.drain()
        while data := await reader.read(1000):
            heard.extend(data)

    async def scenario() -> None:
        keepalive = 1 if len(said) == 5 else 60
        async with serving(answer) as port, connecting(settings_of(port, keepalive=keepalive)) as (_, witness):
            await witness.until(lambda: "ended" in witness.told)

    asyncio.run(scenario())
    assert heard == b"\xc0\x00"


def test_a_quiet_connection_is_kept_by_pings(mosquitto: Mosquitto) -> None:
    async def scenario() -> None:
        async with connecting(settings_of(mosquitto.port, keepalive=1)) as (client, witness):
            await client.opened(PATIENCE)
            await asyncio.sleep(3.5)  # three times as long as a broker may wait
            assert witness.told == ["accepted"]

    asyncio.run(scenario())


# 3.1.1


@pytest.mark.parametrize("refused_by", [b"\x20\x02\x00\x01", b"\x20\x03\x00\x84\x00", b"", None])
@pytest.mark.long(11)
def test_a_broker_that_refuses_5_is_spoken_to_in_3_1_1_with_one_warning(
    old_broker: OldBroker, refused_by: bytes | None, caplog: pytest.LogCaptureFixture
) -> None:
    async def scenario() -> None:
        old_broker.refusal = refused_by
        async with old_broker.running() as port, connecting(settings_of(port)) as (client, witness):
            assert (await client.opened(PATIENCE)).version is Version.V311
            connection = client.connection
            assert connection is not None
            mid = connection.publish("t", b"x", correlation=b"ignored")
            subscription = connection.subscribe([Filter("in")])
            await witness.until(lambda: mid in witness.acknowledgements and subscription in witness.subscriptions)
            assert old_broker.published == [("t", b"x")]
            client.drop("for the test")
            await witness.until(lambda: len(witness.acceptances) == 2)
        assert old_broker.levels == [5, 4, 5, 4]

    asyncio.run(scenario())
    assert sum("refuses MQTT 5" in record.getMessage() for record in caplog.records) == 1


def test_3_1_1_is_spoken_at_once_where_configured(old_broker: OldBroker, caplog: pytest.LogCaptureFixture) -> None:
    async def scenario() -> None:
        settings = {"version": Version.V311}
        async with old_broker.running() as port, connecting(settings_of(port, **settings)) as (client, _):
            await client.opened(PATIENCE)
        assert old_broker.levels == [4]

    asyncio.run(scenario())
    assert not [record for record in caplog.records if record.levelno >= logging.WARNING]


def test_a_broker_that_tells_of_the_takeover_is_believed_at_once(
    serving: Serving, caplog: pytest.LogCaptureFixture
) -> None:
    async def scenario() -> None:
        broker = answering(b"\xe0\x02\x8e\x00")
        async with serving(broker) as port, connecting(settings_of(port)) as (client, witness):
            await witness.until(lambda: "ended" in witness.told)
            assert client.duplicate

    asyncio.run(scenario())
    assert "another client has connected with our client id" in caplog.text
    assert "trying again in 60 s" in caplog.text


@pytest.mark.parametrize("said", [b"\xe0\x02\x8e\x00", b""])
def test_a_broker_that_ends_the_first_connection_for_our_second_has_shown_no_other_client(
    serving: Serving, said: bytes
) -> None:
    """As mosquitto does with `use_username_as_clientid`."""
    writers: list[asyncio.StreamWriter] = []

    async def answer(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        await reader.read(1000)
        for before in writers:
            before.write(said)
            before.close()
        writers[:] = [writer]
        writer.write(b"\x20\x03\x00\x00\x00")
        await reader.read(1000)

    async def scenario() -> None:
        async with serving(answer) as port:
            witness, beside = Witness(), Witness()
            client = BrokerClient(settings_of(port), witness, chance=lambda: 1.0, has_second=lambda: True)
            client.start()
            await client.opened(PATIENCE)
            second = client.beside(beside, "-retained")
            await witness.until(lambda: "ended" in witness.told)
            second.abandon()
            assert not client.duplicate
            await client.opened(3.0)
            await client.leave(1.0)

    asyncio.run(scenario())


def test_what_is_given_up_before_it_was_open_never_speaks_to_the_broker(mosquitto: Mosquitto) -> None:
    given_up = threading.Event()
    others = threading.enumerate()

    def password() -> Secret:
        given_up.wait(PATIENCE)
        return Secret("x")

    async def scenario() -> None:
        client = BrokerClient(settings_of(mosquitto.port, username="gate", password=password), Witness())
        client.start()
        await client.leave(1.0)
        given_up.set()
        for each in threading.enumerate():
            if each not in others and each.name.startswith(("connect", "paho")):
                await asyncio.to_thread(each.join, PATIENCE)

    asyncio.run(scenario())
    assert "New client connected" not in mosquitto.log


def test_waiters_are_all_told_and_a_late_one_is_told_no_more(mosquitto: Mosquitto) -> None:
    async def scenario() -> None:
        client = BrokerClient(settings_of(mosquitto.port), Witness())
        with pytest.raises(BrokerError):
            await client.opened(0.0)
        early = asyncio.create_task(client.opened(PATIENCE))
        await asyncio.sleep(0)
        client.start()
        assert await early is await client.opened(PATIENCE)
        await client.leave(1.0)

    asyncio.run(scenario())


def test_a_server_that_says_nothing_holds_up_nothing_either(serving: Serving) -> None:
    async def scenario() -> None:
        heard, gone = asyncio.Event(), asyncio.Event()

        async def silent(reader: asyncio.StreamReader, _writer: asyncio.StreamWriter) -> None:
            await reader.read(1)
            heard.set()
            await reader.read()
            gone.set()

        async with serving(silent) as port:
            client = BrokerClient(settings_of(port), Witness())
            client.start()
            await asyncio.wait_for(heard.wait(), PATIENCE)
            await client.leave(1.0)
            await asyncio.wait_for(gone.wait(), PATIENCE)

    asyncio.run(scenario())
