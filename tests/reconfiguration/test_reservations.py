"""Who has the one place, and which slave ids are reserved."""

from __future__ import annotations

import pytest

from lfs10d.command import RefusedError
from lfs10d.reconfiguration.journal import Endpoint, Move, OpenReaddress
from lfs10d.reconfiguration.reservations import Reservations

OPEN = OpenReaddress(
    number=1,
    moves=(Move(device="north", old=Endpoint(slave=3, baudrate=9600), new=Endpoint(slave=9, baudrate=9600)),),
    begun=0,
)


def test_whoever_comes_while_the_place_is_held_is_told_busy() -> None:
    reserving = Reservations(lambda: ())
    assert reserving.busy is None
    with reserving.held("line/scan"):
        assert reserving.underway == "line/scan"
        with pytest.raises(RefusedError) as refused, reserving.held("line/adopt"):
            pytest.fail("two have the place")
        assert refused.value.result.code == "busy"
    assert reserving.busy is None


def test_what_is_underway_and_what_is_open_reserve_their_ids() -> None:
    reserving = Reservations(lambda: (OPEN,))
    with reserving.held("line/adopt", frozenset({1, 2})):
        assert reserving.brought == {1, 2}
        assert dict(reserving.reserved) == {
            **dict.fromkeys((3, 9), "is reserved by the open change of north"),
            **dict.fromkeys((1, 2), "is about to be used by line/adopt"),
        }
    assert set(reserving.reserved) == {3, 9}
