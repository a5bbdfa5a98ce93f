"""Items reach a connection in slices, and the broker's answers reach the outbox; in virtual time."""

from __future__ import annotations

import asyncio
import json

import pytest

from lfs10d.mqtt.batch_assembly import SAMPLES_AT_ONCE
from lfs10d.mqtt.reasons import NO_MATCHING_SUBSCRIBERS
from lfs10d.mqtt.sender import ACKNOWLEDGED_WITHIN, ITEMS_AT_ONCE
from lfs10d.outbox.backlog import BATCH_BYTES, HISTORY_AFTER
from lfs10d.telemetry.publication import Publication, PublicationKind, retained
from tests.support.senders import LOST, Desk, in_virtual_time, sample


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
