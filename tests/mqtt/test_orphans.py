"""A sweep finds the retained topics that nobody stands behind."""

from __future__ import annotations

from lfs10d.mqtt.orphans import AT_ONCE, LONGEST, QUIET, OrphanSearch
from lfs10d.mqtt.topics import Topics

B = Topics("b/line0")


def orphans(search: OrphanSearch, *owned: str) -> list[str]:
    return [topic for some in search.orphans(lambda: frozenset(owned)) for topic in some]


def test_what_nobody_owned_is_an_orphan() -> None:
    sweep = OrphanSearch(B, 0.0)
    assert sweep.on_message("b/line0/device/gone/state", b"{}", 0.1)
    assert sweep.on_message("b/line0/device/gone/config", b"{}", 0.1)
    assert sweep.on_message("b/line0/device/here/state", b"{}", 0.1)
    assert orphans(sweep, "device/here/state") == ["device/gone/state", "device/gone/config"]


def test_thousands_are_told_in_parts_and_a_device_that_comes_meanwhile_keeps_its_topics() -> None:
    sweep = OrphanSearch(B, 0.0)
    for number in range(AT_ONCE + 1):
        sweep.on_message(f"b/line0/device/d{number}/state", b"{}", 0.1)
    owned: set[str] = set()
    parts = sweep.orphans(lambda: owned)
    assert len(next(parts)) == AT_ONCE
    owned.add(f"device/d{AT_ONCE}/state")
    assert list(parts) == [()]


def test_other_topics_are_left_alone() -> None:
    sweep = OrphanSearch(B, 0.0)
    assert not sweep.on_message("b/line1/device/gone/state", b"{}", 0.1)
    assert not sweep.on_message("b/line0/device/gone/notes", b"{}", 0.1)
    assert orphans(sweep) == []


def test_a_clearing_message_leaves_nothing_to_clear() -> None:
    sweep = OrphanSearch(B, 0.0)
    assert sweep.on_message("b/line0/device/gone/state", b"", 0.1)
    assert orphans(sweep) == []


def test_it_is_over_when_the_broker_has_fallen_silent() -> None:
    sweep = OrphanSearch(B, 10.0)
    assert sweep.due == 10.0 + LONGEST, "a broker that has not answered yet has much to do"
    sweep.subscribed(10.2)
    assert sweep.due == 10.2 + QUIET
    sweep.on_message("b/line0/device/gone/state", b"{}", 10.3)
    assert sweep.due == 10.3 + QUIET


def test_it_is_over_after_two_minutes_in_any_case() -> None:
    sweep = OrphanSearch(B, 10.0)
    sweep.on_message("b/line0/device/gone/state", b"{}", 129.9)
    assert sweep.due == 10.0 + LONGEST
