"""Retained topics cleared and settings taken at a reload."""

from __future__ import annotations

import asyncio

from lfs10d.mqtt.settings import Version
from lfs10d.mqtt.uplink import Uplink
from lfs10d.telemetry import publication
from tests.support.brokers import Mosquitto
from tests.support.uplinks import B, Site, online, running, sample, seqs, until

# What is left over


def swept(uplink: Uplink) -> bool:
    return uplink.connected and not (uplink._cleanup.under_way or uplink._cleanup.wanted)


def test_retained_topics_of_devices_that_are_gone_are_cleared_and_nothing_else(mosquitto: Mosquitto) -> None:
    leaves = ("state", "config", "availability", "error", "stats", "wind")
    for leaf in leaves:
        mosquitto.publish(f"{B}/device/gone/{leaf}", "x", retain=True)
    others = {f"{B}/device/gone/notes": b"mine", "site/line1/device/gone/state": b"theirs", f"{B}/info": b"x"}
    for topic, payload in others.items():
        mosquitto.publish(topic, payload, retain=True)

    async def scenario() -> None:
        listener = mosquitto.subscribe(f"{B}/device/gone/#")
        site = Site(mosquitto.port)
        async with running(site) as uplink:
            await until(
                lambda: (
                    {each.topic for each in listener.heard if not each.payload}
                    == {f"{B}/device/gone/{leaf}" for leaf in leaves}
                ),
                "cleared",
            )
            del site.retained["device/c/state"]
            await uplink.reload()
            await until(lambda: f"{B}/device/c/state" not in mosquitto.retained(f"{B}/#"), "cleared at reload")

    asyncio.run(scenario())
    ours = {f"{B}/device/a/state": b'{"device":"a"}', f"{B}/device/b/state": b'{"device":"b"}'}
    assert mosquitto.retained("site/#") == {**others, **ours, f"{B}/availability": b"offline"}


def test_what_is_cleared_just_before_a_reload_is_cleared_once(mosquitto: Mosquitto) -> None:
    async def scenario() -> None:
        listener = mosquitto.subscribe(f"{B}/#")
        site = Site(mosquitto.port)
        gone = [f"device/d{number}/state" for number in range(100)]
        site.retained |= {topic: {"device": topic} for topic in gone}
        async with running(site) as uplink:
            await online(listener)
            await until(lambda: swept(uplink), "the sweep after the connect")
            for topic in gone:
                del site.retained[topic]
            uplink.publish(publication.retained(topic, None) for topic in gone)
            await uplink.reload()
            assert not swept(uplink)
            await until(lambda: swept(uplink), "the sweep")
            uplink.publish([sample(1)])
            await until(lambda: seqs(listener) == {1}, "what is published after the sweep")
        cleared = [each.topic.removeprefix(f"{B}/") for each in listener.heard if not each.payload]
        assert sorted(cleared) == sorted(gone)

    asyncio.run(scenario())


def test_a_reload_during_a_cleanup_does_not_begin_another(mosquitto: Mosquitto) -> None:
    mosquitto.publish(f"{B}/device/gone/state", "x", retain=True)

    async def scenario() -> None:
        listener = mosquitto.subscribe(f"{B}/device/gone/#")
        async with running(Site(mosquitto.port)) as uplink:
            await until(lambda: uplink._cleanup.under_way, "the sweep after the connect")
            await uplink.reload()
            await until(lambda: not uplink._cleanup.under_way, "its end")
            await until(lambda: not listener.heard[-1].payload, "cleared")
            assert len(listener.heard) == 2

    asyncio.run(scenario())


def test_other_settings_are_taken_at_a_reload(mosquitto: Mosquitto) -> None:
    async def scenario() -> None:
        listener = mosquitto.subscribe([f"{B}/availability", "$SYS/none"])
        site = Site(mosquitto.port)
        async with running(site) as uplink:
            await online(listener)
            await uplink.reload(Site(mosquitto.port, client_id="another", version=Version.V311).settings)
            await online(listener, 2)
            assert uplink.version is Version.V311
            assert [each.payload for each in listener.heard] == [b"online", b"offline", b"online"]

    asyncio.run(scenario())
    assert "as another" in mosquitto.log
