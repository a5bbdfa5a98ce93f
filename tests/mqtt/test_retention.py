"""Of each retained topic one version waits and one is under way; `last` closes a burst."""

from __future__ import annotations

from lfs10d import telemetry
from lfs10d.mqtt.retention import Retention

NONE: frozenset[str] = frozenset()
ONLINE = telemetry.retained("availability", "online")


def state(version: int, topic: str = "state") -> telemetry.Publication:
    return telemetry.retained(topic, {"version": version})


def test_nothing_waits_at_first() -> None:
    retention = Retention()
    assert (bool(retention), retention.announced, retention.first, retention.next(NONE)) == (False, True, False, None)


def test_the_newest_version_waits_until_the_one_under_way_is_over() -> None:
    retention = Retention()
    retention.add(state(1))
    first = retention.next(NONE)
    assert first is not None
    retention.add(state(2))
    retention.add(state(3))
    assert retention
    assert retention.next(NONE) is None
    retention.over(first)
    second = retention.next(NONE)
    assert second is not None
    assert second.publication == state(3)


def test_a_burst_is_announced_when_its_last_is_over() -> None:
    retention = Retention()
    retention.burst([state(1)], ONLINE)
    first = retention.next(NONE)
    assert first is not None
    assert retention.next(NONE) is None
    assert retention.first
    retention.over(first)
    last = retention.next(NONE)
    assert last is not None
    assert (last.publication, retention.first, retention.announced) == (ONLINE, False, False)
    retention.over(last)
    assert retention.announced


def test_a_refused_last_is_no_reason_to_wait() -> None:
    retention = Retention()
    retention.burst([state(1)], ONLINE)
    assert retention.next(frozenset({"state", "availability"})) is None
    assert retention.announced
    assert not retention


def test_a_second_last_waits_for_the_first() -> None:
    retention = Retention()
    retention.burst([], ONLINE)
    first = retention.next(NONE)
    assert first is not None
    retention.burst([], ONLINE)
    assert retention.next(NONE) is None
    retention.over(first)
    assert retention.next(NONE) is not None


def test_a_loss_leaves_only_what_clears_a_topic() -> None:
    retention = Retention()
    retention.burst([state(1), telemetry.retained("gone", None)], ONLINE)
    retention.lost()
    left = retention.next(NONE)
    assert left is not None
    assert left.topic == "gone"
    assert retention.next(NONE) is None


def test_a_clearing_is_put_back_unless_a_newer_version_waits() -> None:
    retention = Retention()
    for topic in ("gone", "back"):
        retention.add(telemetry.retained(topic, None))
    gone, back = retention.next(NONE), retention.next(NONE)
    assert gone is not None
    assert back is not None
    retention.lost()
    retention.add(state(2, "back"))
    retention.put_back(gone)
    retention.put_back(back)
    retention.add(state(1, "other"))
    waiting = [letter.publication.payload for _ in range(3) if (letter := retention.next(NONE)) is not None]
    assert waiting == [{"version": 2}, None, {"version": 1}]
    other = Retention()
    other.add(state(1))
    letter = other.next(NONE)
    assert letter is not None
    other.lost()
    other.put_back(letter)
    assert not other
