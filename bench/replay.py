"""`python -m bench.replay`: what it costs live samples that a store of millions leaves over MQTT.

Fills a store, connects an uplink to a real mosquitto, publishes live samples at an even rate, and prints every ten
seconds how late they arrive, how many of the past have, and the memory; the first ten seconds are without the past.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import sys
import tempfile
import time
from collections.abc import Iterable
from pathlib import Path

from paho.mqtt.client import Client, MQTTMessage
from paho.mqtt.enums import CallbackAPIVersion, MQTTProtocolVersion

from bench.broker import Broker
from lfs10d.mqtt.settings import BrokerSettings
from lfs10d.mqtt.uplink import Uplink
from lfs10d.outbox.history import QueuedSample
from lfs10d.outbox.store.database import Limits
from lfs10d.outbox.store.sample_file import SampleFile, StoreBatch
from lfs10d.outbox.store.store import Store
from lfs10d.telemetry import publication
from lfs10d.telemetry.publication import Publication, PublicationKind, Sample

LIMITS = Limits(size=10**12, age=10**12)
DEVICES = 32
BATCH = 6400
SWITCH_INTERVAL = 1e-4
"""As the daemon sets it."""


def sample(device: int, seq: int, boot: str) -> Sample:
    """Return a good sample of 4 Hz."""
    return Sample(
        f"slave-{device}", boot, seq, 1_795_298_022_000 + 250 * seq, "synced", {"wind_speed": (seq * 7 + device) / 32},
        {"wind_speed": "m/s"}, ("wind_speed",), "good", None, 18.2,
    )  # fmt: skip


def fill(folder: Path, count: int) -> None:
    """Write so many samples, 20 of each device at a time as a spill does."""
    began = time.monotonic()
    file = SampleFile(folder / "backlog.db", boot="k0000001", limits=LIMITS)
    for start in range(0, count // DEVICES, BATCH // DEVICES):
        entries = [
            QueuedSample(sample(device, seq, "k0000001"), 0.0, shift=0)
            for part in range(start, start + BATCH // DEVICES, 20)
            for device in range(1, DEVICES + 1)
            for seq in range(part + 1, part + 21)
        ]
        file.append(StoreBatch(entries, losses=(), now=0, mono=0))
    rows = file.rows
    file.close()
    size = (folder / "backlog.db").stat().st_size
    print(f"{rows} samples, {size / 1e6:.0f} MB, {size / rows:.1f} bytes each, {time.monotonic() - began:.0f} s")


class Subscriber:
    """Counts the past, and keeps how late live samples are."""

    def __init__(self, port: int) -> None:
        self.late: list[float] = []
        self.past = 0
        self.disorder = 0
        self._newest: dict[str, int] = {}
        self._client = Client(CallbackAPIVersion.VERSION2, protocol=MQTTProtocolVersion.MQTTv5)
        self._client.on_connect = lambda client, *_: client.subscribe("bench/line0/device/+/+", 1)
        self._client.on_message = lambda _client, _userdata, message: self._heard(message)
        self._client.connect("127.0.0.1", port)
        self._client.loop_start()

    def _heard(self, message: MQTTMessage) -> None:
        if message.topic.endswith("/telemetry"):
            self.late.append(time.time() - json.loads(message.payload)["ts"] / 1000)
        elif message.topic.endswith("/history"):
            array = json.loads(message.payload)
            self.past += len(array)
            for one in array:
                self.disorder += one["seq"] <= self._newest.get(one["device"], 0)
                self._newest[one["device"]] = one["seq"]

    def close(self) -> None:
        """Disconnect."""
        self._client.disconnect()
        self._client.loop_stop()


def resident() -> float:
    """Return the resident memory in MB."""
    line = next(line for line in Path("/proc/self/status").read_text().splitlines() if line.startswith("VmRSS"))
    return int(line.split()[1]) / 1000


def percentile(values: Iterable[float], share: float) -> float:
    """Return a percentile, in ms."""
    ordered = sorted(values)
    return ordered[min(len(ordered) - 1, int(len(ordered) * share))] * 1000 if ordered else float("nan")


class NothingElse:
    """An uplink's events where there are only samples."""

    def burst(self) -> tuple[Publication, ...]:
        """Return that nothing is retained."""
        return ()

    def topics(self) -> frozenset[str]:
        """Return that nothing is retained."""
        return frozenset()

    def on_uplink_change(self) -> None:
        """Take nothing."""

    def on_announced(self) -> None:
        """Take nothing."""


async def live(uplink: Uplink, rate: float, seconds: float) -> None:
    """Publish live samples at an even rate."""
    loop = asyncio.get_running_loop()
    began, number = loop.time(), 0
    while loop.time() - began < seconds:
        number += 1
        device = number % DEVICES + 1
        measured = sample(device, number // DEVICES + 1, "k0000002")
        payload = measured.payload("line0") | {"ts": int(time.time() * 1000)}
        topic = publication.device_topic(measured.device, publication.TELEMETRY)
        uplink.publish([Publication(topic, payload, PublicationKind.SAMPLE, retain=False, qos=1, sample=measured)])
        await asyncio.sleep(max(0.0, began + number / rate - loop.time()))


async def replay(folder: Path, options: argparse.Namespace) -> bool:
    """Replay; return True if nothing was out of order and no live sample was late."""
    with Broker(folder) as broker:
        subscriber = Subscriber(broker.port)
        uplink = Uplink(
            BrokerSettings("127.0.0.1", broker.port, "bench-replay"),
            base="bench/line0",
            epoch_ms=lambda: int(time.time() * 1000),
            store=Store(folder, boot="k0000002", limits=LIMITS),
        )
        await uplink.start(NothingElse(), on_request=lambda _: None, on_spool_trouble=print)
        publishing = asyncio.create_task(live(uplink, options.rate, options.seconds))
        worst = 0.0
        while not publishing.done():
            await asyncio.wait([publishing], timeout=10)
            late, subscriber.late = subscriber.late, []
            worst = max(worst, *late, 0.0)
            print(
                f"live {len(late):5d}: p50 {percentile(late, 0.5):5.1f} p99 {percentile(late, 0.99):5.1f}"
                f" max {percentile(late, 1):6.1f} ms; past {subscriber.past:8d}, out of order {subscriber.disorder};"
                f" waiting {uplink.backlog.depth:8d}; {resident():.0f} MB"
            )
        await uplink.stop()
        subscriber.close()
        return not subscriber.disorder and worst < 1.0


def main() -> None:
    """Read the options, fill and replay."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--samples", type=int, default=5_000_000)
    parser.add_argument("--seconds", type=float, default=120.0)
    parser.add_argument("--rate", type=float, default=128.0, help="live samples per second")
    options = parser.parse_args()
    sys.setswitchinterval(SWITCH_INTERVAL)
    with tempfile.TemporaryDirectory() as name:
        fill(Path(name), options.samples)
        if not asyncio.run(replay(Path(name), options)):
            sys.exit("live samples were late, or the past out of order")


if __name__ == "__main__":
    main()
