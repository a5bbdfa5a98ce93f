"""Whatever the round trip and the window: every class and every device goes on, and the backlog is carried away.

The pure outbox against a broker in virtual time that acknowledges each message one round trip after it was sent.
"""

from __future__ import annotations

import heapq
from dataclasses import dataclass, field
from itertools import count

import pytest
from hypothesis import Phase, example, given, settings
from hypothesis import strategies as st

from lfs10d.outbox.backlog import BATCH_MOST, HISTORY_AFTER, SAMPLE_EVERY, TURN_EVERY
from lfs10d.outbox.drain import LEVEL_MOST
from lfs10d.outbox.items import HistoryBatch, LiveSample, Message, OutboxItem, Retained, samples_of
from lfs10d.outbox.outbox import IN_FLIGHT_MOST, Outbox
from lfs10d.outbox.queues import BURST_FIRST
from lfs10d.outbox.turns import LEAST_WEIGHT, REFRESH_WEIGHT, WEIGHT
from lfs10d.telemetry import publication
from lfs10d.telemetry.publication import Publication, PublicationKind, Sample
from tests.support.outbox_items import named_event

ONLINE = publication.retained("availability", "online")
WEIGHTS = 3 * WEIGHT + WEIGHT * LEVEL_MOST + REFRESH_WEIGHT + 2 * LEAST_WEIGHT
"""The sum of all weights at the highest level of the backlog."""


def sample(device: str, seq: int) -> Publication:
    measured = Sample(device, "k", seq, 1000 * seq, "synced", None, {}, (), "bad", "timeout", None)
    topic = publication.device_topic(device, publication.TELEMETRY)
    return Publication(topic, {}, PublicationKind.SAMPLE, retain=False, qos=1, sample=measured)


@dataclass
class Uplink:
    """Devices polled every `interval` s, published by an outbox to a broker `round_trip` s away.

    `stats` counts what arrived; `events_every` s an event is published.
    """

    round_trip: float
    window: int
    devices: int
    interval: float = 1.0
    events_every: float = 5.0
    batch_most: int = BATCH_MOST
    outbox: Outbox = field(default_factory=lambda: Outbox(capacity=1_000_000))
    now: float = 0.0
    seqs: dict[str, int] = field(default_factory=dict)
    arrived: dict[str, set[int]] = field(default_factory=dict)
    twice: int = 0
    last: dict[str, float] = field(default_factory=dict)
    """When the last message of each topic arrived."""
    longest: dict[str, float] = field(default_factory=dict)
    """The longest time from one message of each topic to the next."""
    changes: dict[str, float] = field(default_factory=dict)
    """How long each change of a retained topic took to be acknowledged."""
    asked: dict[str, float] = field(default_factory=dict)
    acknowledgements: list[tuple[float, int, OutboxItem]] = field(default_factory=list)
    most_under_way: int = 0
    events: int = 0
    warned: list[float] = field(default_factory=list)

    def __post_init__(self) -> None:
        self._numbers = count()
        self._polls: list[tuple[float, str]] = []
        for number in range(self.devices):
            device = f"d{number}"
            self.seqs[device] = 0
            self.arrived[device] = set()
            heapq.heappush(self._polls, (self.interval * number / self.devices, device))
        self._event_at = self.events_every

    def connect(self, burst: int = 4) -> None:
        """Connect; the burst has this many topics of each device."""
        self.outbox.connected(self.now, window=min(self.window, IN_FLIGHT_MOST))
        self.outbox.backlog._batch_most = self.batch_most
        topics = [publication.device_topic(device, f"leaf{leaf}") for device in self.seqs for leaf in range(burst)]
        self.outbox.burst([publication.retained(topic, {}) for topic in topics], ONLINE)

    def measure(self, device: str) -> None:
        """Finish a poll."""
        self.seqs[device] += 1
        self.outbox.add(sample(device, self.seqs[device]), self.now)
        state = publication.device_topic(device, publication.STATE)
        self.outbox.add(publication.retained(state, {"seq": self.seqs[device]}, refresh=True), self.now)

    def change(self, topic: str) -> None:
        """Publish a change of a retained topic."""
        self.asked[topic] = self.now
        self.outbox.add(publication.retained(topic, {"at": self.now}), self.now)

    def run(self, seconds: float, *, measuring: bool = True) -> None:
        """Let time go by."""
        end = self.now + seconds
        while True:
            self._send()
            times = [end]
            if measuring:
                times += [self._polls[0][0], self._event_at]
            if self.acknowledgements:
                times.append(self.acknowledgements[0][0])
            if (
                len(self.outbox._in_flight) < min(self.window, IN_FLIGHT_MOST)
                and (due := self.outbox.due()) is not None
            ):
                times.append(max(due, self.now + 1e-4))
            self.now = max(self.now, min(times))
            if self.now >= end:
                return
            while self.acknowledgements and self.acknowledgements[0][0] <= self.now:
                self._acknowledge(heapq.heappop(self.acknowledgements)[2])
            while measuring and self._polls[0][0] <= self.now:
                at, device = heapq.heappop(self._polls)
                heapq.heappush(self._polls, (max(at, self.now - self.interval) + self.interval, device))
                self.measure(device)
            if measuring and self._event_at <= self.now:
                self._event_at = self.now + self.events_every
                self.outbox.add(publication.event("scan_progress", 0), self.now)

    def _send(self) -> None:
        while (item := self.outbox.next(self.now)) is not None:
            heapq.heappush(self.acknowledgements, (self.now + self.round_trip, next(self._numbers), item))
        under_way = tuple(self.outbox._in_flight)
        assert len(under_way) <= min(self.window, IN_FLIGHT_MOST)
        self.most_under_way = max(self.most_under_way, sum(isinstance(each, HistoryBatch) for each in under_way))

    def _acknowledge(self, item: OutboxItem) -> None:
        self.outbox.on_ack(item, self.now)
        if self.outbox.congested(self.now) is not None:
            self.warned.append(self.now)
        topic = item.topic
        self.events += isinstance(item, Message)
        if topic in self.asked:
            self.changes[topic] = max(self.changes.get(topic, 0.0), self.now - self.asked.pop(topic))
        self.longest[topic] = max(self.longest.get(topic, 0.0), self.now - self.last.get(topic, self.now))
        self.last[topic] = self.now
        for queued in samples_of(item):
            seqs = self.arrived[queued.sample.device]
            self.twice += queued.sample.seq in seqs
            seqs.add(queued.sample.seq)

    @property
    def rate(self) -> float:
        """Messages a second that the window carries."""
        return min(self.window, IN_FLIGHT_MOST) / self.round_trip

    def missing(self) -> int:
        """Return how many samples were measured and have not arrived."""
        return sum(self.seqs.values()) - sum(map(len, self.arrived.values()))


class Wait:
    """The bounds that hold for any round trip, window and number of devices."""

    def __init__(self, uplink: Uplink) -> None:
        self.slot = 1.0 / uplink.rate
        self.devices = uplink.devices

    def of(self, weight: int, messages: int) -> float:
        """Return the longest time in s until the last of so many messages of a class of this weight has arrived.

        Messages of a class go at least at its part of the window, once those under way before are acknowledged.
        """
        return 20 * self.slot + 2 * messages * self.slot * WEIGHTS / weight


POLLS = 2000
"""Polls of one case, so that it takes a second at most."""


@settings(max_examples=12, deadline=None, phases=(Phase.explicit, Phase.generate), derandomize=True)
@given(
    st.sampled_from([0.001, 0.02, 0.2, 0.9, 3.0]),
    st.sampled_from([1, 2, 3, 10, 20, 65_535]),
    st.sampled_from([1, 2, 8, 32, 255]),
)
@example(3.0, 1, 32)
@example(3.0, 20, 255)
@example(0.2, 1, 8)
def test_no_class_and_no_device_waits_longer_than_its_bound(round_trip: float, window: int, devices: int) -> None:
    wait = Wait(Uplink(round_trip, window, devices))
    states, live = wait.of(REFRESH_WEIGHT, devices), wait.of(WEIGHT, devices)
    seconds = max(30.0, 1.2 * states + 10.0)
    uplink = Uplink(round_trip, window, devices, interval=max(0.25, seconds * devices / POLLS))
    uplink.connect(burst=0)
    uplink.run(HISTORY_AFTER)
    uplink.last = dict.fromkeys(uplink.last, uplink.now)
    uplink.longest.clear()
    uplink.change("line/error")
    uplink.run(seconds)
    assert uplink.changes["line/error"] <= wait.of(WEIGHT, 1)
    for device in uplink.seqs:
        for leaf, bound in ((publication.STATE, states), (publication.TELEMETRY, live)):
            topic = publication.device_topic(device, leaf)
            since = uplink.now - uplink.last.get(topic, HISTORY_AFTER)
            assert max(uplink.longest.get(topic, 0.0), since) <= bound + 2 * uplink.interval + uplink.round_trip, topic
    since = uplink.now - uplink.last.get(publication.EVENT, HISTORY_AFTER)
    assert max(since, uplink.longest[publication.EVENT]) <= wait.of(WEIGHT, 2) + uplink.events_every + round_trip


@pytest.mark.parametrize(
    ("round_trip", "window", "devices"),
    [(3.0, 1, 7), (3.0, 2, 16), (1.0, 3, 75), (0.2, 1, 32)],
)
def test_the_backlog_shrinks_where_batches_in_three_quarters_of_the_window_carry_more_than_is_measured(
    round_trip: float, window: int, devices: int
) -> None:
    """Arrays of 35 samples are what 8 KB holds."""
    uplink = Uplink(round_trip, window, devices, batch_most=35)
    assert uplink.rate * 35 * 0.75 > devices
    for _ in range(60):  # a minute away
        for device in uplink.seqs:
            uplink.measure(device)
    uplink.connect(burst=0)
    uplink.run(300.0)  # until the backlog has as much of the window as it needs
    depth = uplink.outbox.depth
    uplink.run(300.0)
    assert uplink.outbox.depth < max(depth, 36 * devices)
    uplink.run(900.0 * (3600 / 900 if round_trip > 1 else 1), measuring=False)
    assert uplink.missing() == 0
    assert uplink.outbox.stats.dropped == 0
    assert not uplink.twice


@pytest.mark.parametrize(("round_trip", "window", "devices"), [(0.9, 20, 20), (0.2, 10, 32)])
def test_everything_measured_arrives_within_seconds_and_one_warning_says_what_the_window_carries(
    round_trip: float, window: int, devices: int
) -> None:
    uplink = Uplink(round_trip, window, devices)
    uplink.connect()
    uplink.run(120.0)
    assert uplink.missing() <= 8 * devices
    assert all(uplink.last[publication.device_topic(each, publication.TELEMETRY)] > 115.0 for each in uplink.seqs)
    assert all(uplink.longest[publication.device_topic(each, publication.STATE)] < 10.0 for each in uplink.seqs)
    assert len(uplink.warned) == 1


def test_a_batch_goes_every_two_seconds_whatever_the_round_trip() -> None:
    uplink = Uplink(3.0, 20, 20)
    for _ in range(10):
        for device in uplink.seqs:
            uplink.measure(device)
    uplink.connect(burst=0)
    uplink.run(HISTORY_AFTER + 20 * TURN_EVERY + uplink.round_trip, measuring=False)
    arrived = [seqs for seqs in uplink.arrived.values() if seqs]
    assert len(arrived) == uplink.devices
    assert uplink.most_under_way == 2  # no more than that needs


def test_a_burst_keeps_everything_else_back_for_ten_seconds_at_most() -> None:
    uplink = Uplink(3.0, 1, 32)
    uplink.connect()
    uplink.run(BURST_FIRST - 0.1)
    assert not any(topic.endswith(("telemetry", "history")) for topic in uplink.last)
    uplink.run(60.0)
    assert any(topic.endswith("telemetry") for topic in uplink.last)
    assert any(topic.endswith("history") for topic in uplink.last)
    assert not uplink.outbox.announced
    uplink.run(1500.0)
    assert uplink.outbox.announced


def test_a_fast_device_takes_no_turns_from_a_slow_one() -> None:
    outbox = Outbox()
    outbox.connected(0.0)
    outbox.burst([], ONLINE)
    online = outbox.next(0.0)
    assert isinstance(online, Retained)
    outbox.on_ack(online, 0.0)
    for seq in (1, 2, 3):
        outbox.add(sample("fast", seq), 0.0)
    outbox.add(sample("slow", 1), 0.1)
    order = []
    while isinstance(item := outbox.next(0.2), LiveSample):
        order.append(item.queued.key[0])
    assert order == ["fast", "slow", "fast", "fast"]


def test_a_healthy_uplink_is_no_slower_for_any_of_it() -> None:
    uplink = Uplink(0.001, 20, 32, interval=0.25)
    uplink.connect()
    uplink.run(60.0)
    assert uplink.missing() <= 2
    assert not any(topic.endswith("history") for topic in uplink.last)
    assert max(uplink.longest.values()) <= max(uplink.interval, uplink.events_every) + 0.01
    assert not uplink.warned


def test_a_thousand_samples_a_second_leave_at_most() -> None:
    uplink = Uplink(0.001, 20, 4)
    for _ in range(3000):
        for device in uplink.seqs:
            uplink.measure(device)
    uplink.now = 60.0
    uplink.connect(burst=0)
    uplink.run(HISTORY_AFTER + 5.0, measuring=False)
    assert 4500 <= sum(map(len, uplink.arrived.values())) <= 5.0 / SAMPLE_EVERY + BATCH_MOST


def test_messages_go_in_turn_with_everything_else() -> None:
    uplink = Uplink(0.2, 1, 32)
    uplink.connect(burst=0)
    uplink.run(60.0)
    for number in range(30):
        uplink.outbox.add(named_event(f"e{number}"), uplink.now)
    arrived = sum(map(len, uplink.arrived.values()))
    events = uplink.events
    uplink.run(20.0, measuring=False)
    assert sum(map(len, uplink.arrived.values())) > arrived + 50
    assert uplink.events == events + 30
