"""A mosquitto on a free port, and an independent MQTT 5 subscriber that keeps what it hears."""

from __future__ import annotations

import contextlib
import json
import secrets
import shutil
import socket
import subprocess
import threading
import time
from collections import defaultdict
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

from paho.mqtt.client import Client, MQTTMessage
from paho.mqtt.enums import CallbackAPIVersion, MQTTProtocolVersion

from bench.programs import end

SEARCH_PATH = "/usr/local/sbin:/usr/sbin:/sbin:/usr/local/bin:/usr/bin:/bin"
PATIENCE = 10.0
PORTS = range(12_000, 32_000)
"""Below the kernel's own (net.ipv4.ip_local_port_range), above what is registered most."""


def free_port() -> int:
    """Return a TCP port of the loopback that nobody uses now.

    It is none of those that the kernel gives to whoever connects: a daemon that asks for a broker that is away would
    take its port, or even connect to itself.
    """
    while True:
        port = secrets.choice(PORTS)
        with socket.socket() as probe, contextlib.suppress(OSError):
            probe.bind(("127.0.0.1", port))
            return port


class Broker:
    """A mosquitto without persistence on the loopback, running from the start; a context manager.

    It can be killed, ended, stopped in its tracks and started again, on the same port and with nothing in memory.
    """

    def __init__(self, folder: Path) -> None:
        executable = shutil.which("mosquitto", path=SEARCH_PATH)
        if executable is None:
            raise RuntimeError("needs mosquitto (Debian: apt install mosquitto)")
        self.port = free_port()
        configuration = folder / "mosquitto.conf"
        lines = [f"listener {self.port} 127.0.0.1", "allow_anonymous true", "max_queued_messages 0"]
        configuration.write_text("\n".join(lines) + "\n")
        self._command = [executable, "-c", str(configuration)]
        self._process: subprocess.Popen[str] | None = None
        self.start()

    @property
    def runs(self) -> bool:
        """Whether it was started and neither ended nor killed since."""
        return self._process is not None

    def start(self) -> None:
        """Start it and wait until it listens."""
        self._process = subprocess.Popen(
            self._command,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            text=True,
        )
        await_claim(self._listens, "mosquitto listens")

    def end(self) -> None:
        """End it in order; a second time does nothing."""
        process, self._process = self._process, None
        if process is not None:
            end(process)

    def signal(self, number: int) -> None:
        """Send it SIGSTOP or SIGCONT."""
        if self._process is not None:
            self._process.send_signal(number)

    def kill(self) -> None:
        """End it at once; a second time does nothing."""
        process, self._process = self._process, None
        if process is not None:
            process.kill()
            process.wait()

    def _listens(self) -> bool:
        with socket.socket() as probe:
            return probe.connect_ex(("127.0.0.1", self.port)) == 0

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.end()


def await_claim(claim: Callable[[], bool], what: str) -> None:
    """Wait until the claim holds."""
    deadline = time.monotonic() + PATIENCE
    while not claim():
        if time.monotonic() > deadline:
            raise RuntimeError(f"not within {PATIENCE:g} s: {what}")
        time.sleep(0.01)


@dataclass(frozen=True)
class Heard:
    """One sample as the subscriber heard it; `at` is CLOCK_MONOTONIC seconds."""

    at: float
    device: str
    boot: str
    seq: int
    value: float | None
    error: str | None

    @property
    def slave(self) -> int:
        """The slave id, from the device's default name."""
        return int(self.device.removeprefix("slave-"))


class Subscriber:
    """Keeps every sample under a base topic, live and historical; a context manager."""

    def __init__(self, port: int, base: str) -> None:
        self._messages: list[tuple[float, bytes]] = []
        self._subscribed = threading.Event()
        self._base = base
        self._topics = [(f"{base}/device/+/telemetry", 1), (f"{base}/device/+/history", 1)]
        self._client = Client(CallbackAPIVersion.VERSION2, protocol=MQTTProtocolVersion.MQTTv5)
        self._client.on_connect = self._subscribe
        self._client.on_subscribe = lambda *_: self._subscribed.set()
        self._client.on_message = self._hear
        self._client.connect("127.0.0.1", port)
        self._client.loop_start()
        if not self._subscribed.wait(PATIENCE):
            raise RuntimeError("the broker did not take the subscription")

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._client.disconnect()
        self._client.loop_stop()

    def _subscribe(self, *_: object) -> None:
        self._client.subscribe(self._topics)

    def _hear(self, _client: object, _userdata: object, message: MQTTMessage) -> None:
        self._messages.append((time.monotonic(), bytes(message.payload)))

    def ask(self, request: str, payload: str) -> None:
        """Send a request to the daemon."""
        self._client.publish(f"{self._base}/request/{request}", payload, qos=1)

    def samples(self) -> list[Heard]:
        """Return every sample once, in order of arrival."""
        once: dict[tuple[str, str, int], Heard] = {}
        for at, payload in list(self._messages):
            content = json.loads(payload)
            for sample in content if isinstance(content, list) else [content]:
                heard = read_sample(at, sample)
                once.setdefault((heard.device, heard.boot, heard.seq), heard)
        return list(once.values())


def read_sample(at: float, sample: dict[str, Any]) -> Heard:
    """Take what the bench compares from a sample."""
    return Heard(at, sample["device"], sample["boot"], sample["seq"], sample["wind_speed"], sample["error"])


def missing_seqs(samples: list[Heard]) -> int:
    """Count the holes in seq per device and boot, which starts at 1."""
    seqs: defaultdict[tuple[str, str], set[int]] = defaultdict(set)
    for heard in samples:
        seqs[heard.device, heard.boot].add(heard.seq)
    return sum(max(numbers) - len(numbers) for numbers in seqs.values())
