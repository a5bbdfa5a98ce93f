"""Messages that end connections, or are never acknowledged, are found among those under way."""

from __future__ import annotations

import asyncio
import json

import pytest

from lfs10d.mqtt.connection import Connection
from lfs10d.mqtt.reasons import Disconnect, DisconnectReason, reason_in_words
from lfs10d.mqtt.sender import ACKNOWLEDGED_WITHIN
from lfs10d.outbox.backlog import HISTORY_AFTER
from lfs10d.telemetry.publication import Publication, PublicationKind, Sample, event, retained
from tests.support.outbox_items import named_event
from tests.support.senders import LOST, ONLINE, Desk, Wire, in_virtual_time, sample

BY_MESSAGE = Disconnect(DisconnectReason.LOST, "broker b:1: the connection is lost: closed", by_message=True)
DENIED = Disconnect(DisconnectReason.LOST, "broker b:1: not authorized", 0x87, by_message=True)


# What the broker refuses, or ends the connection for


async def again(desk: Desk, ended: Disconnect) -> None:
    """End the connection and make another, on which nothing but the burst is acknowledged yet."""
    desk.sender.lost(ended)
    desk.wire = Wire()
    connection: Connection = desk.wire  # type: ignore[assignment]  # as much of one as is used
    desk.sender.connected(connection, desk.accepted)
    desk.outbox.burst([], ONLINE)
    await desk.turn()
    desk.accept("availability")


TELEMETRY = "b/line0/device/a/telemetry"


@pytest.mark.parametrize(
    ("reason", "words"),
    [
        (
            0x97,
            f"refuses {TELEMETRY}: a quota of the broker is used up; it is tried again in a second, then less often",
        ),
        (0x87, f"refuses {TELEMETRY}: {reason_in_words(0x87)}; it is tried again after the next connect or a reload"),
        (0xC4, f"refuses {TELEMETRY}: reason code 0xC4; it is tried again after the next connect or a reload"),
        (0x95, f"refuses a message of 9 bytes to {TELEMETRY}: a packet was too large for the broker; it is dropped"),
    ],
)
def test_a_refusal_is_reported_once_with_what_becomes_of_it(
    reason: int, words: str, caplog: pytest.LogCaptureFixture
) -> None:
    async def scenario() -> None:
        desk = Desk()
        await desk.connect()
        for seq in (1, 2):
            desk.add(sample(seq))
            await desk.turn()
        desk.acknowledge(reason)
        assert desk.outbox.stats.dropped == (2 if reason == 0x95 else 0)

    in_virtual_time(scenario())
    assert [each for each in caplog.messages if "refuses" in each] == [f"the broker {words}"]


def test_what_was_under_way_at_two_ends_is_named_with_its_size_and_the_rest_goes_on(
    caplog: pytest.LogCaptureFixture,
) -> None:
    async def scenario() -> None:
        desk = Desk()
        await desk.connect()
        for _ in range(2):
            desk.add(event("scan_progress", 0))
            await desk.turn()
            assert desk.sender.under_way.keys() == {"event"}
            await again(desk, BY_MESSAGE)
        desk.add(event("scan_progress", 0), sample(1))
        await desk.turn()
        assert desk.topics[1:] == ["b/line0/device/a/telemetry"]

    in_virtual_time(scenario())
    [told] = [each for each in caplog.messages if "under way" in each]
    assert told == (
        "broker b:1: the connection is lost: closed; again with a message of 37 bytes to b/line0/event under way: "
        "nothing is sent there for an hour"
    )


def test_a_batch_that_ends_connections_is_sent_in_smaller_parts(caplog: pytest.LogCaptureFixture) -> None:
    async def scenario() -> None:
        desk = Desk()
        desk.add(*(sample(seq) for seq in range(1, 9)))
        await asyncio.sleep(5.0)
        await desk.connect()
        for _ in range(3):
            await asyncio.sleep(HISTORY_AFTER + 0.1)
            await again(desk, BY_MESSAGE)
        for _ in range(40):
            await asyncio.sleep(0.5)
            desk.acknowledge()
        told = [json.loads(payload) for topic, payload, *_ in desk.wire.sent if topic.endswith("history")]
        assert [[each["seq"] for each in batch] for batch in told] == [[1, 2], [3, 4], [5, 6], [7, 8]]
        assert desk.outbox.stats.dropped == 0

    in_virtual_time(scenario())
    assert caplog.text.count("it is sent in smaller parts") == 2


def test_a_denied_publication_is_found_though_others_were_under_way(caplog: pytest.LogCaptureFixture) -> None:
    """The broker disconnects for `info`, with a reason, each time."""

    async def scenario() -> None:
        desk = Desk()
        connection: Connection = desk.wire  # type: ignore[assignment]  # as much of one as is used
        burst = [retained(topic, {}) for topic in ("info", "devices", "device/a/state")]
        for ends in range(2):
            desk.wire.sent.clear()
            desk.sender.connected(connection, desk.accepted)
            desk.outbox.burst(burst, ONLINE)
            await desk.turn()
            assert len(desk.wire.sent) == (3, 1)[ends], "after the first end each goes alone"
            desk.sender.lost(DENIED)
        desk.sender.connected(connection, desk.accepted)
        desk.outbox.burst(burst, ONLINE)
        for _ in range(4):
            await desk.turn()
            desk.acknowledge()
        assert desk.topics[-3:] == ["b/line0/devices", "b/line0/device/a/state", "b/line0/availability"]

    in_virtual_time(scenario())
    assert "again with a message of 2 bytes to b/line0/info under way" in caplog.text


def test_a_message_of_qos_0_that_ends_connections_is_found(caplog: pytest.LogCaptureFixture) -> None:
    """It is never under way; until something after it is acknowledged it may be the cause. Alone it goes with QoS 1."""

    async def scenario() -> None:
        desk = Desk()
        await desk.connect()
        for explained in (False, True):
            desk.add(retained("device/a/stats", {}, qos=0))
            await desk.turn()
            desk.accept("device/a/stats")  # it was written
            assert desk.sender.explains_end is explained
            await again(desk, BY_MESSAGE)
        desk.outbox.reload(0.0)
        desk.outbox.suspects.ended({"device/a/stats": 2}, certain=True)
        desk.add(retained("device/a/stats", {}, qos=0))
        await desk.turn()
        assert [each[2] for each in desk.wire.sent if each[0].endswith("stats")] == [1]

    in_virtual_time(scenario())
    assert "bytes to b/line0/device/a/stats under way: nothing is sent there for an hour" in caplog.text


def test_a_message_of_qos_0_is_cleared_by_the_acknowledgement_of_a_later_one() -> None:
    async def scenario() -> None:
        desk = Desk()
        await desk.connect()
        desk.add(retained("device/a/stats", {}, qos=0))
        await desk.turn()
        desk.sender.acknowledged(2, 0)
        assert desk.sender.under_way == {"device/a/stats": 2}
        desk.add(sample(1))
        await desk.turn()
        desk.sender.acknowledged(3, 0)
        assert desk.sender.under_way == {}

    in_virtual_time(scenario())


def test_a_message_that_the_broker_never_acknowledges_while_it_does_others_is_found(
    caplog: pytest.LogCaptureFixture,
) -> None:
    async def scenario() -> None:
        desk = Desk()
        await desk.connect()
        desk.add(named_event("swallowed"))
        for ends in (1, 2):
            await desk.turn()
            desk.add(retained("info", {}))
            await desk.turn()
            desk.accept("info")
            await asyncio.sleep(ACKNOWLEDGED_WITHIN + 1)
            assert desk.stuck == ends
            await again(desk, LOST)

    in_virtual_time(scenario())
    assert "bytes to b/line0/event under way: nothing is sent there for an hour" in caplog.text


def test_a_connection_that_the_network_ends_accuses_nobody() -> None:
    async def scenario() -> None:
        desk = Desk()
        await desk.connect()
        for _ in range(5):
            desk.add(event("scan_progress", 0))
            await desk.turn()
            await again(desk, LOST)
            assert not desk.outbox.passes_over("event")

    in_virtual_time(scenario())


def test_a_sample_larger_than_a_batch_may_be_goes_alone() -> None:
    async def scenario() -> None:
        desk = Desk(limit=2000)
        long = Sample("a", "k", 1, 0, "synced", None, {}, (), "bad", "x" * 1700, None)
        desk.add(
            Publication("device/a/telemetry", {}, PublicationKind.SAMPLE, retain=False, qos=1, sample=long), sample(2)
        )
        await asyncio.sleep(5.0)
        await desk.connect()
        for _ in range(30):
            await asyncio.sleep(0.5)
            desk.acknowledge()
        told = [json.loads(payload) for topic, payload, *_ in desk.wire.sent if topic.endswith("history")]
        assert [[each["seq"] for each in batch] for batch in told] == [[1], [2]]

    in_virtual_time(scenario())
