"""`python -m bench.fleet`: many gateways at one broker that is killed at full rate.

Each gateway is the daemon's own outbox, sender and client, with a store of its own; it has no line and no process. All
run in this process, an independent subscriber in another. Prints how many samples were lost or came twice by the key
(gateway, device, boot, seq), how long the gateways were silent, and how their backlogs come in.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import logging
import multiprocessing
import os
import random
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, Final, Self

from paho.mqtt.client import Client, MQTTMessage
from paho.mqtt.enums import CallbackAPIVersion, MQTTProtocolVersion

from bench.broker import SEARCH_PATH, Broker, free_port
from bench.replay import LIMITS, SWITCH_INTERVAL, NothingElse, percentile
from lfs10d.mqtt.settings import BrokerSettings, Version
from lfs10d.mqtt.uplink import Uplink
from lfs10d.outbox.store.store import Store
from lfs10d.telemetry import publication
from lfs10d.telemetry.publication import Publication, PublicationKind, Sample

BOOT: Final = "k0000001"
SETTLE: Final = 30.0
"""Seconds in which all backlogs must be in after the last sample."""


@dataclass
class Heard:
    """What the subscriber heard. Times are epoch seconds; a key is (gateway, device, boot, seq)."""

    keys: set[tuple[str, str, str, int]] = field(default_factory=set)
    again: int = 0
    messages: int = 0
    first_after: dict[str, float] = field(default_factory=dict)
    """When each gateway was heard first since `watch` was set."""
    caught_up: dict[str, float] = field(default_factory=dict)
    """When its last sample from before `back` came first."""
    per_second: Counter[int] = field(default_factory=Counter)
    watch: float = float("inf")
    back: float = float("inf")

    def take(self, topic: str, payload: bytes | bytearray, now: float) -> None:
        """Take one message of `telemetry` or `history`."""
        gateway = topic.split("/")[1]
        content: Any = json.loads(payload)
        self.messages += 1
        self.per_second[int(now)] += 1
        if now >= self.watch:
            self.first_after.setdefault(gateway, now)
        for one in content if isinstance(content, list) else [content]:
            key = (gateway, one["device"], one["boot"], one["seq"])
            if key in self.keys:
                self.again += 1
                continue
            self.keys.add(key)
            if self.watch <= one["ts"] / 1000 < self.back:
                self.caught_up[gateway] = now

    def lost(self, sent: Mapping[tuple[str, str], int]) -> int:
        """Return how many samples are missing; `sent` has the last seq by gateway and device."""
        return sum(sent.values()) - len(self.keys)


class Nats:
    """A NATS cluster of three with JetStream and MQTT (3.1.1); the last node is killed, and stays away."""

    version: Final = Version.V311

    def __init__(self, folder: Path) -> None:
        executable = shutil.which("nats-server", path=SEARCH_PATH)
        if executable is None:
            raise RuntimeError("needs nats-server (Debian: apt install nats-server)")
        self.ports = tuple(free_port() for _ in range(3))
        routes = [free_port() for _ in self.ports]
        known = ", ".join(f'"nats://127.0.0.1:{each}"' for each in routes)
        self._nodes = []
        for port, route in zip(self.ports, routes, strict=True):
            file = folder / f"nats-{port}.conf"
            file.write_text(
                f'server_name: n{port}\nlisten: "127.0.0.1:{free_port()}"\n'
                f'jetstream {{store_dir: "{folder}/n{port}"}}\n'
                f'mqtt {{listen: "127.0.0.1:{port}"}}\n'
                f'cluster {{name: fleet, listen: "127.0.0.1:{route}", routes: [{known}]}}\n'
            )
            self._nodes.append(
                subprocess.Popen([executable, "-c", str(file)], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
            )
        time.sleep(8)  # a leader is chosen

    def kill(self) -> None:
        """Kill the last node."""
        self._nodes[-1].kill()

    def start(self) -> None:
        """Leave the node away: the others go on."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        for node in self._nodes:
            node.kill()
            node.wait()


class Mosquitto(Broker):
    """One mosquitto, which comes back after it was killed."""

    version: Final = Version.V5

    @property
    def ports(self) -> tuple[int, ...]:
        """Its port."""
        return (self.port,)


def listen(port: int, version: Version, pipe: Connection) -> None:
    """Subscribe until told to end; a message on the pipe sets `watch` and `back`, and None asks for what was heard."""
    heard = Heard()
    newer = version is Version.V5
    client = Client(
        CallbackAPIVersion.VERSION2,
        protocol=MQTTProtocolVersion.MQTTv5 if newer else MQTTProtocolVersion.MQTTv311,
    )
    client.reconnect_delay_set(1, 1)
    filters = [("fleet/+/line0/device/+/telemetry", 1), ("fleet/+/line0/device/+/history", 1)]
    client.on_connect = lambda client, *_: client.subscribe(filters)
    client.on_subscribe = lambda *_: pipe.send("subscribed")

    def on_message(_client: Client, _userdata: object, message: MQTTMessage) -> None:
        heard.take(message.topic, message.payload, time.time())

    client.on_message = on_message
    client.connect("127.0.0.1", port)
    client.loop_start()
    while (told := pipe.recv()) is not None:
        heard.watch, heard.back = told
    client.disconnect()
    client.loop_stop()
    pipe.send(heard)


class Gateway:
    """One gateway: sensors that are measured once a second, and its uplink."""

    def __init__(self, number: int, devices: int, broker: Mosquitto | Nats, folder: Path) -> None:
        self.name = f"gw{number:03}"
        self.sent: dict[tuple[str, str], int] = {}
        self._devices = devices
        turn = number % len(broker.ports)
        ports = broker.ports[turn:] + broker.ports[:turn]
        state = folder / self.name
        state.mkdir()
        self.uplink = Uplink(
            BrokerSettings(
                "127.0.0.1",
                ports[0],
                f"lfs10d-{self.name}-line0",
                version=broker.version,
                others=tuple(("127.0.0.1", port) for port in ports[1:]),
            ),
            base=f"fleet/{self.name}/line0",
            epoch_ms=lambda: time.time_ns() // 1_000_000,
            store=Store(state, boot=BOOT, limits=LIMITS),
        )

    async def run(self, until: float) -> None:
        """Measure until this time of the loop, each gateway at another moment of the second."""
        loop = asyncio.get_running_loop()
        await asyncio.sleep(random.random())  # noqa: S311  # no secret
        await self.uplink.start(NothingElse(), on_request=lambda _: None, on_spool_trouble=print)
        due, seq = loop.time(), 0
        while loop.time() < until:
            seq += 1
            now = time.time_ns() // 1_000_000
            for device in range(1, self._devices + 1):
                name = f"slave-{device}"
                sample = Sample(
                    name, BOOT, seq, now, "synced", {"wind_speed": seq % 997 / 32}, {"wind_speed": "m/s"},
                    ("wind_speed",), "good", None, 18.2,
                )  # fmt: skip
                topic = publication.device_topic(name, publication.TELEMETRY)
                payload = sample.payload("line0")
                self.uplink.publish(
                    [Publication(topic, payload, PublicationKind.SAMPLE, retain=False, qos=1, sample=sample)]
                )
                self.sent[self.name, name] = seq
            due += 1
            await asyncio.sleep(max(0.0, due - loop.time()))


async def run(options: argparse.Namespace, folder: Path) -> bool:
    """Run the fleet; return True if nothing was lost."""
    load = os.getloadavg()[0]
    ours, theirs = multiprocessing.Pipe()
    with Nats(folder) if options.nats else Mosquitto(folder) as broker:
        listener = multiprocessing.get_context("spawn").Process(
            target=listen, args=(broker.ports[0], broker.version, theirs), daemon=True
        )
        listener.start()
        await asyncio.to_thread(ours.recv)
        loop = asyncio.get_running_loop()
        gateways = [Gateway(number, options.devices, broker, folder) for number in range(1, options.gateways + 1)]
        began = loop.time()
        tasks = [asyncio.create_task(each.run(began + options.seconds)) for each in gateways]
        await asyncio.sleep(options.seconds / 3)
        broker.kill()
        killed = time.time()
        ours.send((killed, float("inf")))
        await asyncio.sleep(options.away)
        await asyncio.to_thread(broker.start)
        back = time.time()
        ours.send((killed, back))
        await asyncio.gather(*tasks)
        late = loop.time() - began - options.seconds
        for _ in range(round(SETTLE)):
            if not any(each.uplink.backlog.depth for each in gateways):
                break
            await asyncio.sleep(1)
        waiting = sum(each.uplink.backlog.depth for each in gateways)
        await asyncio.sleep(2)
        await asyncio.gather(*(each.uplink.stop() for each in gateways))
        await asyncio.sleep(1)
        ours.send(None)
        while not isinstance(heard := await asyncio.to_thread(ours.recv), Heard):
            pass
        listener.join()
    sent = {key: seq for each in gateways for key, seq in each.sent.items()}
    report(options, heard, sent, load=load, waiting=waiting, late=late)
    return heard.lost(sent) == 0 and waiting == 0


def report(
    options: argparse.Namespace,
    heard: Heard,
    sent: Mapping[tuple[str, str], int],
    *,
    load: float,
    waiting: int,
    late: float,
) -> None:
    """Print the table's row and what belongs to it."""
    begin = heard.watch if options.nats else heard.back  # two nodes of three go on
    seconds = [each - begin for each in heard.first_after.values()]
    drained = [each - begin for each in heard.caught_up.values()]
    usual = sorted(heard.per_second.values())[len(heard.per_second) // 2]
    usage = resource.getrusage(resource.RUSAGE_SELF)
    columns = {
        "gateways": str(options.gateways),
        "sensors": str(options.devices),
        "broker away s": f"{options.away:g}",
        "samples": str(sum(sent.values())),
        "lost": str(heard.lost(sent)),
        "came twice": str(heard.again),
        "heard again s p50/max": f"{percentile(seconds, 0.5) / 1000:.1f}/{percentile(seconds, 1) / 1000:.1f}",
        "backlog in s p50/p90/max": "/".join(f"{percentile(drained, each) / 1000:.1f}" for each in (0.5, 0.9, 1)),
        "messages/s usual/most": f"{usual}/{max(heard.per_second.values())}",
        "CPU s": f"{usage.ru_utime + usage.ru_stime:.0f}",
        "MB": f"{usage.ru_maxrss / 1000:.0f}",
    }
    again = f"gateways heard again: {len(seconds)} of {options.gateways}"
    print(f"load before: {load:.1f}; {again}; still waiting: {waiting}; last measurement late by {late:.1f} s")
    print(f"| {' | '.join(columns)} |\n|{' --- |' * len(columns)}\n| {' | '.join(columns.values())} |")


def main() -> None:
    """Read the options and run."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--gateways", type=int, default=100)
    parser.add_argument("--devices", type=int, default=4, help="sensors of each, at 1 Hz")
    parser.add_argument("--seconds", type=float, default=60.0, help="how long is measured")
    parser.add_argument("--away", type=float, default=15.0, help="how long the broker is away, in s")
    parser.add_argument("--nats", action="store_true", help="a NATS cluster of three, one node of which is killed")
    options = parser.parse_args()
    sys.setswitchinterval(SWITCH_INTERVAL)
    logging.disable(logging.WARNING)  # each gateway says that the broker is away
    with tempfile.TemporaryDirectory() as name:
        if not asyncio.run(run(options, Path(name))):
            sys.exit("samples were lost")


if __name__ == "__main__":
    main()
