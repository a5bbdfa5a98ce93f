"""Retained topics in the outbox: one version waits, one is under way."""

from __future__ import annotations

from lfs10d.outbox.items import Retained
from lfs10d.outbox.outbox import Outbox
from lfs10d.telemetry import publication as telemetry
from tests.support.outboxes import (
    ONLINE,
    connected,
    state,
    take,
)


def test_what_is_retained_is_out_when_no_version_of_a_topic_waits() -> None:
    outbox = connected()
    out = [outbox.retained_out]
    outbox.add(state(1, "a"), 0.0)
    out.append(outbox.retained_out)
    take(outbox, 0.0, Retained)
    out.append(outbox.retained_out)
    outbox.lost(1.0)
    out.append(outbox.retained_out)
    assert out == [True, False, True, False]


# Retained topics


def test_of_a_retained_topic_the_newest_version_waits() -> None:
    outbox = connected()
    outbox.add(state(1), 0.0)
    outbox.add(state(2), 0.0)
    assert take(outbox, 0.0, Retained).publication.payload == {"version": 2}
    assert outbox.next(0.0) is None


def test_no_second_version_goes_while_the_first_is_under_way() -> None:
    outbox = connected()
    outbox.add(state(1), 0.0)
    first = take(outbox, 0.0, Retained)
    outbox.add(state(2), 0.0)
    assert outbox.next(0.0) is None
    outbox.on_ack(first, 0.0)
    assert take(outbox, 0.0, Retained).publication.payload == {"version": 2}


def test_a_second_burst_waits_for_the_first_to_be_over() -> None:
    outbox = connected()
    outbox.add(ONLINE, 0.0)
    online = take(outbox, 0.0, Retained)
    outbox.burst([], ONLINE)
    assert outbox.next(0.0) is None
    outbox.on_ack(online, 0.0)
    assert take(outbox, 0.0, Retained).topic == "availability"


def test_while_the_broker_is_away_only_clearing_of_retained_topics_is_kept() -> None:
    outbox = Outbox()
    outbox.add(state(1, "here"), 0.0)
    outbox.add(telemetry.retained("device/gone/state", None), 0.0)
    connect_letters = []
    outbox.connected(1.0)
    while (item := outbox.next(1.0)) is not None:
        connect_letters.append(item.topic)
    assert connect_letters == ["device/gone/state"]


def test_a_loss_keeps_clearings_and_forgets_the_other_versions() -> None:
    outbox = connected()
    outbox.add(telemetry.retained("device/gone/state", None), 0.0)
    outbox.add(state(1, "b"), 0.0)
    take(outbox, 0.0, Retained)
    take(outbox, 0.0, Retained)
    outbox.add(telemetry.retained("device/gone/config", None), 0.0)
    outbox.add(state(1, "c"), 0.0)
    outbox.lost(1.0)
    outbox.connected(2.0)
    topics = {take(outbox, 2.0, Retained).topic for _ in range(2)}
    assert topics == {"device/gone/state", "device/gone/config"}
    assert outbox.next(2.0) is None
