"""What requests make of the changes."""

from __future__ import annotations

import pytest

from lfs10d.config.changes import Changes, DeviceChange, FileValues, Place, Rate, Verified, keys, value_of

SAID = FileValues(
    {"a": {"id": 1, "interval": 2.0}, "b": {"id": 2}}, 9600, {"interval": 1.0, "enabled": True, "label": None}
)


def test_setting_an_option_remembers_what_the_file_said_of_it() -> None:
    changes = Changes().setting("a", {"interval": 5.0, "label": "x"}, SAID)
    assert changes.of("a") == DeviceChange(options={"interval": 5.0, "label": "x"}, instead_of={"interval": 2.0})
    assert changes.count == 2


@pytest.mark.parametrize(("name", "interval"), [("a", 2.0), ("b", 1.0)])
def test_setting_an_option_to_what_the_file_gives_anyway_is_no_change(name: str, interval: float) -> None:
    changed = Changes().setting(name, {"interval": 5.0}, SAID)
    assert changed.setting(name, {"interval": interval}, SAID) == Changes()


def test_options_are_changed_one_by_one() -> None:
    changes = Changes().setting("a", {"interval": 5.0}, SAID).setting("a", {"enabled": False}, SAID)
    assert changes.of("a").options == {"interval": 5.0, "enabled": False}


def test_an_option_of_what_was_added_is_part_of_it() -> None:
    changes = Changes().adding("c", {"id": 3}, Place(3)).setting("c", {"interval": 5.0}, SAID)
    assert changes.of("c") == DeviceChange(added={"id": 3, "interval": 5.0}, added_at=Place(3))
    assert changes.count == 1


def test_removing_what_was_added_leaves_nothing() -> None:
    assert Changes().adding("c", {"id": 3}).removing("c", SAID) == Changes()


def test_removing_a_device_of_the_file_drops_its_options() -> None:
    changes = Changes().setting("a", {"interval": 5.0}, SAID).removing("a", SAID)
    assert changes.of("a") == DeviceChange(removed={"id": 1, "interval": 2.0})


def test_resetting_keys_leaves_the_others() -> None:
    changes = Changes().setting("a", {"interval": 5.0, "label": "x"}, SAID)
    assert changes.resetting("a", frozenset({"interval"})) == Changes().setting("a", {"label": "x"}, SAID)
    assert changes.resetting("a", frozenset({"label"})) == Changes().setting("a", {"interval": 5.0}, SAID)


def test_resetting_a_device_leaves_the_fact_where_it_is() -> None:
    fact = DeviceChange(verified=Verified(Place(7), 1))
    changes = Changes().with_device("a", fact).setting("a", {"interval": 5.0}, SAID)
    assert changes.resetting("a").of("a") == fact
    assert Changes().removing("a", SAID).resetting("a") == Changes()


def test_where_a_device_was_verified_last_is_that_of_the_one_that_holds() -> None:
    assert DeviceChange().proven is None
    assert DeviceChange(verified=Verified(Place(7), 1)).proven == Place(7)
    assert DeviceChange(added={"id": 3}, added_at=Place(3), verified=Verified(Place(7), 1)).proven == Place(3)
    assert DeviceChange(added={"id": 3}, verified=Verified(Place(7), 1)).proven is None


def test_every_change_has_its_key_and_is_counted() -> None:
    changes = (
        Changes(baudrate=Rate(9600, 19200))
        .with_device("a", DeviceChange(verified=Verified(Place(7), 1)))
        .setting("a", {"interval": 5.0}, SAID)
        .removing("b", SAID)
        .adding("c", {"id": 3})
    )
    assert list(keys(changes)) == ["line.baudrate", "slaves.a.interval", "slaves.a.id", "slaves.b", "slaves.c"]
    assert changes.count == 5
    assert list(keys(Changes())) == []


def test_what_the_file_gives_is_what_it_says_or_what_is_usual() -> None:
    assert value_of(SAID.slaves["a"], "interval", SAID) == 2.0
    assert value_of(SAID.slaves["b"], "interval", SAID) == 1.0


def test_moving_a_device_of_the_file_notes_where_it_was_verified_and_what_the_file_said() -> None:
    moved = Changes().moving("a", Place(7), SAID)
    assert moved.of("a") == DeviceChange(verified=Verified(Place(7), file=1))
    assert moved.moving("a", Place(1), SAID) == Changes()


def test_moving_a_device_that_was_added_changes_its_entry() -> None:
    moved = Changes().adding("c", {"id": 3, "label": "x"}, Place(3)).moving("c", Place(8), SAID)
    assert moved.of("c") == DeviceChange(added={"id": 8, "label": "x"}, added_at=Place(8))
