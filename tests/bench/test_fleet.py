"""The account of `bench.fleet`."""

from __future__ import annotations

import json

from bench.fleet import Heard


def payload(*seqs: int, device: str = "slave-1", ts: int = 100_000) -> bytes:
    samples = [{"device": device, "boot": "k1", "seq": seq, "ts": ts} for seq in seqs]
    return json.dumps(samples if len(samples) > 1 else samples[0]).encode()


def test_a_sample_counts_once_by_gateway_device_boot_and_seq() -> None:
    heard = Heard()
    heard.take("fleet/gw001/line0/device/slave-1/telemetry", payload(1), 1)
    heard.take("fleet/gw001/line0/device/slave-1/history", payload(1, 2), 2)
    heard.take("fleet/gw002/line0/device/slave-1/telemetry", payload(1), 2)
    heard.take("fleet/gw002/line0/device/slave-2/telemetry", payload(1, device="slave-2"), 2)
    assert (len(heard.keys), heard.again, heard.messages) == (4, 1, 4)
    sent = {("gw001", "slave-1"): 2, ("gw002", "slave-1"): 1, ("gw002", "slave-2"): 3}
    assert heard.lost(sent) == 2


def test_a_backlog_is_in_when_its_last_sample_of_the_time_without_a_broker_came_first() -> None:
    heard = Heard(watch=100, back=110)
    topic = "fleet/gw001/line0/device/slave-1/history"
    heard.take(topic, payload(1, ts=99_000), 99.5)
    heard.take(topic, payload(3, ts=111_000), 111.2)
    heard.take(topic, payload(2, ts=105_000), 121)
    heard.take(topic, payload(2, ts=105_000), 125)
    assert heard.first_after == {"gw001": 111.2}
    assert heard.caught_up == {"gw001": 121}
