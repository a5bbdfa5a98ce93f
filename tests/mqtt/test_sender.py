"""Items reach a connection in slices, and the broker's answers reach the outbox; in virtual time."""

from __future__ import annotations

import asyncio
import json
import selectors
from collections.abc import Coroutine
from dataclasses import dataclass, field

import pytest

from lfs10d.mqtt.batch_assembly import SAMPLES_AT_ONCE
from lfs10d.mqtt.connection import Connection
from lfs10d.mqtt.messages import Accepted
from lfs10d.mqtt.reasons import NO_MATCHING_SUBSCRIBERS, Disconnect, DisconnectReason, reason_in_words
from lfs10d.mqtt.sender import ACKNOWLEDGED_WITHIN, ITEMS_AT_ONCE, Sender
from lfs10d.mqtt.settings import Version
from lfs10d.mqtt.topics import Topics
from lfs10d.outbox.backlog import BATCH_BYTES, HISTORY_AFTER
from lfs10d.outbox.outbox import Outbox
from lfs10d.telemetry.publication import Publication, PublicationKind, Sample, event, retained
from tests.support.outbox_items import named_event

ONLINE = retained("availability", "online")
LOST = Disconnect(DisconnectReason.LOST, "broker b:1: the connection is lost")
BY_MESSAGE = Disconnect(DisconnectReason.LOST, "broker b:1: the connection is lost: closed", by_message=True)
DENIED = Disconnect(DisconnectReason.LOST, "broker b:1: not authorized", 0x87, by_message=True)


class VirtualSelector(selectors.SelectSelector):
    """Waits for nothing: the time it was asked to wait passes at once."""

    now = 0.0

    def select(self, timeout: float | None = None) -> list[tuple[selectors.SelectorKey, int]]:
        """Return what is ready now, else let the time pass."""
        ready = super().select(0)
        if not ready:
            assert timeout is not None, "every task waits, and no timer is pending"
            self.now += timeout
        return ready


def in_virtual_time(scenario: Coroutine[object, object, None]) -> None:
    """Run a scenario in a loop whose clock only waiting moves."""
    selector = VirtualSelector()
    loop = asyncio.SelectorEventLoop(selector)
    loop.time = lambda: selector.now  # type: ignore[method-assign]  # the loop's clock is what is replaced
    try:
        loop.run_until_complete(scenario)
    finally:
        loop.close()


@dataclass
class Wire:
    """Stands in for a connection; keeps what is handed over, and at which turn of the loop."""

    sent: list[tuple[str, bytes, int, bool, bytes | None]] = field(default_factory=list)
    gone: bool = False
    corked: bool = False

    def cork(self, *, on: bool) -> None:
        self.corked = on

    def publish(
        self, topic: str, payload: bytes, *, qos: int = 1, retain: bool = False, correlation: bytes | None = None
    ) -> int | None:
        if self.gone:
            return None
        assert self.corked or topic.endswith("/history"), "what goes in one turn goes by one segment"
        self.sent.append((topic, payload, qos, retain, correlation))
        return len(self.sent)


class Desk:
    """A sender between an outbox and a wire, connected, its burst settled."""

    def __init__(self, *, limit: int | None = None, receive_maximum: int = 65_535) -> None:
        self.outbox = Outbox()
        self.wire = Wire()
        self.stuck = 0
        self.sender = Sender(self.outbox, Topics("b/line0"), "line0", epoch_ms=lambda: 7, stuck=self._stuck)
        self.accepted = Accepted(Version.V5, receive_maximum, limit)

    def _stuck(self) -> None:
        self.stuck += 1

    async def connect(self) -> None:
        connection: Connection = self.wire  # type: ignore[assignment]  # as much of one as is used
        self.sender.connected(connection, self.accepted)
        self.outbox.burst([], ONLINE)
        await self.turn()
        self.acknowledge()

    async def turn(self, times: int = 50) -> None:
        """Let the loop turn without time passing."""
        self.sender.wake()
        for _ in range(times):
            await asyncio.sleep(0)
        assert not self.wire.corked, "what is handed over goes"

    def acknowledge(self, reason: int = 0) -> None:
        """Answer everything that was handed over."""
        for mid in range(1, len(self.wire.sent) + 1):
            self.sender.acknowledged(mid, reason)

    def accept(self, topic: str) -> None:
        """Acknowledge what was handed over for one topic last."""
        mid = max(mid for mid, each in enumerate(self.topics, 1) if each == f"b/line0/{topic}")
        self.sender.acknowledged(mid, 0)

    def add(self, *publications: Publication) -> None:
        for publication in publications:
            self.outbox.add(publication, asyncio.get_running_loop().time())

    @property
    def topics(self) -> list[str]:
        return [topic for topic, *_ in self.wire.sent]


def sample(seq: int) -> Publication:
    measured = Sample("a", "k", seq, 0, "synced", None, {}, (), "bad", "timeout", None)
    return Publication("device/a/telemetry", {"seq": seq}, PublicationKind.SAMPLE, retain=False, qos=1, sample=measured)


def test_a_sample_that_nobody_listened_to_after_the_first_connect_goes_once_more_as_history() -> None:
    async def scenario() -> None:
        desk = Desk()
        await desk.connect()
        desk.add(sample(1))
        await desk.turn()
        desk.acknowledge(NO_MATCHING_SUBSCRIBERS)
        desk.add(sample(2))
        await desk.turn()
        desk.acknowledge()
        await asyncio.sleep(11.0)
        history = [json.loads(payload) for topic, payload, *_ in desk.wire.sent if topic.endswith("/history")]
        assert [[one["seq"] for one in batch] for batch in history] == [[1]]

    in_virtual_time(scenario())


def test_an_item_goes_with_its_topic_qos_retain_flag_and_correlation() -> None:
    async def scenario() -> None:
        desk = Desk()
        await desk.connect()
        desk.add(retained("device/a/stats", {}, qos=0))
        desk.outbox.add(
            Publication("response/x", {}, PublicationKind.RESPONSE, retain=False, qos=1), 0.0, correlation=b"\1"
        )
        await desk.turn()
        assert desk.wire.sent == [
            ("b/line0/availability", b"online", 1, True, None),
            ("b/line0/device/a/stats", b"{}", 0, True, None),
            ("b/line0/response/x", b"{}", 1, False, b"\1"),
        ]

    in_virtual_time(scenario())


def test_a_few_items_go_in_one_turn_of_the_loop() -> None:
    async def scenario() -> None:
        desk = Desk()
        await desk.connect()
        desk.add(*(sample(seq) for seq in range(1, 11)))
        before = len(desk.wire.sent)
        desk.sender.wake()
        counts = [len(desk.wire.sent) - before]
        for _ in range(2):
            await asyncio.sleep(0)
            counts.append(len(desk.wire.sent) - before)
        assert counts == [ITEMS_AT_ONCE, 2 * ITEMS_AT_ONCE, 10]

    in_virtual_time(scenario())


@pytest.mark.parametrize(("receive_maximum", "window"), [(65_535, 20), (3, 3)])
def test_no_more_is_under_way_than_the_broker_receives(receive_maximum: int, window: int) -> None:
    async def scenario() -> None:
        desk = Desk(receive_maximum=receive_maximum)
        await desk.connect()
        desk.add(*(sample(seq) for seq in range(1, 31)))
        await desk.turn()
        assert len(desk.wire.sent) == 1 + window

    in_virtual_time(scenario())


def test_a_batch_is_serialised_in_slices_and_goes_by_itself_when_its_time_has_come() -> None:
    async def scenario() -> None:
        desk = Desk()
        desk.add(*(sample(seq) for seq in range(1, 101)))
        await asyncio.sleep(5.0)
        await desk.connect()
        await asyncio.sleep(HISTORY_AFTER - 0.1)
        assert desk.topics == ["b/line0/availability"]
        await asyncio.sleep(0.2)
        await desk.turn(2 + 100 // SAMPLES_AT_ONCE)
        assert desk.topics == ["b/line0/availability", "b/line0/device/a/history"]
        told = json.loads(desk.wire.sent[1][1])
        assert [each["seq"] for each in told] == list(range(1, len(told) + 1))
        assert all(each["historical"] for each in told)
        size = len(desk.wire.sent[1][1])
        assert BATCH_BYTES - size / len(told) < size <= BATCH_BYTES
        for _ in range(20):
            await asyncio.sleep(0.2)
            desk.acknowledge()
        rest = [json.loads(payload) for topic, payload, *_ in desk.wire.sent if topic.endswith("history")]
        assert [each["seq"] for batch in rest for each in batch] == list(range(1, 101))

    in_virtual_time(scenario())


def test_live_samples_pass_a_batch_that_is_still_being_serialised() -> None:
    async def scenario() -> None:
        desk = Desk()
        desk.add(*(sample(seq) for seq in range(1, 101)))
        await asyncio.sleep(5.0)
        await desk.connect()
        await asyncio.sleep(HISTORY_AFTER)
        await desk.turn(1)
        desk.add(sample(101))
        await desk.turn()
        assert desk.topics[1:] == ["b/line0/device/a/telemetry", "b/line0/device/a/history"]

    in_virtual_time(scenario())


def test_a_batch_whose_connection_is_lost_while_it_is_serialised_waits_again() -> None:
    async def scenario() -> None:
        desk = Desk()
        desk.add(*(sample(seq) for seq in range(1, 101)))
        await asyncio.sleep(5.0)
        await desk.connect()
        await asyncio.sleep(HISTORY_AFTER)
        await desk.turn(1)
        desk.sender.lost(LOST)
        await desk.turn()
        assert desk.topics == ["b/line0/availability"]
        assert desk.outbox.depth == 100

    in_virtual_time(scenario())


def test_batches_too_large_for_the_broker_are_cut_until_they_fit() -> None:
    async def scenario() -> None:
        desk = Desk(limit=2000)
        desk.add(*(sample(seq) for seq in range(1, 41)))
        await asyncio.sleep(5.0)
        await desk.connect()
        for _ in range(40):
            await asyncio.sleep(0.5)
            desk.acknowledge()
        told = [json.loads(payload) for topic, payload, *_ in desk.wire.sent if topic.endswith("history")]
        assert [each["seq"] for batch in told for each in batch] == list(range(1, 41))
        assert all(len(payload) < 2000 for _, payload, *_ in desk.wire.sent)
        assert desk.outbox.depth == 0

    in_virtual_time(scenario())


def test_what_is_lost_is_declared_with_the_wall_clock() -> None:
    async def scenario() -> None:
        desk = Desk()
        await desk.connect()
        desk.add(sample(1))
        await desk.turn()
        desk.acknowledge(0x99)
        await asyncio.sleep(HISTORY_AFTER + 1)
        assert json.loads(desk.wire.sent[-1][1]) == {
            "v": 1, "type": "dropped", "ts": 7, "device": "a", "boot": "k", "from_seq": 1, "to_seq": 1, "count": 1,
        }  # fmt: skip

    in_virtual_time(scenario())


def test_a_broker_that_acknowledges_nothing_is_given_up_after_a_minute() -> None:
    async def scenario() -> None:
        desk = Desk()
        await desk.connect()
        desk.add(sample(1))
        await desk.turn()
        await asyncio.sleep(ACKNOWLEDGED_WITHIN - 1)
        assert desk.stuck == 0
        await asyncio.sleep(2)
        assert desk.stuck == 1

    in_virtual_time(scenario())


def test_what_the_connection_does_not_take_any_more_waits_for_the_next() -> None:
    async def scenario() -> None:
        desk = Desk()
        await desk.connect()
        desk.wire.gone = True
        desk.add(sample(1))
        await desk.turn()
        desk.sender.lost(LOST)
        desk.wire.gone = False
        await desk.connect()
        await desk.turn()
        assert desk.topics[-1] == "b/line0/device/a/telemetry"

    in_virtual_time(scenario())


def test_an_answer_to_nothing_is_passed_over() -> None:
    async def scenario() -> None:
        desk = Desk()
        await desk.connect()
        desk.sender.acknowledged(4711, 0x87)
        assert desk.outbox.announced

    in_virtual_time(scenario())


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
        assert desk.outbox.dropped == (2 if reason == 0x95 else 0)

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
        assert desk.outbox.dropped == 0

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
