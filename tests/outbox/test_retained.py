"""Of each retained topic one version waits and one is under way; `last` closes a burst."""

from __future__ import annotations

import time

from lfs10d.outbox.items import Retained
from lfs10d.outbox.retained import RetainedQueue
from lfs10d.telemetry import publication

NONE: frozenset[str] = frozenset()
ONLINE = publication.retained("availability", "online")


def state(version: int, topic: str = "state") -> publication.Publication:
    return publication.retained(topic, {"version": version})


def test_nothing_waits_at_first() -> None:
    retention = RetainedQueue()
    assert (bool(retention), retention.announced, retention.last, retention.next_change(NONE)) == (
        False,
        True,
        None,
        None,
    )


def test_the_newest_version_waits_until_the_one_under_way_is_over() -> None:
    retention = RetainedQueue()
    retention.add(state(1), 0.0)
    first = retention.next_change(NONE)
    assert first is not None
    retention.add(state(2), 0.0)
    retention.add(state(3), 0.0)
    assert retention
    assert retention.next_change(NONE) is None
    retention.over(first)
    second = retention.next_change(NONE)
    assert second is not None
    assert second.publication == state(3)


def test_a_burst_is_announced_when_its_last_is_over() -> None:
    retention = RetainedQueue()
    retention.burst([state(1)], ONLINE)
    first = retention.next_change(NONE)
    assert first is not None
    assert retention.next_change(NONE) is None
    assert retention
    retention.over(first)
    last = retention.next_change(NONE)
    assert last is not None
    assert (last.publication, retention.announced) == (ONLINE, False)
    assert retention.last is None
    retention.over(last)
    assert retention.announced


def test_a_refused_last_is_no_reason_to_wait() -> None:
    retention = RetainedQueue()
    retention.burst([state(1)], ONLINE)
    assert retention.next_change(frozenset({"state", "availability"})) is None
    assert retention.announced
    assert not retention


def test_a_second_last_waits_for_the_first() -> None:
    retention = RetainedQueue()
    retention.burst([], ONLINE)
    first = retention.next_change(NONE)
    assert first is not None
    retention.burst([], ONLINE)
    assert retention.next_change(NONE) is None
    retention.over(first)
    assert retention.next_change(NONE) is not None


def test_a_loss_leaves_only_what_clears_a_topic() -> None:
    retention = RetainedQueue()
    retention.burst([state(1), publication.retained("gone", None)], ONLINE)
    retention.lost()
    left = retention.take(retention.clearings, NONE)
    assert left is not None
    assert left.topic == "gone"
    assert (retention.next_change(NONE), retention.take(retention.clearings, NONE)) == (None, None)


def test_a_clearing_is_put_back_unless_a_newer_version_waits() -> None:
    retention = RetainedQueue()
    for topic in ("gone", "back", "again"):
        retention.add(publication.retained(topic, None), 0.0)
    gone, back, again = (retention.take(retention.clearings, NONE) for _ in range(3))
    assert gone is not None
    assert back is not None
    assert again is not None
    retention.lost()
    retention.add(state(2, "back"), 0.0)
    retention.add(publication.retained("again", None), 0.0)
    for item in (gone, back, again):
        retention.put_back(item)
    waiting = [each and each.publication.payload for each in (retention.next_change(NONE), retention.next_change(NONE))]
    assert waiting == [{"version": 2}, None]
    assert [item and item.topic for item in (retention.take(retention.clearings, NONE) for _ in range(3))] == [
        "again",
        "gone",
        None,
    ]
    other = RetainedQueue()
    other.add(state(1), 0.0)
    version = other.next_change(NONE)
    assert version is not None
    other.lost()
    other.put_back(version)
    assert not other


def test_the_newest_of_what_clears_and_what_fills_a_topic_waits() -> None:
    retention = RetainedQueue()
    retention.add(publication.retained("state", None), 0.0)
    retention.add(state(1), 0.0)
    assert retention.take(retention.clearings, NONE) is None
    retention.add(publication.retained("state", None), 0.0)
    assert retention.next_change(NONE) is None
    clearing = retention.take(retention.clearings, NONE)
    assert clearing is not None
    retention.add(publication.retained("state", None), 0.0)
    assert retention.take(retention.clearings, NONE) is None, "one is under way"
    retention.over(clearing)
    assert retention.take(retention.clearings, NONE) is not None
    assert not retention


def test_what_is_passed_over_waits_in_its_newest_version_until_its_topic_is_tried_again() -> None:
    retention = RetainedQueue()
    retention.burst([state(1), publication.retained("gone", None)], ONLINE)
    refused = frozenset({"state", "gone", "availability"})
    assert (retention.next_change(refused), retention.take(retention.clearings, refused), bool(retention)) == (
        None,
        None,
        False,
    )
    retention.add(state(2), 0.0)
    assert retention.next_change(refused) is None
    retention.lifted(frozenset({"state", "other"}))
    version = retention.next_change(frozenset({"gone", "availability"}))
    assert version is not None
    assert version.publication == state(2)
    retention.wait_again(version)
    retention.over(version)
    retention.add(state(3), 0.0)
    retention.lifted(refused)
    newest = [item and item.publication for item in (retention.next_change(NONE) for _ in range(3))]
    assert newest == [state(3), ONLINE, None]
    retention.next_change(frozenset({"gone"}))
    retention.lost()
    assert retention.take(retention.clearings, NONE) is not None


def test_thousands_of_clearings_are_taken_in_linear_time() -> None:
    retention = RetainedQueue()
    for number in range(60_000):
        retention.add(publication.retained(f"device/{number}/state", None), 0.0)
    under_way: list[Retained] = []
    begun = time.process_time()
    while (item := retention.take(retention.clearings, NONE)) is not None:
        under_way.append(item)
        if len(under_way) == 20:
            retention.over(under_way.pop(0))
    assert time.process_time() - begun < 5.0, "a look at all that wait for each would take minutes"


def refresh(version: int, topic: str = "state") -> publication.Publication:
    return publication.retained(topic, {"version": version}, refresh=True)


def test_refreshes_wait_apart_and_a_newer_one_replaces_in_its_place() -> None:
    retention = RetainedQueue()
    replaced = [
        retention.add(refresh(version, topic), float(version)) for version, topic in ((1, "a"), (2, "b"), (3, "a"))
    ]
    assert replaced == [False, False, True]
    assert retention.next_change(NONE) is None
    went = [
        retention.take(retention.refreshes, NONE),
        retention.take(retention.refreshes, NONE),
        retention.take(retention.refreshes, NONE),
    ]
    assert [each and (each.topic, each.publication.payload) for each in went] == [
        ("a", {"version": 3}),
        ("b", {"version": 2}),
        None,
    ]


def test_a_refresh_replaced_at_the_moment_it_was_published_had_not_waited() -> None:
    retention = RetainedQueue()
    retention.add(refresh(1), 5.0)
    assert not retention.add(refresh(2), 5.0)
    assert retention.add(refresh(3), 5.1)


def test_a_change_takes_the_place_of_a_refresh() -> None:
    retention = RetainedQueue()
    retention.add(refresh(1), 0.0)
    assert retention.add(state(2), 1.0)
    assert retention.take(retention.refreshes, NONE) is None
    change = retention.next_change(NONE)
    assert change is not None
    assert change.publication == state(2)


def test_a_refresh_of_a_topic_whose_change_waits_goes_as_the_change() -> None:
    retention = RetainedQueue()
    retention.add(state(1), 0.0)
    assert not retention.add(refresh(2), 1.0)
    change = retention.next_change(NONE)
    assert change is not None
    assert change.publication == refresh(2)
    assert not retention


def test_the_last_of_a_burst_follows_the_refreshes_in_it_and_waits_for_no_other() -> None:
    """With the figures apart, `online` and every sample waited 10 s after each connect."""
    retention = RetainedQueue()
    retention.add(refresh(1), 0.0)
    retention.add(publication.retained("state", None), 0.0)
    retention.burst([refresh(2), refresh(1, "stats"), publication.retained("gone", None)], ONLINE)
    went = [retention.next_change(NONE), retention.next_change(NONE)]
    assert [each and each.topic for each in went] == ["state", "stats"]
    for each in went:
        assert each is not None
        retention.over(each)
    last = retention.next_change(NONE)
    assert last is not None
    assert last.publication == ONLINE
    assert retention.take(retention.refreshes, NONE) is None


def test_a_loss_forgets_refreshes() -> None:
    retention = RetainedQueue()
    retention.add(refresh(1), 0.0)
    assert retention
    retention.lost()
    assert not retention


def test_refreshes_of_a_burst_go_with_its_changes_and_before_its_last() -> None:
    retention = RetainedQueue()
    retention.burst([publication.retained("stats", {}, qos=0, refresh=True), state(1)], ONLINE)
    told = []
    while not retention.announced:
        item = retention.next_change(NONE)
        assert item is not None
        told.append(item.topic)
        retention.over(item)
    assert told == ["stats", "state", "availability"]
