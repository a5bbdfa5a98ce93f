"""A window that stays full: states are replaced, refreshes and bursts take turns with the rest."""

from __future__ import annotations

import pytest

from lfs10d.outbox.items import HistoryBatch, LiveSample, Retained
from lfs10d.outbox.outbox import Outbox
from lfs10d.telemetry import publication as telemetry
from lfs10d.telemetry.publication import Publication
from tests.support.outboxes import (
    ONLINE,
    connect,
    sample,
    state,
)


def refresh(version: int) -> Publication:
    return telemetry.retained("device/a/state", {"version": version}, refresh=True)


def test_what_the_window_carries_is_told_once_where_states_are_replaced_before_they_go() -> None:
    outbox = Outbox()
    connect(outbox, 0.0, window=1)
    told = []
    for second in range(60):
        outbox.add(sample(second + 1), float(second))
        outbox.add(refresh(second), float(second))
        item = outbox.next(float(second))
        assert item is not None
        outbox.add(refresh(second), second + 0.5)
        outbox.on_ack(item, second + 0.9)
        told.append(outbox.congested(second + 0.9))
    (congested,) = [each for each in told if each is not None]
    assert congested.window == 1
    assert congested.round_trip == pytest.approx(0.9)


def test_states_published_at_one_moment_are_no_sign_that_the_window_carries_too_little() -> None:
    outbox = Outbox()
    connect(outbox, 0.0, window=1)
    for second in range(60):
        outbox.add(sample(second + 1), float(second))
        item = outbox.next(float(second))
        assert item is not None
        for version in range(3):
            outbox.add(refresh(version), second + 0.5)
        outbox.on_ack(item, second + 0.6)
        shown = outbox.next(second + 0.6)
        assert isinstance(shown, Retained)
        assert shown.publication == refresh(2)
        outbox.on_ack(shown, second + 0.7)
        assert outbox.congested(second + 0.7) is None


def test_once_the_window_was_full_refreshes_have_their_turn_until_nothing_waits() -> None:
    outbox = Outbox()
    connect(outbox, 0.0, window=1)
    for seq in range(1, 13):
        outbox.add(sample(seq), 0.0)
    outbox.add(refresh(1), 0.0)
    kinds = []
    for _ in range(13):
        item = outbox.next(0.0)
        assert item is not None
        kinds.append(type(item))
        assert outbox.next(0.0) is None
        outbox.on_ack(item, 0.0)
    assert kinds.index(Retained) < 4
    assert outbox.next(0.0) is None
    outbox.add(refresh(2), 1.0)
    outbox.add(sample(13), 1.0)
    assert isinstance(outbox.next(1.0), LiveSample)


def test_no_batch_is_taken_while_the_one_before_is_not_on_its_way() -> None:
    outbox = Outbox()
    outbox.add(sample(1), 0.0)
    connect(outbox, 50.0)
    assert outbox.next(60.0, batch=False) is None
    assert isinstance(outbox.next(60.0), HistoryBatch)


def test_a_burst_that_lasts_takes_turns_with_the_rest_after_ten_seconds() -> None:
    outbox = Outbox()
    outbox.connected(0.0, window=1)
    outbox.burst([state(1, "a"), state(1, "b"), state(1, "c"), state(1, "d")], ONLINE)
    kinds = []
    for now in (0.0, 5.0, 9.9, 10.0, 10.1, 10.2):
        if now > 9.0:
            outbox.add(sample(int(10 * now)), now)
        item = outbox.next(now)
        assert item is not None
        assert outbox.next(now) is None
        kinds.append(type(item))
        outbox.on_ack(item, now)
    assert kinds[:3] == [Retained] * 3
    assert LiveSample in kinds[3:]
    assert Retained in kinds[3:]
