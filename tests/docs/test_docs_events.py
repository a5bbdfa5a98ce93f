"""Every event that the code publishes is documented with its keys, and nothing else is."""

from __future__ import annotations

import re
from pathlib import Path
from typing import get_args

import pytest

from docs.generate.events import COMMON, EVENTS, published
from lfs10d.telemetry.publication import EventType

PAGE = (Path(__file__).parents[2] / "docs" / "mqtt.md").read_text(encoding="utf-8")
PUBLISHED = published()


def test_every_event_of_the_code_is_documented_and_no_other() -> None:
    assert set(PUBLISHED) == set(EVENTS) == set(get_args(EventType))


@pytest.mark.parametrize("name", EVENTS)
def test_the_keys_of_an_event_are_documented(name: EventType) -> None:
    assert PUBLISHED[name] <= EVENTS[name].keys.keys()
    assert EVENTS[name].example.keys() <= EVENTS[name].keys.keys()
    section = PAGE.partition(f"### Event `{name}`\n")[2].partition("\n##")[0]
    assert set(re.findall(r"^\| `(\w+)` \|", section, re.MULTILINE)) == EVENTS[name].keys.keys()


def test_no_event_documents_the_keys_that_all_have() -> None:
    assert all(not COMMON & each.keys.keys() for each in EVENTS.values())


def test_an_event_is_found_where_it_is_published() -> None:
    assert {"device", "from", "to"} <= PUBLISHED["readdressed"]
    assert {"request", "id"} <= PUBLISHED["change_applied"]
