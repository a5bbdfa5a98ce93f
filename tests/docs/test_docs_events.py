"""Every event that the code publishes is documented with its keys, and nothing else is."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import get_args

import pytest

from docs.generate.events import COMMON, EVENTS, published
from lfs10d.telemetry.publication import EventType

PAGE = (Path(__file__).parents[2] / "docs" / "mqtt.md").read_text(encoding="utf-8")


@pytest.fixture(name="found", scope="module")
def _found() -> Mapping[str, set[str]]:
    """Give the types that the code publishes: the search takes a second, which collecting the tests need not wait."""
    return published()


def test_every_event_of_the_code_is_documented_and_no_other(found: Mapping[str, set[str]]) -> None:
    assert set(found) == set(EVENTS) == set(get_args(EventType))


@pytest.mark.parametrize("name", EVENTS)
def test_the_keys_of_an_event_are_documented(found: Mapping[str, set[str]], name: EventType) -> None:
    assert found[name] <= EVENTS[name].keys.keys()
    assert EVENTS[name].example.keys() <= EVENTS[name].keys.keys()
    section = PAGE.partition(f"### Event `{name}`\n")[2].partition("\n##")[0]
    assert set(re.findall(r"^\| `(\w+)` \|", section, re.MULTILINE)) == EVENTS[name].keys.keys()


def test_no_event_documents_the_keys_that_all_have() -> None:
    assert all(not COMMON & each.keys.keys() for each in EVENTS.values())


def test_an_event_is_found_where_it_is_published(found: Mapping[str, set[str]]) -> None:
    assert {"device", "from", "to"} <= found["readdressed"]
    assert {"request", "id"} <= found["change_applied"]
