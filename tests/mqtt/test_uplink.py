"""The daemon's uplink against a real mosquitto, seen by an independent MQTT 5 subscriber."""

from __future__ import annotations

import asyncio
import contextlib
import json
import logging
import signal
import time
from collections.abc import AsyncIterator, Callable
from pathlib import Path

import pytest

from lfs10d.mqtt.retained_requests import ASK_AFTER
from lfs10d.mqtt.settings import BrokerSettings, Version
from lfs10d.mqtt.topics import InboundRequest
from lfs10d.mqtt.uplink import Uplink
from lfs10d.outbox.store.database import Limits
from lfs10d.outbox.store.sample_file import StoreEntry
from lfs10d.outbox.store.store import Store
from lfs10d.telemetry import publication
from lfs10d.telemetry.publication import Publication, PublicationKind, Sample
from tests.support.brokers import Listener, Mosquitto
from tests.support.old_brokers import OldBroker
from tests.support.outbox_items import named_event

B = "site/line0"
PATIENCE = 10.0


def sample(seq: int, device: str = "a") -> Publication:
    measured = Sample(
        device, "k0000001", seq, 1000 * seq, "synced", {"wind_speed": seq / 8}, {"wind_speed": "m/s"},
        ("wind_speed",), "good", None, 18.2,
    )  # fmt: skip
    topic = publication.device_topic(device, publication.TELEMETRY)
    return Publication(topic, measured.payload("line0"), PublicationKind.SAMPLE, retain=False, qos=1, sample=measured)


class Site:
    """A daemon's worth of retained topics around an uplink."""

    def __init__(self, port: int, *, store: Store | None = None, **changes: object) -> None:
        facts: dict[str, object] = {"host": "127.0.0.1", "port": port, "client_id": "gateway", **changes}
        self.settings = BrokerSettings(**facts)  # type: ignore[arg-type]  # the test says which are changed
        self.retained = {f"device/{name}/state": {"device": name} for name in "abc"}
        self.requests: list[InboundRequest] = []
        self.changes: list[bool] = []
        self.announced = 0
        self.troubles: list[str | None] = []
        self.uplink = Uplink(
            self.settings,
            base=B,
            epoch_ms=lambda: 1_795_298_022_003,
            store=store,
        )

    def burst(self) -> list[Publication]:
        return [publication.retained(topic, payload) for topic, payload in self.retained.items()]

    def topics(self) -> frozenset[str]:
        return frozenset(self.retained)

    def on_request(self, request: InboundRequest) -> None:
        self.requests.append(request)

    def on_announced(self) -> None:
        self.announced += 1

    def on_spool_trouble(self, trouble: str | None) -> None:
        self.troubles.append(trouble)

    def on_uplink_change(self) -> None:
        if self.changes[-1:] != [self.uplink.connected]:
            self.changes.append(self.uplink.connected)


async def until(claim: Callable[[], bool], what: str, *, within: float = PATIENCE) -> None:
    """Let the loop turn until the claim holds."""
    deadline = time.monotonic() + within
    while not claim():
        assert time.monotonic() < deadline, f"not within {within:g} s: {what}"
        await asyncio.sleep(0.005)


@contextlib.asynccontextmanager
async def running(site: Site) -> AsyncIterator[Uplink]:
    """Start and stop an uplink."""
    await site.uplink.start(site, on_request=site.on_request, on_spool_trouble=site.on_spool_trouble)
    try:
        yield site.uplink
    finally:
        await site.uplink.stop()


async def online(listener: Listener, times: int = 1) -> None:
    """Wait until the uplink has said `online` that often."""

    def said() -> int:
        return sum(each.payload == b"online" for each in listener.on(f"{B}/availability"))

    await until(lambda: said() >= times, "online")


def seqs(listener: Listener, device: str = "a") -> set[int]:
    """Return the seqs heard of a device, live and as history."""
    live = [json.loads(each.payload) for each in listener.on(f"{B}/device/{device}/telemetry")]
    backlog = [one for each in listener.on(f"{B}/device/{device}/history") for one in json.loads(each.payload)]
    return {one["seq"] for one in live + backlog}


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


# What is left over


def swept(uplink: Uplink) -> bool:
    return uplink.connected and not (uplink._cleanup.under_way or uplink._cleanup.wanted)


def test_retained_topics_of_devices_that_are_gone_are_cleared_and_nothing_else(mosquitto: Mosquitto) -> None:
    leaves = ("state", "config", "availability", "error", "stats", "wind")
    for leaf in leaves:
        mosquitto.publish(f"{B}/device/gone/{leaf}", "x", retain=True)
    others = {f"{B}/device/gone/notes": b"mine", "site/line1/device/gone/state": b"theirs", f"{B}/info": b"x"}
    for topic, payload in others.items():
        mosquitto.publish(topic, payload, retain=True)

    async def scenario() -> None:
        listener = mosquitto.subscribe(f"{B}/device/gone/#")
        site = Site(mosquitto.port)
        async with running(site) as uplink:
            await until(
                lambda: (
                    {each.topic for each in listener.heard if not each.payload}
                    == {f"{B}/device/gone/{leaf}" for leaf in leaves}
                ),
                "cleared",
            )
            del site.retained["device/c/state"]
            await uplink.reload()
            await until(lambda: f"{B}/device/c/state" not in mosquitto.retained(f"{B}/#"), "cleared at reload")

    asyncio.run(scenario())
    ours = {f"{B}/device/a/state": b'{"device":"a"}', f"{B}/device/b/state": b'{"device":"b"}'}
    assert mosquitto.retained("site/#") == {**others, **ours, f"{B}/availability": b"offline"}


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
        site = Site(mosquitto.port)
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


# The broker goes and comes


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


def test_what_is_cleared_just_before_a_reload_is_cleared_once(mosquitto: Mosquitto) -> None:
    async def scenario() -> None:
        listener = mosquitto.subscribe(f"{B}/#")
        site = Site(mosquitto.port)
        gone = [f"device/d{number}/state" for number in range(100)]
        site.retained |= {topic: {"device": topic} for topic in gone}
        async with running(site) as uplink:
            await online(listener)
            await until(lambda: swept(uplink), "the sweep after the connect")
            for topic in gone:
                del site.retained[topic]
            uplink.publish(publication.retained(topic, None) for topic in gone)
            await uplink.reload()
            assert not swept(uplink)
            await until(lambda: swept(uplink), "the sweep")
            uplink.publish([sample(1)])
            await until(lambda: seqs(listener) == {1}, "what is published after the sweep")
        cleared = [each.topic.removeprefix(f"{B}/") for each in listener.heard if not each.payload]
        assert sorted(cleared) == sorted(gone)

    asyncio.run(scenario())


def test_a_reload_during_a_sweep_does_not_begin_another(mosquitto: Mosquitto) -> None:
    mosquitto.publish(f"{B}/device/gone/state", "x", retain=True)

    async def scenario() -> None:
        listener = mosquitto.subscribe(f"{B}/device/gone/#")
        async with running(Site(mosquitto.port)) as uplink:
            await until(lambda: uplink._cleanup.under_way, "the sweep after the connect")
            await uplink.reload()
            await until(lambda: not uplink._cleanup.under_way, "its end")
            await until(lambda: not listener.heard[-1].payload, "cleared")
            assert len(listener.heard) == 2

    asyncio.run(scenario())


def test_other_settings_are_taken_at_a_reload(mosquitto: Mosquitto) -> None:
    async def scenario() -> None:
        listener = mosquitto.subscribe([f"{B}/availability", "$SYS/none"])
        site = Site(mosquitto.port)
        async with running(site) as uplink:
            await online(listener)
            await uplink.reload(Site(mosquitto.port, client_id="another", version=Version.V311).settings)
            await online(listener, 2)
            assert uplink.version is Version.V311
            assert [each.payload for each in listener.heard] == [b"online", b"offline", b"online"]

    asyncio.run(scenario())
    assert "as another" in mosquitto.log


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


# The store


def test_while_a_backlog_on_disk_leaves_in_order_live_samples_stay_live(mosquitto: Mosquitto, tmp_path: Path) -> None:
    """None of them waits until it is history, and all of the backlog comes once, oldest first."""
    spool, live = 2500, 300
    limits = Limits(size=10**9, age=10**12)
    store = Store(tmp_path, boot="k0000000", limits=limits)
    queued = [sample(seq, "b").sample for seq in range(1, spool + 1)]
    store.append([StoreEntry(each, 0) for each in queued if each is not None], losses=(), now=0, mono=0)
    store.close()

    async def scenario() -> None:
        listener = mosquitto.subscribe(f"{B}/#")
        site = Site(mosquitto.port, store=Store(tmp_path, boot="k0000001", limits=limits))
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
