"""The last message waits for room, goes once, and its answer is noted."""

from __future__ import annotations

from lfs10d.outbox.in_flight import InFlight
from lfs10d.outbox.parting import Parting
from lfs10d.outbox.suspects import Suspects
from tests.support.outbox_items import event, retained


def test_the_last_message_goes_once_as_soon_as_the_window_has_room() -> None:
    in_flight, other = InFlight(Suspects()), event("x")
    in_flight.window = 1
    in_flight.begin(other, 0.0)
    parting = Parting(retained("availability"))
    assert parting.next(in_flight, 1.0) is None
    assert not parting.sent
    in_flight.end(other)
    parting.note(other)
    assert not parting.over
    in_flight.window = 2
    assert [parting.next(in_flight, 2.0), parting.next(in_flight, 2.0)] == [parting.last, None]
    assert (parting.sent, parting.over, in_flight.end(parting.last)) == (True, False, 2.0)
    parting.note(parting.last)
    parting.note(other)
    assert parting.over
