"""A real mosquitto behind a slow link: a round trip of 200 ms, ten messages under way at most, 32 devices."""

from __future__ import annotations

import asyncio
import json

from lfs10d.telemetry import publication
from tests.support.brokers import Listener, Mosquitto
from tests.support.delaying_proxy import delaying
from tests.support.uplinks import B, Site, online, running, sample, until

DEVICES = [f"d{number:02}" for number in range(32)]
ROUND_TRIP = 0.2
RECEIVE_MAXIMUM = 10
SECONDS = 5


def seqs(listener: Listener, device: str, leaf: str) -> set[int]:
    """Return the seqs that arrived of a device on `telemetry` or `history`."""
    found: set[int] = set()
    for each in listener.on(f"{B}/device/{device}/{leaf}"):
        payload = json.loads(each.payload)
        found.update(one["seq"] for one in (payload if isinstance(payload, list) else [payload]))
    return found


def test_at_200_ms_and_ten_under_way_every_device_goes_live_and_all_samples_arrive(mosquitto: Mosquitto) -> None:
    """Ten messages each 200 ms are 50 a second: fewer than 32 samples and 32 states."""
    mosquitto.stop()
    mosquitto.configuration.append(f"max_inflight_messages {RECEIVE_MAXIMUM}")
    mosquitto.start()

    async def scenario() -> None:
        listener = mosquitto.subscribe(f"{B}/#")
        async with delaying(mosquitto.port, ROUND_TRIP) as port:
            site = Site(port, history_wait=1.5)  # 10 s in the contract; the test need not wait for them
            async with running(site) as uplink:
                await online(listener)
                loop = asyncio.get_running_loop()
                begun = loop.time()
                for number in range(SECONDS * len(DEVICES)):
                    device, seq = DEVICES[number % len(DEVICES)], 1 + number // len(DEVICES)
                    state = publication.retained(f"device/{device}/state", {"seq": seq}, refresh=True)
                    uplink.publish([sample(seq, device), state])
                    assert len(uplink._outbox._in_flight) <= RECEIVE_MAXIMUM
                    await asyncio.sleep(max(0.0, begun + number / len(DEVICES) - loop.time()))
                await until(lambda: uplink.backlog.depth == 0, "everything is acknowledged", within=30.0)
                assert uplink.backlog.dropped == 0

    asyncio.run(scenario())
    assert {device for device in DEVICES if seqs(listener_of(mosquitto), device, "telemetry")} == set(DEVICES)
    for device in DEVICES:
        arrived = seqs(listener_of(mosquitto), device, "telemetry") | seqs(listener_of(mosquitto), device, "history")
        assert arrived == set(range(1, SECONDS + 1)), device
    assert "Client gateway disconnected due to" not in mosquitto.log


def listener_of(mosquitto: Mosquitto) -> Listener:
    """Return the one listener of the test."""
    [listener] = mosquitto.listeners
    return listener
