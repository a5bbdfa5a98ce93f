"""Requests as the uplink receives them: whole, once, retained or not."""

from __future__ import annotations

import asyncio

from lfs10d.mqtt.retained_requests import ASK_AFTER
from lfs10d.mqtt.settings import Version
from tests.support.brokers import Mosquitto
from tests.support.uplinks import B, Site, online, running, sample, seqs, until


def test_a_request_arrives_with_all_that_belongs_to_it_and_is_answered_to_its_own(mosquitto: Mosquitto) -> None:
    async def scenario() -> None:
        listener = mosquitto.subscribe(f"{B}/response/#")
        site = Site(mosquitto.port)
        async with running(site) as uplink:
            await until(lambda: uplink.connected, "connected")
            listener.publish(
                f"{B}/request/device/read", b'{"id":1}', response_topic=f"{B}/response/mine", correlation=b"\0\1"
            )
            await until(lambda: bool(site.requests), "the request")
            [request] = site.requests
            assert (request.levels, request.payload, request.retained) == (("device", "read"), b'{"id":1}', False)
            assert request.response_topic is not None
            uplink.respond(request.response_topic, {"id": 1}, request.correlation)
            [heard] = await asyncio.to_thread(listener.wait_for, f"{B}/response/mine")
            assert (heard.payload, heard.correlation, heard.retain, heard.qos) == (b'{"id":1}', b"\0\1", False, 1)

    asyncio.run(scenario())


def test_a_retained_request_is_known_as_such_and_can_be_cleared(mosquitto: Mosquitto) -> None:
    mosquitto.publish(f"{B}/request/health", "{}", retain=True)

    async def scenario() -> None:
        listener = mosquitto.subscribe(f"{B}/availability")
        site = Site(mosquitto.port)
        async with running(site) as uplink:
            await online(listener)
            listener.publish(f"{B}/request/republish", "{}", retain=True)
            await until(lambda: len(site.requests) == 2, "both requests")
            assert [(each.topic, each.retained) for each in site.requests] == [
                ("request/health", True),
                ("request/republish", True),
            ]
            for each in site.requests:
                uplink.clear_retained(each.topic)
            await until(lambda: len(site.requests) == 4, "our own clearing, seen again")
            assert [each.payload for each in site.requests[2:]] == [b"", b""]

    asyncio.run(scenario())
    assert mosquitto.retained(f"{B}/request/#") == {}


def test_a_flood_of_requests_arrives_whole_and_holds_up_no_sample(mosquitto: Mosquitto) -> None:
    async def scenario() -> None:
        listener = mosquitto.subscribe(f"{B}/#")
        site = Site(mosquitto.port)
        async with running(site) as uplink:
            await online(listener)
            await asyncio.to_thread(lambda: [listener.publish(f"{B}/request/x", "{}") for _ in range(300)])
            uplink.publish([sample(1)])
            await until(lambda: len(site.requests) == 300 and seqs(listener) == {1}, "everything")

    asyncio.run(scenario())


# Retained requests by 3.1.1


def test_a_retained_request_by_3_1_1_comes_once_as_a_request_and_at_once_again_as_retained(
    mosquitto: Mosquitto,
) -> None:
    """The second is rejected and cleared, as at the next connect; one that is not retained comes once."""

    async def scenario() -> None:
        listener = mosquitto.subscribe(f"{B}/#")
        site = Site(mosquitto.port, version=Version.V311)
        async with running(site) as uplink:
            await online(listener)
            mosquitto.publish(f"{B}/request/health", '{"id":1}')
            mosquitto.publish(f"{B}/request/device/read", '{"id":2}', retain=True)
            await until(lambda: len(site.requests) == 3, "both, and the copy")
            told = [(each.topic, each.retained) for each in site.requests]
            copy = ("request/device/read", True)
            assert told == [("request/health", False), ("request/device/read", False), copy]
            uplink.clear_retained("request/device/read")
            await until(lambda: len(site.requests) == 4, "the clearing, of which we hear too")
            mosquitto.publish(f"{B}/request/health", '{"id":3}')
            await until(lambda: len(site.requests) >= 5, "the next")
            await asyncio.sleep(2 * ASK_AFTER)
            assert [each.payload for each in site.requests[3:]] == [b"", b'{"id":3}']
            assert uplink.connected

    asyncio.run(scenario())
    assert not mosquitto.retained(f"{B}/request/#")


def test_a_connection_that_is_lost_before_the_question_asks_nothing(mosquitto: Mosquitto) -> None:
    async def scenario() -> None:
        listener = mosquitto.subscribe(f"{B}/#")
        site = Site(mosquitto.port, version=Version.V311)
        async with running(site):
            await online(listener)
            mosquitto.publish(f"{B}/request/health", '{"id":1}')
            await until(lambda: len(site.requests) == 1, "the request")
        await asyncio.sleep(2 * ASK_AFTER)
        assert len(site.requests) == 1

    asyncio.run(scenario())
