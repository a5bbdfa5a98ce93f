"""What is under way to the broker."""

from __future__ import annotations

import pytest

from lfs10d.outbox.in_flight import InFlight
from lfs10d.outbox.suspects import Suspects
from tests.support.outbox_items import batch, event, live


@pytest.fixture
def suspects() -> Suspects:
    """Give suspects that know none."""
    return Suspects()


@pytest.fixture
def in_flight(suspects: Suspects) -> InFlight:
    """Give a window of two."""
    made = InFlight(suspects)
    made.window = 2
    return made


def test_without_a_connection_there_is_no_room(suspects: Suspects) -> None:
    assert InFlight(suspects).full


def test_the_window_is_full_and_has_room_again(in_flight: InFlight) -> None:
    first, second = live("a", 1), live("a", 2)
    assert [in_flight.begin(each, at) for at, each in enumerate((first, second))] == [first, second]
    assert (in_flight.full, in_flight.closed, in_flight.alone) == (True, True, None)
    assert (list(in_flight), len(in_flight)) == ([first, second], 2)
    in_flight.end(first)
    assert (in_flight.full, in_flight.closed) == (False, False)
    assert in_flight.end(second) == 1


def test_a_suspect_goes_when_nothing_else_is_under_way_and_nothing_goes_beside_it(
    in_flight: InFlight, suspects: Suspects
) -> None:
    suspects.ended({"event": 10}, certain=True)
    other, suspect = live("a", 1), event("x")
    in_flight.begin(other, 0.0)
    assert in_flight.begin(suspect, 0.0) is None
    assert in_flight.closed
    assert in_flight.next_alone() is None
    in_flight.end(other)
    assert (in_flight.full, in_flight.closed) == (False, True)
    assert [in_flight.next_alone(), in_flight.next_alone()] == [suspect, None]
    in_flight.end(suspect)
    assert not in_flight.closed


def test_a_suspect_batch_that_is_shortened_still_goes_alone(in_flight: InFlight, suspects: Suspects) -> None:
    whole, part = batch("a", 1, 2), batch("a", 1)
    suspects.ended({whole.topic: 10}, certain=True)
    assert in_flight.begin(whole, 0.0) is whole
    in_flight.replace(whole, part)
    assert in_flight.alone is part
    in_flight.end(part)
    assert not in_flight.closed


def test_a_replaced_item_keeps_its_place_and_time(in_flight: InFlight) -> None:
    whole, part, other = batch("a", 1, 2), batch("a", 1), live("b", 1)
    in_flight.begin(whole, 1.0)
    in_flight.begin(other, 2.0)
    in_flight.replace(whole, part)
    assert list(in_flight) == [part, other]
    assert in_flight.end(part) == 1.0


def test_a_loss_returns_all_in_order_and_closes_the_window(in_flight: InFlight) -> None:
    first, second = live("a", 1), event("x")
    in_flight.begin(first, 0.0)
    in_flight.begin(second, 0.0)
    assert in_flight.lost() == [first, second]
    assert (len(in_flight), in_flight.window, in_flight.full) == (0, 0, True)


def test_samples_of_the_store_are_not_counted_as_in_memory(in_flight: InFlight) -> None:
    in_flight.window = 9
    here = batch("a", 1, 2)
    for each in (here, batch("a", 3, first_row=7), event("x")):
        in_flight.begin(each, 0.0)
    assert list(in_flight.in_memory()) == [here.samples]
