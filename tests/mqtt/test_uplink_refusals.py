"""What a real mosquitto refuses is reported once and stops nothing."""

from __future__ import annotations

import asyncio
import logging

import pytest

from tests.support.brokers import Mosquitto
from tests.support.old_brokers import OldBroker
from tests.support.outbox_items import named_event
from tests.support.uplinks import B, Site, online, running, sample, seqs, until

# What the broker does not take


def test_a_refused_topic_is_reported_once_stops_nothing_and_is_tried_again_at_reload(
    mosquitto: Mosquitto, caplog: pytest.LogCaptureFixture
) -> None:
    acl = mosquitto.folder / "acl"
    everything_but = "topic read #\n" + "".join(
        f"topic write {B}/{topic}\n" for topic in ("availability", "event", "device/b/#", "device/+/state")
    )
    acl.write_text(everything_but)
    mosquitto.stop()
    mosquitto.configuration = ["allow_anonymous true", f"acl_file {acl}"]
    mosquitto.start()

    async def scenario() -> None:
        listener = mosquitto.subscribe(f"{B}/#")
        site = Site(mosquitto.port, history_wait=1.0)
        async with running(site) as uplink:
            await online(listener)
            uplink.publish(sample(seq, device) for seq in (1, 2, 3) for device in "ab")
            await until(lambda: seqs(listener, "b") == {1, 2, 3}, "the permitted device")
            await until(lambda: "device/a/history" in caplog.text, "its history is refused too", within=15.0)
            assert (uplink.backlog.depth, uplink.backlog.dropped) == (3, 0)
            acl.write_text(f"topic readwrite {B}/#\n")
            mosquitto.reload()
            await asyncio.to_thread(lambda: listener.wait_for(f"{B}/availability", 1))
            await until(lambda: "Reloading config" in mosquitto.log, "mosquitto has read its ACL")
            await uplink.reload()
            await online(listener, 2)
            uplink.publish([sample(4)])
            await until(lambda: seqs(listener, "a") == {1, 2, 3, 4}, "all of the device that was refused")

    asyncio.run(scenario())
    warnings = [record.getMessage() for record in caplog.records if record.levelno == logging.WARNING]
    assert len([each for each in warnings if "device/a/telemetry: not authorized" in each]) == 1


def test_what_is_larger_than_the_broker_takes_is_reported_once_and_stops_nothing(
    mosquitto: Mosquitto, caplog: pytest.LogCaptureFixture
) -> None:
    mosquitto.stop()
    mosquitto.configuration.append("max_packet_size 1000")
    mosquitto.start()

    async def scenario() -> None:
        listener = mosquitto.subscribe(f"{B}/#")
        site = Site(mosquitto.port)
        async with running(site) as uplink:
            await online(listener)
            for _ in range(2):
                uplink.publish([named_event("too_much", text="x" * 1000)])
            uplink.publish([sample(1)])
            await until(lambda: seqs(listener) == {1}, "the sample")
            assert site.changes == [True]

    asyncio.run(scenario())
    [told] = [each for each in caplog.messages if "more than the 1000 that the broker takes" in each]
    assert f"not sent to {B}/event" in told


def test_what_is_no_json_is_reported_and_stops_nothing(mosquitto: Mosquitto, caplog: pytest.LogCaptureFixture) -> None:
    async def scenario() -> None:
        listener = mosquitto.subscribe(f"{B}/#")
        site = Site(mosquitto.port)
        async with running(site) as uplink:
            await online(listener)
            uplink.publish([named_event("odd", value=float("nan")), sample(1)])
            await until(lambda: seqs(listener) == {1}, "the sample")

    asyncio.run(scenario())
    assert "cannot be written as JSON" in caplog.text


def test_refused_subscriptions_are_reported(old_broker: OldBroker, caplog: pytest.LogCaptureFixture) -> None:
    async def scenario() -> None:
        old_broker.granted = b"\x80\x01"
        async with old_broker.running() as port, running(Site(port)) as uplink:
            await until(lambda: len(old_broker.published) == 4, "the burst")
            assert uplink.connected

    asyncio.run(scenario())
    told = [each for each in caplog.messages if "refuses to let us subscribe" in each]
    assert told == [f"the broker refuses to let us subscribe to {B}/request/#: reason code 0x80"]
