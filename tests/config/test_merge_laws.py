"""A person's edit always wins, and nothing else is ever lost."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from hypothesis import given
from hypothesis import strategies as st

from lfs10d.config.changes import Changes, FileValues, Place
from lfs10d.config.merge import DroppedChange, Merged, merge
from tests.support.merges import USUAL

# -- laws

NAMES = ("a", "b", "c")
VALUES = {
    "interval": st.sampled_from([0.0, 0.5, 1.0, 2.0]),
    "enabled": st.booleans(),
    "label": st.sampled_from([None, "x", "y"]),
    "response_timeout": st.sampled_from([None, 0.1]),
}
OPTIONS = st.fixed_dictionaries({}, optional=VALUES)
ENTRIES = st.builds(lambda number, options: {"id": number, **options}, st.integers(1, 4), OPTIONS)
FILES = st.dictionaries(st.sampled_from(NAMES), ENTRIES).map(lambda slaves: FileValues(slaves, 9600, USUAL))
STEPS = st.lists(
    st.tuples(st.sampled_from(["set", "add", "remove", "reset", "edit", "restart"]), st.sampled_from(NAMES), ENTRIES),
    max_size=12,
)


def held(merged: Merged, name: str) -> dict[str, Any] | None:
    """Return every key of a device that holds, inherited ones too."""
    return {**USUAL, **merged.devices[name]} if name in merged.devices else None


class Life:
    """A file, and what requests and persons do one after the other; each step proves what it alone changes."""

    def __init__(self, said: FileValues) -> None:
        self.said = said
        self.merged = merge(said, Changes())

    def step(self, verb: str, name: str, entry: dict[str, Any]) -> None:
        before = self.merged = replace(self.merged, dropped=())
        getattr(self, verb)(name, entry)
        assert verb == "edit" or self.merged.dropped == ()
        assert all(dropped.device == name for dropped in self.merged.dropped)
        for other in set(NAMES) - {name}:
            assert held(self.merged, other) == held(before, other)
            assert self.merged.changes.of(other) == before.changes.of(other)
        assert merge(self.said, self.merged.changes) == replace(self.merged, dropped=())

    def _request(self, changes: Changes) -> None:
        self.merged = merge(self.said, changes)

    def set(self, name: str, entry: dict[str, Any]) -> None:
        before = held(self.merged, name)
        if before is not None:
            wishes = {key: value for key, value in entry.items() if key != "id"}
            self._request(self.merged.changes.setting(name, wishes, self.said))
            assert held(self.merged, name) == {**before, **wishes}

    def add(self, name: str, entry: dict[str, Any]) -> None:
        if name not in self.merged.devices:
            self._request(self.merged.changes.adding(name, entry, Place(entry["id"])))
            assert held(self.merged, name) == {**USUAL, **entry}

    def remove(self, name: str, _: dict[str, Any]) -> None:
        if name in self.merged.devices:
            self._request(self.merged.changes.removing(name, self.said))
            assert name not in self.merged.devices

    def reset(self, name: str, _: dict[str, Any]) -> None:
        self._request(self.merged.changes.resetting(name))
        filed = self.said.slaves.get(name)
        assert held(self.merged, name) == (None if filed is None else {**USUAL, **filed})

    def edit(self, name: str, entry: dict[str, Any]) -> None:
        previous = self.said.slaves.get(name, {})
        self.said = FileValues({**self.said.slaves, name: entry}, 9600, USUAL)
        self._request(self.merged.changes)
        for key, value in entry.items():
            if key not in previous or previous[key] != value:
                assert self.merged.devices[name][key] == value

    def restart(self, _: str, __: dict[str, Any]) -> None:
        before = self.merged
        self._request(before.changes)
        assert self.merged == before


@given(FILES, STEPS)
def test_a_person_s_edit_always_wins_and_nothing_else_is_ever_lost(
    said: FileValues, steps: list[tuple[str, str, dict[str, Any]]]
) -> None:
    life = Life(said)
    for verb, name, entry in steps:
        life.step(verb, name, entry)


@given(FILES, STEPS)
def test_what_is_dropped_did_differ_from_what_holds(
    said: FileValues, steps: list[tuple[str, str, dict[str, Any]]]
) -> None:
    changes = Changes()
    for _, name, entry in steps:
        wishes = {key: value for key, value in entry.items() if key != "id"}
        if name in said.slaves:
            changes = merge(said, changes.setting(name, wishes, said)).changes
        said = FileValues({**said.slaves, name: entry}, 9600, USUAL)
        merged = merge(said, changes)
        for dropped in merged.dropped:
            assert isinstance(dropped, DroppedChange)
            _, device, key = dropped.key.split(".")
            assert (held(merged, device) or {})[key] != dropped.lost
