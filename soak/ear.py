"""An independent MQTT 5 subscriber at QoS 1 with a session of its own, that goes away and comes back."""

from __future__ import annotations

import time
from queue import SimpleQueue

from paho.mqtt.client import Client, MQTTMessage
from paho.mqtt.enums import CallbackAPIVersion, MQTTProtocolVersion
from paho.mqtt.packettypes import PacketTypes
from paho.mqtt.properties import Properties
from paho.mqtt.subscribeoptions import SubscribeOptions

from soak.heard import Message

SESSION = 30 * 86400
"""Seconds for which the broker keeps what it has for us."""

RETRY = 1
"""Seconds from one attempt to connect to the next."""

TOPICS = ("availability", "event", "device/+/telemetry", "device/+/history", "device/+/state", "device/+/availability")


class Ear:
    """Puts what it hears below `base` into `heard`; topics without the base."""

    def __init__(self, port: int, base: str) -> None:
        self.heard: SimpleQueue[Message] = SimpleQueue()
        self.connected_since: float | None = None
        """Monotonic seconds; None while it is not."""
        self._port = port
        self._base = f"{base}/"
        self._client: Client | None = None

    def come(self) -> None:
        """Connect as soon as the broker is there, again whenever it is lost."""
        client = Client(CallbackAPIVersion.VERSION2, "lfs10d-soak", protocol=MQTTProtocolVersion.MQTTv5)
        client.reconnect_delay_set(RETRY, RETRY)
        client.on_connect = lambda *_: self._connected(client)
        client.on_disconnect = lambda *_: self._disconnected(client)
        client.on_message = lambda _client, _userdata, message: self._note(message)
        keep = Properties(PacketTypes.CONNECT)  # type: ignore[no-untyped-call]  # paho leaves it untyped
        keep.SessionExpiryInterval = SESSION
        client.connect_async("127.0.0.1", self._port, clean_start=False, properties=keep)
        self._client = client
        client.loop_start()

    def leave(self) -> None:
        """Disconnect; the session stays. A second time does nothing."""
        client, self._client = self._client, None
        self.connected_since = None
        if client is not None:
            client.disconnect()
            client.loop_stop()

    def _connected(self, client: Client) -> None:
        self.heard.put(Message(time.monotonic(), "", b""))
        self.connected_since = time.monotonic()
        options = SubscribeOptions(qos=1, retainAsPublished=True)
        client.subscribe([(self._base + topic, options) for topic in TOPICS])

    def _disconnected(self, client: Client) -> None:
        if client is self._client:
            self.connected_since = None

    def _note(self, message: MQTTMessage) -> None:
        topic = message.topic.removeprefix(self._base)
        self.heard.put(Message(time.monotonic(), topic, bytes(message.payload)))
