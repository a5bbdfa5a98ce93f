"""The file as it is, as it was, and what a request changed: a person's edit wins, and nothing else is ever lost."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from lfs10d.config.changes import Changes, DeviceChange, FileValues, Place, Rate, Verified
from lfs10d.config.merge import Merged, merge
from tests.support.merges import USUAL


def file(baudrate: int = 9600, **slaves: dict[str, Any]) -> FileValues:
    return FileValues(slaves, baudrate, USUAL)


def lost(merged: Merged) -> list[tuple[str, Any]]:
    return [(dropped.key, dropped.lost) for dropped in merged.dropped]


# -- options

SLOW = Changes().setting("a", {"interval": 5.0}, file(a={"id": 1, "interval": 2.0}))


def test_a_change_holds_while_the_file_says_what_it_said() -> None:
    merged = merge(file(b={"id": 9}, a={"interval": 2.0, "id": 1, "label": "new"}), SLOW)
    assert merged.devices == {"b": {"id": 9}, "a": {"id": 1, "interval": 5.0, "label": "new"}}
    assert merged.changed == {"b": frozenset(), "a": {"interval"}}
    assert (merged.changes, merged.dropped, merged.contested) == (SLOW, (), {})


@pytest.mark.parametrize(
    ("entry", "interval", "told"),
    [
        ({"id": 1, "interval": 3.0}, 3.0, [("slaves.a.interval", 5.0)]),
        ({"id": 1}, None, [("slaves.a.interval", 5.0)]),
        ({"id": 1, "interval": 5.0}, 5.0, []),
    ],
)
def test_an_edit_of_the_key_wins_and_is_told_unless_it_says_the_same(
    entry: dict[str, Any], interval: float | None, told: list[tuple[str, Any]]
) -> None:
    merged = merge(file(a=entry), SLOW)
    assert merged.devices["a"].get("interval") == interval
    assert lost(merged) == told
    assert merged.changes == Changes()


def test_what_is_taken_out_of_the_file_is_no_news_where_the_rest_of_it_now_gives_the_same() -> None:
    changes = Changes().setting("a", {"interval": 1.0}, file(a={"id": 1, "interval": 2.0}))
    merged = merge(file(a={"id": 1}), changes)
    assert (merged.dropped, merged.changes) == ((), Changes())


def test_a_key_that_the_file_begins_to_state_is_an_edit() -> None:
    changes = Changes().setting("a", {"enabled": False}, file(a={"id": 1}))
    merged = merge(file(a={"id": 1, "enabled": True}), changes)
    assert merged.devices["a"]["enabled"] is True
    assert lost(merged) == [("slaves.a.enabled", False)]


def test_what_every_slave_inherits_is_another_key() -> None:
    changes = Changes().setting("a", {"interval": 5.0}, file(a={"id": 1}))
    merged = merge(replace(file(a={"id": 1}), usual={**USUAL, "interval": 7.0}), changes)
    assert merged.devices["a"]["interval"] == 5.0


def test_changes_of_a_device_that_the_file_has_no_more_are_lost() -> None:
    changes = SLOW.with_device("a", replace(SLOW.of("a"), verified=Verified(Place(7), 1)))
    merged = merge(file(), changes)
    assert lost(merged) == [("slaves.a.interval", 5.0), ("slaves.a.id", 7)]
    assert (merged.devices, merged.changes) == ({}, Changes())


# -- devices that requests added or removed

ROOF = Changes().adding("roof", {"id": 9, "interval": 5.0, "profile": "eh600"}, Place(9))


def test_what_was_added_is_polled_after_those_of_the_file() -> None:
    merged = merge(file(a={"id": 1}), ROOF)
    assert list(merged.devices) == ["a", "roof"]
    assert merged.devices["roof"] == {"id": 9, "interval": 5.0, "profile": "eh600"}
    assert merged.changed["roof"] == {"id", "interval", "profile"}
    assert (merged.changes, merged.dropped) == (ROOF, ())


def test_what_was_added_and_stands_in_the_file_now_is_no_change_any_more() -> None:
    merged = merge(file(roof={"id": 9, "interval": 5.0, "profile": "eh600", "label": "x"}), ROOF)
    assert (merged.changes, merged.dropped, merged.contested) == (Changes(), (), {})


def test_of_what_was_added_the_file_decides_what_it_says_and_the_options_stay() -> None:
    merged = merge(file(roof={"id": 9}), ROOF)
    assert lost(merged) == [("slaves.roof.profile", "eh600")]
    assert merged.devices["roof"] == {"id": 9, "interval": 5.0}
    assert merge(file(roof={"id": 9}), merged.changes) == replace(merged, dropped=())


def test_what_was_added_where_it_never_answered_gives_way_to_the_id_in_the_file() -> None:
    unproven = Changes().adding("roof", {"id": 9})
    merged = merge(file(roof={"id": 8}), unproven)
    assert lost(merged) == [("slaves.roof.id", 9)]
    assert (merged.devices["roof"], merged.contested) == ({"id": 8}, {})


def test_where_it_answered_it_is_looked_for_after_the_file_s_place() -> None:
    merged = merge(file(roof={"id": 8, "profile": "eh600"}), ROOF)
    assert merged.devices["roof"]["id"] == 8
    assert merged.contested == {"roof": (Place(8, 9600), Place(9, 9600))}
    assert merged.dropped == ()
    again = merge(file(roof={"id": 8, "profile": "eh600"}), merged.changes)
    assert again.contested == merged.contested
    settled = merge(file(roof={"id": 9, "profile": "eh600"}), merged.changes)
    assert (settled.contested, settled.changes.of("roof").verified) == ({}, None)


BEFORE = file(a={"id": 1, "label": "x"}, b={"id": 2})
GONE = Changes().removing("a", BEFORE)


def test_what_was_removed_is_not_polled() -> None:
    merged = merge(BEFORE, GONE)
    assert (list(merged.devices), merged.changes, merged.dropped) == (["b"], GONE, ())


def test_what_is_taken_out_of_the_file_too_is_no_change_any_more() -> None:
    merged = merge(file(b={"id": 2}), GONE)
    assert (list(merged.devices), merged.changes, merged.dropped) == (["b"], Changes(), ())


def test_what_was_removed_comes_back_when_its_entry_is_edited() -> None:
    merged = merge(file(a={"id": 1, "label": "y"}, b={"id": 2}), GONE)
    assert merged.devices["a"] == {"id": 1, "label": "y"}
    assert lost(merged) == [("slaves.a", {"removed": True})]
    assert merged.changes == Changes()


REPLACED = GONE.adding("a", {"id": 5}, Place(5))


def test_a_name_that_was_removed_can_be_added_again_and_keeps_its_place_among_the_devices() -> None:
    merged = merge(BEFORE, REPLACED)
    assert list(merged.devices.items()) == [("a", {"id": 5}), ("b", {"id": 2})]
    assert merged.changes == REPLACED


@pytest.mark.parametrize(
    ("entry", "told", "left"),
    [
        ({"id": 1, "label": "y"}, [("slaves.a", {"id": 5})], {}),
        ({"id": 5}, [], {}),
        (None, [], {"a": DeviceChange(added={"id": 5}, added_at=Place(5))}),
    ],
)
def test_an_edit_of_what_was_replaced_concerns_both(
    entry: dict[str, Any] | None, told: list[tuple[str, Any]], left: dict[str, DeviceChange]
) -> None:
    merged = merge(file(b={"id": 2}) if entry is None else file(a=entry, b={"id": 2}), REPLACED)
    assert lost(merged) == told
    assert merged.devices["a"] == (entry or {"id": 5})
    assert merged.changes == Changes(left)


# -- facts

MOVED = Changes({"a": DeviceChange(verified=Verified(Place(7), file=1))})


def test_a_slave_id_that_was_verified_holds_while_the_file_is_not_edited() -> None:
    merged = merge(file(a={"id": 1}), MOVED)
    assert (merged.devices["a"], merged.contested) == ({"id": 7}, {})
    assert merged.changed["a"] == {"id"}
    assert merged.changes == MOVED


def test_a_slave_id_that_the_file_now_names_is_no_change_any_more() -> None:
    merged = merge(file(a={"id": 7}), MOVED)
    assert (merged.devices["a"], merged.changes, merged.dropped) == ({"id": 7}, Changes(), ())


def test_a_slave_id_edited_to_a_third_one_is_looked_for_in_both_places_and_the_fact_is_kept() -> None:
    merged = merge(file(a={"id": 4}), MOVED)
    assert merged.contested == {"a": (Place(4, 9600), Place(7, 9600))}
    assert (merged.devices["a"], merged.changes, merged.dropped) == ({"id": 4}, MOVED, ())


def test_a_fact_outlives_the_removal_of_its_device_and_its_return() -> None:
    said = file(a={"id": 1})
    removed = MOVED.removing("a", said)
    assert merge(said, removed).changes == removed
    assert merge(said, removed.resetting("a")).devices["a"] == {"id": 7}
    assert merge(file(a={"id": 1, "label": "x"}), removed).devices["a"] == {"id": 7, "label": "x"}
    assert merge(file(), removed).changes == Changes()


def test_a_device_verified_at_another_rate_than_the_line_s_is_looked_for_there() -> None:
    straggler = Changes({"a": DeviceChange(verified=Verified(Place(1, 19200), file=1))})
    merged = merge(file(a={"id": 1}), straggler)
    assert merged.changes == straggler
    assert merged.contested == {}
    moved = merge(file(a={"id": 2}), straggler)
    assert moved.contested == {"a": (Place(2, 9600), Place(1, 19200))}
    settled = merge(file(19200, a={"id": 1}), Changes({"a": DeviceChange(verified=Verified(Place(1, 19200), file=2))}))
    assert settled.changes == Changes()
    kept = merge(file(a={"id": 1}), Changes({"a": DeviceChange(verified=Verified(Place(1, 19200), file=2))}))
    assert kept.changes == straggler


RATE = Changes(baudrate=Rate(file=9600, now=19200))


@pytest.mark.parametrize(
    ("said", "rate", "left", "places"),
    [
        (9600, 19200, RATE, None),
        (19200, 19200, Changes(), None),
        (38400, 38400, RATE, (Place(1, 38400), Place(1, 19200))),
    ],
)
def test_the_line_s_rate_is_a_fact_too(said: int, rate: int, left: Changes, places: tuple[Place, ...] | None) -> None:
    merged = merge(file(said, a={"id": 1}), RATE)
    assert (merged.baudrate, merged.changes, merged.contested.get("a")) == (rate, left, places)


def test_one_place_in_question_is_no_question() -> None:
    changes = Changes({"a": DeviceChange(verified=Verified(Place(1, 38400), file=1))}, RATE.baudrate)
    assert merge(file(38400, a={"id": 1}), changes).contested == {}
