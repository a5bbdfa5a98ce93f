"""The last message before a clean exit, on the whole outbox."""

from __future__ import annotations

from lfs10d.outbox.outbox import Outbox
from lfs10d.telemetry import publication as telemetry
from tests.support.outboxes import (
    NOT_AUTHORIZED,
    connect,
    connected,
    sample,
)

OFFLINE = telemetry.retained("availability", "offline")


def test_the_last_message_goes_when_there_is_room_and_nothing_goes_after_it() -> None:
    outbox = Outbox()
    connect(outbox, 0.0, window=1)
    for seq in (1, 2):
        outbox.add(sample(seq), 0.0)
    first = outbox.next(0.0)
    assert first is not None
    offline = outbox.send_last(OFFLINE)
    assert outbox.next(0.0) is None
    assert outbox.waits
    outbox.on_ack(first, 0.1)
    last = outbox.next(0.1)
    assert last is offline.item
    assert (outbox.due(), offline.over) == (None, False)
    outbox.on_ack(offline.item, 0.2)
    assert (outbox.next(0.2), outbox.waits, offline.over) == (None, False, True)
    assert outbox.depth == 1, "the other sample is kept"


def test_a_last_message_that_is_refused_does_not_go_over_the_next_connection() -> None:
    outbox = connected()
    offline = outbox.send_last(OFFLINE)
    assert outbox.next(0.0) is offline.item
    assert outbox.refused(offline.item, NOT_AUTHORIZED, 0.0)
    assert offline.over
    outbox.lost(0.1)
    connect(outbox, 1.0)
    assert outbox.next(1.0) is None
