"""A real mosquitto, a listener to it, and certificates of an own authority."""

from __future__ import annotations

import contextlib
import getpass
import os
import shutil
import subprocess
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import pytest
from paho.mqtt.client import Client, MQTTMessage
from paho.mqtt.enums import CallbackAPIVersion, MQTTProtocolVersion
from paho.mqtt.packettypes import PacketTypes
from paho.mqtt.properties import Properties
from paho.mqtt.subscribeoptions import SubscribeOptions

from bench.broker import free_port

PATIENCE = 10.0
"""Seconds after which something awaited counts as not happening; no test waits this long when all is well."""
SEARCH_PATH = os.pathsep.join((os.environ.get("PATH", os.defpath), "/usr/sbin", "/sbin"))
"""Debian keeps daemons in /usr/sbin, which is not on a user's PATH."""


def path_of(name: str) -> str:
    """Return the path of a program; without it fail in CI and skip elsewhere."""
    path = shutil.which(name, path=SEARCH_PATH)
    if path is not None:
        return path
    message = f"needs {name}: install it (Debian: apt install mosquitto mosquitto-clients openssl socat mbpoll gcc)"
    if os.environ.get("CI"):
        pytest.fail(message, pytrace=False)
    pytest.skip(message)


def eventually(claim: Callable[[], bool], what: str, *, within: float = PATIENCE) -> None:
    """Wait until `claim()` holds; fail with `what` if it does not within `within` seconds."""
    deadline = time.monotonic() + within
    while not claim():
        assert time.monotonic() < deadline, f"not within {within:g} s: {what}"
        time.sleep(0.005)


@dataclass(frozen=True)
class Heard:
    """One message as an independent subscriber heard it; `at` is monotonic seconds."""

    topic: str
    payload: bytes
    retain: bool
    qos: int
    at: float
    correlation: bytes | None


class Listener:
    """An independent MQTT 5 subscriber that keeps every message in order of arrival, and can publish."""

    def __init__(
        self,
        port: int,
        filters: str | list[str] = "#",
        *,
        username: str | None = None,
        password: str | None = None,
        client_id: str = "",
    ) -> None:
        self.heard: list[Heard] = []
        self.acknowledged: dict[int, int] = {}
        """The reason code of each PUBACK by message id."""
        self._filters = [filters] if isinstance(filters, str) else filters
        self._subscribed = threading.Event()
        self._client = Client(CallbackAPIVersion.VERSION2, client_id, protocol=MQTTProtocolVersion.MQTTv5)
        self._client.reconnect_delay_set(1, 1)
        if username is not None:
            self._client.username_pw_set(username, password)
        self._client.on_connect = lambda *_: self._subscribe()
        self._client.on_subscribe = lambda *_: self._subscribed.set()
        self._client.on_message = lambda _client, _userdata, message: self._note(message)
        self._client.on_publish = lambda _client, _userdata, mid, reason, _properties: self.acknowledged.__setitem__(
            mid, reason.value
        )
        self._client.connect_async("127.0.0.1", port)
        self._client.loop_start()
        assert self._subscribed.wait(PATIENCE), f"no subscription at the broker on port {port}"

    def _subscribe(self) -> None:
        options = SubscribeOptions(qos=1, retainAsPublished=True)
        self._client.subscribe([(each, options) for each in self._filters])

    def _note(self, message: MQTTMessage) -> None:
        correlation = getattr(message.properties, "CorrelationData", None)
        self.heard.append(
            Heard(
                message.topic,
                bytes(message.payload),
                message.retain,
                message.qos,
                time.monotonic(),
                correlation,
            )
        )

    def on(self, topic: str) -> list[Heard]:
        """Return what was heard on one topic so far."""
        return [each for each in list(self.heard) if each.topic == topic]

    def wait_for(self, topic: str, count: int = 1, *, within: float = PATIENCE) -> list[Heard]:
        """Wait until `count` messages were heard on `topic`; return them all."""
        eventually(lambda: len(self.on(topic)) >= count, f"{count} messages on {topic}", within=within)
        return self.on(topic)

    def publish(
        self,
        topic: str,
        payload: bytes | str,
        *,
        retain: bool = False,
        qos: int = 1,
        response_topic: str | None = None,
        correlation: bytes | None = None,
    ) -> int:
        """Publish, wait until it is acknowledged, and return the PUBACK's reason code."""
        properties = Properties(PacketTypes.PUBLISH)  # type: ignore[no-untyped-call]  # paho leaves it untyped
        if response_topic is not None:
            properties.ResponseTopic = response_topic
        if correlation is not None:
            properties.CorrelationData = correlation
        mid = self._client.publish(topic, payload, qos, retain, properties).mid
        eventually(lambda: mid in self.acknowledged, f"acknowledgement of {topic}")
        return self.acknowledged[mid]

    def close(self) -> None:
        """Disconnect and end the thread."""
        self._client.disconnect()
        with contextlib.suppress(AttributeError):  # its thread ends by itself, also between paho's look and its wait
            self._client.loop_stop()


@dataclass
class Mosquitto:
    """A real mosquitto on a free port of the loopback, without persistence, started and killed at will."""

    executable: str
    folder: Path
    port: int = field(default_factory=free_port)
    configuration: list[str] = field(default_factory=lambda: ["allow_anonymous true"])
    """Lines of mosquitto.conf besides the listener; change them, then `start()`."""
    listener: list[str] = field(default_factory=list)
    """Lines that belong to the listener: certificates and the like."""
    listeners: list[Listener] = field(default_factory=list)
    process: subprocess.Popen[bytes] | None = None

    @property
    def log(self) -> str:
        """What the broker wrote since its first start."""
        return (self.folder / "mosquitto.log").read_text(errors="replace")

    def start(self) -> None:
        """Start it and wait until it listens."""
        lines = [
            "per_listener_settings false",
            "persistence false",
            "max_queued_messages 100000",  # with 0, no limit, 2.0.11 disconnects whoever publishes what is denied
            "log_type all",
            f"user {getpass.getuser()}",  # started by root it would change to a user that cannot read our files
            f"listener {self.port} 127.0.0.1",
            *self.listener,
            *self.configuration,
        ]
        path = self.folder / "mosquitto.conf"
        path.write_text("\n".join(lines) + "\n")
        with (self.folder / "mosquitto.log").open("ab") as log:
            before = log.tell()
            self.process = subprocess.Popen(
                [self.executable, "-c", str(path)], stdin=subprocess.DEVNULL, stdout=log, stderr=log
            )
        eventually(lambda: self._runs(before), "mosquitto runs")

    def _runs(self, since: int) -> bool:
        assert self.process is not None
        assert self.process.poll() is None, f"mosquitto ended: {self.log}"
        return " running" in self.log[since:]

    def stop(self) -> None:
        """End it in order (SIGTERM)."""
        if self.process is not None:
            deadline = time.monotonic() + PATIENCE
            while self.process.poll() is None:
                assert time.monotonic() < deadline, "mosquitto does not end"
                # A SIGTERM just before it waits for its sockets is noted, but does not wake it: send another.
                self.process.terminate()
                with contextlib.suppress(subprocess.TimeoutExpired):
                    self.process.wait(1.0)
            self.process = None

    def kill(self) -> None:
        """End it at once (SIGKILL): what it had not sent is lost."""
        if self.process is not None:
            self.process.kill()
            self.process.wait(PATIENCE)
            self.process = None

    def reload(self) -> None:
        """Make it read its configuration anew, as SIGHUP does."""
        assert self.process is not None
        self.process.send_signal(1)

    def subscribe(
        self,
        filters: str | list[str] = "#",
        *,
        username: str | None = None,
        password: str | None = None,
        client_id: str = "",
    ) -> Listener:
        """Return a listener that is subscribed; it is closed at the end of the test."""
        listener = Listener(self.port, filters, username=username, password=password, client_id=client_id)
        self.listeners.append(listener)
        return listener

    def publish(self, topic: str, payload: bytes | str, *, retain: bool = False) -> None:
        """Publish one message as somebody else and wait for its acknowledgement."""
        publisher = Listener(self.port, "$never/heard")
        try:
            publisher.publish(topic, payload, retain=retain)
        finally:
            publisher.close()

    def retained(self, filters: str = "#") -> dict[str, bytes]:
        """Return what is retained now, payload by topic, as a newcomer would be told."""
        newcomer = Listener(self.port, [filters, "lfs10d-test/end"])
        try:
            newcomer.publish("lfs10d-test/end", "x")
            newcomer.wait_for("lfs10d-test/end")
            retained = {each.topic: each.payload for each in newcomer.heard if each.retain}  # others go on publishing
            return {topic: payload for topic, payload in retained.items() if payload}
        finally:
            newcomer.close()

    def close(self) -> None:
        """Close its listeners and end it."""
        for listener in self.listeners:
            listener.close()
        self.stop()


@dataclass(frozen=True)
class Authority:
    """A certificate authority of this test run's own, made by the openssl command."""

    folder: Path
    openssl: str

    @property
    def ca(self) -> str:
        """The certificate of the authority."""
        return str(self.folder / "ca.pem")

    def found(self) -> None:
        """Make the authority itself."""
        self._run("req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes",
                  "-days", "2", "-subj", "/CN=lfs10d test authority",
                  "-addext", "keyUsage=critical,keyCertSign,cRLSign",
                  "-keyout", "ca.key", "-out", "ca.pem")  # fmt: skip

    def issue(self, name: str, *names: str, days: int = 2) -> tuple[str, str]:
        """Return the files of a certificate for `names` (as openssl writes them: `DNS:localhost`) and its key.

        With `days` below 0 it has expired.
        """
        (self.folder / f"{name}.ext").write_text(
            f"subjectAltName={','.join(names) or 'DNS:' + name}\n"
            "authorityKeyIdentifier=keyid\nsubjectKeyIdentifier=hash\n"
        )
        self._run("req", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes",
                  "-subj", f"/CN={name}", "-keyout", f"{name}.key", "-out", f"{name}.csr")  # fmt: skip
        self._run("x509", "-req", "-in", f"{name}.csr", "-CA", "ca.pem", "-CAkey", "ca.key", "-CAcreateserial",
                  "-days", str(days), "-extfile", f"{name}.ext", "-out", f"{name}.pem")  # fmt: skip
        return str(self.folder / f"{name}.pem"), str(self.folder / f"{name}.key")

    def _run(self, *arguments: str) -> None:
        subprocess.run([self.openssl, *arguments], cwd=self.folder, check=True, capture_output=True, timeout=60)
