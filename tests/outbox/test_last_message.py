"""The last message waits for room, goes once, and its answer is noted."""

from __future__ import annotations

from lfs10d.outbox.in_flight import InFlight
from lfs10d.outbox.last_message import LastMessage
from lfs10d.outbox.suspects import Suspects
from tests.support.outbox_items import event, retained


def test_the_last_message_goes_once_as_soon_as_the_window_has_room() -> None:
    in_flight, other = InFlight(Suspects()), event("x")
    in_flight.window = 1
    in_flight.begin(other, 0.0)
    last = LastMessage(retained("availability"))
    assert last.next(in_flight, 1.0) is None
    assert not last.sent
    in_flight.end(other)
    last.note(other)
    assert not last.over
    in_flight.window = 2
    assert [last.next(in_flight, 2.0), last.next(in_flight, 2.0)] == [last.item, None]
    assert (last.sent, last.over, in_flight.end(last.item)) == (True, False, 2.0)
    last.note(last.item)
    last.note(other)
    assert last.over
