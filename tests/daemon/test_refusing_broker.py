"""A broker that does not take everything: limits of size, denied topics, or being thrown out. The rest comes."""

from __future__ import annotations

import json
import time
from collections.abc import Iterator

import pytest

from tests.support.answering_brokers import Capricious
from tests.support.brokers import Mosquitto
from tests.support.sites import QUICK, Site, View, eventually, good

HISTORY_WITHIN = 40.0
"""Seconds in which the backlog of these tests is out: it begins 10 s after a connect, also after a second and third."""

CUT_WITHIN = 60.0
"""Seconds in which it is out where every batch that is too large ends a connection: a batch of 8000 bytes ends two
before it is known to be why and its half a third, so that a quarter goes 10 s after the fourth connect."""


def whole(view: View, device: str, newest: int) -> bool:
    """Tell whether no sample of a device is missing up to this one."""
    return {one["seq"] for one in view.samples(device)} >= set(range(1, newest + 1))


@pytest.mark.parametrize(
    ("version", "limit"),
    [("5", "message_size_limit 2000"), ("5", "max_packet_size 2000"), ("3.1.1", "max_packet_size 2000")],
)
@pytest.mark.long(50)
def test_no_history_is_lost_at_a_broker_that_takes_only_small_messages(
    site: Site, mosquitto: Mosquitto, version: str, limit: str
) -> None:
    """By MQTT 5 mosquitto refuses with 0x95, or names its limit; by 3.1.1 it closes the connection without a word.

    (By 3.1.1 it acknowledges what is above `message_size_limit` and drops it, which nobody can know.)
    """
    mosquitto.stop()
    mosquitto.configuration += [limit]
    site.line()
    if version == "5":  # a connection that a batch ends within 10 s is a short one, after which the next begins later
        site.pace = QUICK
    site.write(poll={"interval": "100ms"}, mqtt={"version": version})
    run = site.run()
    run.says("connection refused")
    time.sleep(6.0)  # until an array has more than 2000 bytes

    mosquitto.start()
    view = View(mosquitto.subscribe())
    view.wait("device/slave-1/state", good)
    newest = view.newest("device/slave-1/state")["seq"]
    within = CUT_WITHIN if version == "3.1.1" else HISTORY_WITHIN
    eventually(lambda: whole(view, "slave-1", newest), "all of it", within=within)
    assert not [one for one in view.history_of("event") if one["type"] == "dropped"]


def test_samples_that_may_not_go_live_go_as_history_and_what_is_allowed_goes_on(
    site: Site, mosquitto: Mosquitto
) -> None:
    acl = mosquitto.folder / "acl"
    allowed = ("availability", "device/+/state", "device/slave-1/history", "device/slave-2/#")
    acl.write_text("topic read #\n" + "".join(f"topic write lfs10d/line0/{each}\n" for each in allowed))
    mosquitto.stop()
    mosquitto.configuration += [f"acl_file {acl}"]
    mosquitto.start()
    view = View(mosquitto.subscribe())
    site.line()
    site.pace = QUICK
    site.write()
    run = site.run()
    view.wait_samples("slave-2", 5)
    eventually(lambda: len(view.samples("slave-1")) > 5, "history", within=HISTORY_WITHIN)
    assert view.newest("device/slave-1/telemetry") is None
    assert run.log.count("refuses lfs10d/line0/device/slave-1/telemetry: not authorized") == 1
    assert run.log.count("connected by") == 1


@pytest.fixture
def capricious() -> Iterator[Capricious]:
    """Give a broker that has a mind of its own."""
    made = Capricious()
    yield made
    made.close()


def test_a_reason_that_mqtt_does_not_know_is_a_refusal_and_ends_nothing(site: Site, capricious: Capricious) -> None:
    capricious.answers["device/slave-1/telemetry"] = b"\x40\x03{mid}\xc5"
    site.line()
    site.pace = QUICK
    site.write(mqtt={"port": capricious.port})
    run = site.run()
    run.says("refuses lfs10d/line0/device/slave-1/telemetry: reason code 0xC5")
    eventually(lambda: len(capricious.taken("device/slave-2/telemetry")) > 5, "the other device")
    refused, other = (len(capricious.taken(f"device/slave-{number}/telemetry")) for number in (1, 2))
    eventually(lambda: len(capricious.taken("device/slave-2/telemetry")) > other + 5, "the other device goes on")
    assert len(capricious.taken("device/slave-1/telemetry")) == refused
    eventually(lambda: capricious.taken("device/slave-1/history"), "as history", within=HISTORY_WITHIN)
    assert capricious.connects == 1


@pytest.mark.parametrize(
    ("said", "words"),
    [(b"\xe0\x02\x87\x00", "not authorized"), (b"\xe0\x01\x87", "not authorized"), (b"", "the broker closed it")],
)
def test_a_broker_that_throws_us_out_for_one_topic_is_understood(
    site: Site, capricious: Capricious, said: bytes, words: str
) -> None:
    """Also where it publishes our will each time, as it does when another client takes our id away."""
    capricious.answers["info"] = said
    site.line()
    site.pace = QUICK
    site.write(mqtt={"port": capricious.port})
    run = site.run()
    eventually(lambda: len(capricious.taken("device/slave-1/telemetry")) > 5, "telemetry", within=HISTORY_WITHIN)
    assert capricious.connects <= 4
    assert words in run.log
    assert "bytes to lfs10d/line0/info under way: nothing is sent there for an hour" in run.log
    assert "another client" not in run.log
    assert json.loads(capricious.taken("devices")[-1])
