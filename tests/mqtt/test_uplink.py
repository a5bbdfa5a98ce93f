"""The daemon's uplink against a real mosquitto, seen by an independent MQTT 5 subscriber."""

from __future__ import annotations

import asyncio
import json
import signal
import time
from pathlib import Path

import pytest

from lfs10d.mqtt.settings import Version
from lfs10d.outbox.history import QueuedSample
from lfs10d.outbox.store.database import Limits
from lfs10d.outbox.store.sample_file import StoreBatch
from lfs10d.outbox.store.store import Store
from lfs10d.telemetry import publication
from tests.support.brokers import Mosquitto
from tests.support.old_brokers import OldBroker
from tests.support.uplinks import B, Site, online, running, sample, seqs, until

# Coming


def test_the_burst_is_first_online_is_last_in_it_and_live_samples_follow(mosquitto: Mosquitto) -> None:
    async def scenario() -> None:
        listener = mosquitto.subscribe(f"{B}/#")
        site = Site(mosquitto.port)
        async with running(site) as uplink:
            uplink.publish([sample(1)])
            await until(lambda: seqs(listener) == {1}, "the sample")
            assert [(each.topic.removeprefix(f"{B}/"), each.retain, each.qos) for each in listener.heard] == [
                ("device/a/state", True, 1),
                ("device/b/state", True, 1),
                ("device/c/state", True, 1),
                ("availability", True, 1),
                ("device/a/telemetry", False, 1),
            ]
            assert (uplink.connected, uplink.version, uplink.duplicate) == (True, Version.V5, False)
            await until(lambda: uplink.backlog.depth == 0, "its acknowledgement")

    asyncio.run(scenario())


def test_a_burst_larger_than_the_window_arrives_whole_before_online(mosquitto: Mosquitto) -> None:
    async def scenario() -> None:
        listener = mosquitto.subscribe(f"{B}/#")
        site = Site(mosquitto.port)
        site.retained = {f"device/d{number}/state": {"device": str(number)} for number in range(200)}
        async with running(site):
            await online(listener)
            assert [each.topic for each in listener.heard] == [
                *(f"{B}/device/d{number}/state" for number in range(200)),
                f"{B}/availability",
            ]

    asyncio.run(scenario())


def test_by_3_1_1_it_works_too(old_broker: OldBroker) -> None:
    async def scenario() -> None:
        async with old_broker.running() as port, running(Site(port)) as uplink:
            uplink.publish([sample(1)])
            await until(lambda: len(old_broker.published) == 5, "everything")
            assert uplink.version is Version.V311
        assert [topic.removeprefix(f"{B}/") for topic, _ in old_broker.published] == [
            "device/a/state", "device/b/state", "device/c/state", "availability", "device/a/telemetry", "availability",
        ]  # fmt: skip

    asyncio.run(scenario())


# Going


def test_a_clean_exit_sends_what_waits_and_changes_availability_only(mosquitto: Mosquitto) -> None:
    async def scenario() -> None:
        listener = mosquitto.subscribe(f"{B}/#")
        site = Site(mosquitto.port)
        async with running(site) as uplink:
            await online(listener)
            uplink.publish([sample(1)])
        await until(lambda: len(listener.heard) == 6, "the end")
        assert [each.payload for each in listener.heard[-2:]] == [listener.heard[-2].payload, b"offline"]
        assert seqs(listener) == {1}
        assert not uplink.connected

    asyncio.run(scenario())
    retained = mosquitto.retained(f"{B}/#")
    assert retained.pop(f"{B}/availability") == b"offline"
    assert set(retained) == {f"{B}/device/{name}/state" for name in "abc"}


def test_the_will_says_offline_when_there_is_no_clean_exit(mosquitto: Mosquitto) -> None:
    async def scenario() -> None:
        listener = mosquitto.subscribe(f"{B}/availability")
        site = Site(mosquitto.port)
        async with running(site) as uplink:
            await online(listener)
            uplink._client.drop("for the test")
            await online(listener, 2)
            assert [each.payload for each in listener.heard] == [b"online", b"offline", b"online"]

    asyncio.run(scenario())


def test_a_broker_that_hangs_does_not_hold_up_the_end(mosquitto: Mosquitto) -> None:
    async def scenario() -> float:
        listener = mosquitto.subscribe(f"{B}/#")
        site = Site(mosquitto.port)
        await site.uplink.start(site, on_request=site.on_request, on_spool_trouble=site.on_spool_trouble)
        await online(listener)
        assert mosquitto.process is not None
        mosquitto.process.send_signal(signal.SIGSTOP)
        site.uplink.publish([sample(1)])
        began = time.monotonic()
        await site.uplink.stop()
        took = time.monotonic() - began
        mosquitto.process.send_signal(signal.SIGCONT)
        return took

    assert asyncio.run(scenario()) < 1.5


def test_it_stops_while_it_is_still_trying(unused_port: int) -> None:
    async def scenario() -> None:
        site = Site(unused_port)
        async with running(site) as uplink:
            uplink.publish([sample(1)])
            assert uplink.backlog.depth == 1
        assert site.changes == []

    asyncio.run(scenario())


# Other people


def test_offline_heard_while_connected_is_answered_with_online(mosquitto: Mosquitto) -> None:
    async def scenario() -> None:
        listener = mosquitto.subscribe(f"{B}/availability")
        async with running(Site(mosquitto.port)):
            await online(listener)
            listener.publish(f"{B}/availability", "offline", retain=True)
            await online(listener, 2)

    asyncio.run(scenario())
    assert mosquitto.retained(f"{B}/availability") == {f"{B}/availability": b"offline"}


def test_another_client_with_our_id_is_not_fought(mosquitto: Mosquitto, caplog: pytest.LogCaptureFixture) -> None:
    async def scenario() -> None:
        listener = mosquitto.subscribe(f"{B}/availability")
        site = Site(mosquitto.port)
        async with running(site) as uplink:
            await online(listener)
            mosquitto.subscribe("x", client_id="gateway")
            await until(lambda: uplink.duplicate, "the takeover")
            assert not uplink.connected
            assert site.changes[:2] == [True, False]

    asyncio.run(scenario())
    assert "is another client using our id gateway? trying again in 60 s" in caplog.text


# The broker goes and comes


@pytest.mark.long(16)
def test_nothing_is_lost_when_the_broker_is_killed_and_comes_back(mosquitto: Mosquitto) -> None:
    """Away for more than three seconds, without persistence; the subscriber is back before the backlog is opened."""

    async def scenario() -> None:
        listener = mosquitto.subscribe(f"{B}/#")
        site = Site(mosquitto.port)
        sent = 0
        async with running(site) as uplink:
            await online(listener)

            async def measure(seconds: float) -> None:
                nonlocal sent
                end = time.monotonic() + seconds
                while time.monotonic() < end:
                    sent += 1
                    uplink.publish([sample(sent, "a"), sample(sent, "b")])
                    await asyncio.sleep(0.01)

            await measure(0.5)
            mosquitto.kill()
            await measure(3.5)
            mosquitto.start()
            await until(lambda: uplink.connected, "connected again")
            connected = time.monotonic()
            await measure(1.0)
            everything = set(range(1, sent + 1))
            await until(lambda: seqs(listener, "a") == seqs(listener, "b") == everything, "everything", within=20.0)
            assert not [each for each in listener.heard if each.topic.endswith("history") and each.at < connected + 9.5]
            for each in listener.heard:
                if each.topic.endswith("history"):
                    told = json.loads(each.payload)
                    assert 1 <= len(told) <= 100
                    assert all(one["historical"] is True for one in told)
                    assert [one["seq"] for one in told] == sorted({one["seq"] for one in told})
            await until(lambda: uplink.backlog.depth == 0, "nothing waits")
            assert uplink.backlog.dropped == 0

    asyncio.run(scenario())


def test_beyond_ten_thousand_samples_the_oldest_go_and_that_is_reported_once(
    unused_port: int, caplog: pytest.LogCaptureFixture
) -> None:
    async def scenario() -> None:
        async with running(Site(unused_port)) as uplink:
            uplink.publish(sample(seq) for seq in range(1, 10_002))
            uplink.publish([sample(10_002)])
            assert uplink.backlog == publication.BacklogStats(depth=10_000, oldest_ts=3000, dropped=2)

    asyncio.run(scenario())
    assert sum("the oldest are dropped" in each for each in caplog.messages) == 1


def test_a_connection_of_no_use_is_made_anew(mosquitto: Mosquitto) -> None:
    async def scenario() -> None:
        listener = mosquitto.subscribe(f"{B}/availability")
        site = Site(mosquitto.port)
        async with running(site) as uplink:
            await online(listener)
            uplink._on_stuck()
            assert site.changes == [True, False]
            await online(listener, 2)

    asyncio.run(scenario())


# The store


def test_while_a_backlog_on_disk_leaves_in_order_live_samples_stay_live(mosquitto: Mosquitto, tmp_path: Path) -> None:
    """None of them waits until it is history, and all of the backlog comes once, oldest first."""
    spool, live = 2500, 300
    limits = Limits(size=10**9, age=10**12)
    store = Store(tmp_path, boot="k0000000", limits=limits)
    queued = [sample(seq, "b").sample for seq in range(1, spool + 1)]
    waiting = [QueuedSample(each, 0.0, shift=0) for each in queued if each is not None]
    store.append(StoreBatch(waiting, losses=(), now=0, mono=0))
    store.close()

    async def scenario() -> None:
        listener = mosquitto.subscribe(f"{B}/#")
        site = Site(mosquitto.port, store=Store(tmp_path, boot="k0000001", limits=limits), history_wait=1.0)
        async with running(site) as uplink:
            await until(lambda: uplink.backlog.depth == spool, "the store is opened")
            await until(lambda: bool(listener.on(f"{B}/device/b/history")), "the past is open", within=20)
            for seq in range(1, live + 1):
                uplink.publish([sample(seq)])
                await asyncio.sleep(0.005)
            await until(lambda: uplink.backlog.depth == 0, "the end of the past")
        backlog = [one["seq"] for each in listener.on(f"{B}/device/b/history") for one in json.loads(each.payload)]
        assert backlog == list(range(1, spool + 1))
        assert [json.loads(each.payload)["seq"] for each in listener.on(f"{B}/device/a/telemetry")] == [
            *range(1, live + 1)
        ]
        assert listener.on(f"{B}/device/a/history") == []
        between = [each.topic for each in listener.heard].index(f"{B}/device/a/telemetry")
        assert f"{B}/device/b/history" in {each.topic for each in listener.heard[between:]}

    asyncio.run(scenario())
    left = Store(tmp_path, boot="k0000002", limits=limits)
    left.open()
    assert left.rows == 0  # what was acknowledged is let go at the end
    left.close()
