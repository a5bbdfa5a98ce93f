"""One connection to the broker from its beginning to its end.

A thread of its own, gone afterwards, does what may block: the password and the certificates are read, the name is
resolved, the socket is connected, TLS is agreed upon, CONNECT is sent. A thread that hangs there is left to itself.
From then on paho runs in the asyncio loop (`pump`): a thread for it would wake twice for every message. Its callbacks
only note what happened, to be dealt with when paho is done: to publish inside a callback would wait for paho itself.
It keeps no queue and reconnects nothing here. What paho does not do, `paho_client` adds.
"""

from __future__ import annotations

import asyncio
import contextlib
import socket
import threading
from collections import deque
from collections.abc import Callable, Sequence
from functools import partial

from paho.mqtt.client import Client, ConnectFlags, DisconnectFlags, MQTTMessage
from paho.mqtt.enums import MQTTErrorCode
from paho.mqtt.packettypes import PacketTypes
from paho.mqtt.properties import Properties
from paho.mqtt.reasoncodes import ReasonCode

from lfs10d.mqtt.messages import RECEIVE_MAXIMUM_UNSAID, Accepted, Events, Filter, Incoming, Will
from lfs10d.mqtt.node_race import NodeRace
from lfs10d.mqtt.paho_client import BoundedClient, build_client, properties_of, subscriptions
from lfs10d.mqtt.pump import Pump
from lfs10d.mqtt.reasons import (
    KEEP_ALIVE_TIMEOUT,
    REFUSED_FROM,
    UNSUPPORTED_VERSION,
    Disconnect,
    DisconnectReason,
    failed,
    gone,
    reason_in_words,
)
from lfs10d.mqtt.settings import BrokerSettings, Version
from lfs10d.mqtt.tls import tls_context

CONNACK_TIMEOUT = 5.0
"""Seconds from an open connection to the broker's CONNACK; amqtt 0.12 leaves a CONNECT of MQTT 5 unanswered."""


class Connection:
    """One connection, begun when it is built, inside a running loop; to the first of the nodes that answers."""

    race: NodeRace | None = None  # which of several nodes answered

    def __init__(self, settings: BrokerSettings, version: Version, events: Events, *, will: Will | None = None) -> None:
        self._settings = settings
        self._version = version
        self._events: Events | None = events
        self._loop = asyncio.get_running_loop()
        self._accepted = False
        self._opened = False
        self._left = False
        self._abandoned = False
        self._connack: asyncio.TimerHandle | None = None
        self._happened: deque[Callable[[], None]] = deque()
        self._client = self._build(will)
        self._pump = Pump(self._client, read=self._deal, failed=self._read_failed)
        threading.Thread(target=self._connect, name="connect", daemon=True).start()

    def _build(self, will: Will | None) -> BoundedClient:
        client = build_client(self._settings, self._version, will)
        client.on_socket_open = self._on_socket_open
        client.on_socket_close = self._on_socket_close
        client.on_connect = self._on_connect
        client.on_disconnect = self._on_disconnect
        client.on_publish = self._on_publish
        client.on_subscribe = self._on_subscribe
        client.on_message = self._on_message
        client.dial = self._dial if self._settings.others else None
        return client

    # From the loop

    def publish(
        self,
        topic: str,
        payload: bytes,
        *,
        qos: int = 1,
        retain: bool = False,
        response_topic: str | None = None,
        correlation: bytes | None = None,
    ) -> int | None:
        """Hand over one message; return its id, None where there is no connection now.

        By 3.1.1 there is neither `response_topic` nor `correlation`.
        """
        properties = None
        if self._version is Version.V5 and (response_topic is not None or correlation is not None):
            properties = properties_of(PacketTypes.PUBLISH)
            if response_topic is not None:
                properties.ResponseTopic = response_topic
            if correlation is not None:
                properties.CorrelationData = correlation
        info = self._client.publish(topic, payload, qos, retain, properties)
        if self._client.want_write():
            self._pump.watch_writing()
        return info.mid if info.rc == MQTTErrorCode.MQTT_ERR_SUCCESS else None

    def cork(self, *, on: bool) -> None:
        """Hold back publications until the cork is removed, to send them together."""
        self._pump.cork(on=on)

    def subscribe(self, filters: Sequence[Filter]) -> int | None:
        """Subscribe, retained messages first; return the id, None where there is no connection now."""
        _, mid = self._client.subscribe(subscriptions(filters, self._version))
        self._pump.watch_writing()
        return mid

    def unsubscribe(self, topics: Sequence[str]) -> None:
        """End subscriptions."""
        self._client.unsubscribe(list(topics))
        self._pump.watch_writing()

    def leave(self) -> None:
        """Disconnect in order, which makes the broker drop the will; `ended` follows if the broker lives."""
        self._left = True
        self._client.disconnect()
        self._pump.watch_writing()

    def abandon(self) -> None:
        """Close it at once without DISCONNECT; the broker publishes the will."""
        self._abandoned = True
        self._events = None
        self._close()

    def _close(self) -> None:
        """Stop watching the socket and close it."""
        self._cancel_connack()
        self._pump.end()
        opened = self._client.socket()
        if isinstance(opened, socket.socket):
            with contextlib.suppress(OSError):
                # Below TLS, whose own shutdown would wait.
                socket.socket.shutdown(opened, socket.SHUT_RDWR)
            opened.close()

    # In the thread that connects

    def _connect(self) -> None:
        try:
            settings = self._settings
            if settings.username is not None:
                password = settings.password()
                self._client.username_pw_set(settings.username, None if password is None else password.reveal())
            if settings.tls is not None:
                self._client.tls_set_context(tls_context(settings.tls))
            self._client.reconnect()
        except Exception as caught:  # noqa: BLE001 - whatever a broker provokes ends this connection and no more
            self._post(self._failed, caught)
        else:
            self._post(self._watch)

    def _dial(self) -> tuple[str, int, socket.socket]:
        self.race = NodeRace(self._settings.nodes, self._settings.waits)
        self._settings, opened = self.race.run()
        return self._settings.host, self._settings.port, opened

    def _on_socket_open(self, _client: Client, _userdata: object, opened: object) -> None:
        if self._abandoned and isinstance(opened, socket.socket):
            opened.close()
            raise ConnectionAbortedError
        self._post(self._begin_connack)

    def _post(self, call: Callable[..., None], *values: object) -> None:
        # The loop is closed when an abandoned thread outlives it.
        with contextlib.suppress(RuntimeError):
            self._loop.call_soon_threadsafe(call, *values)

    # The socket, in the loop

    def _watch(self) -> None:
        """Take the connected socket over from the thread."""
        opened = self._client.socket()
        if self._abandoned:
            self._close()
        elif not isinstance(opened, socket.socket):
            self._gone(None, self._client.trouble)
        else:
            self._pump.begin(opened)

    def _read_failed(self, caught: Exception) -> None:
        self._close()
        self._failed(caught)

    # Callbacks of paho

    def _note(self, call: Callable[..., None], *values: object) -> None:
        """Call this as soon as paho is done: in this turn of the loop by the pump, else in the next."""
        if not (self._happened or self._pump.reading):
            self._loop.call_soon(self._deal)
        self._happened.append(partial(call, *values))

    def _deal(self) -> None:
        while self._happened:
            self._happened.popleft()()

    def _on_socket_close(self, _client: Client, _userdata: object, _closing: object) -> None:
        self._pump.end()

    def _on_connect(
        self, _c: Client, _u: object, _flags: ConnectFlags, reason: ReasonCode, properties: Properties | None
    ) -> None:
        self._note(self._answered, reason.value, properties)

    def _on_disconnect(
        self, _c: Client, _u: object, flags: DisconnectFlags, reason: ReasonCode, _p: Properties | None
    ) -> None:
        if flags.is_disconnect_packet_from_server:
            self._note(self._gone, reason.value or None, None)  # 0: a DISCONNECT that says nothing
        else:
            unanswered = reason.value == KEEP_ALIVE_TIMEOUT
            self._note(self._gone, None, "no answer to a ping" if unanswered else self._client.trouble)

    def _on_publish(self, _c: Client, _u: object, mid: int, reason: ReasonCode, _p: Properties) -> None:
        self._note(self._acknowledged, mid, reason.value)

    def _on_subscribe(self, _c: Client, _u: object, mid: int, reasons: list[ReasonCode], _p: Properties | None) -> None:
        self._note(self._subscribed, mid, tuple(reason.value for reason in reasons))

    def _on_message(self, _client: Client, _userdata: object, message: MQTTMessage) -> None:
        self._note(self._arrived, message)

    # What became of it

    def _begin_connack(self) -> None:
        self._opened = True
        if self._events is not None:
            self._connack = self._loop.call_later(CONNACK_TIMEOUT, self._unanswered)

    def _unanswered(self) -> None:
        events = self._events
        self.abandon()
        if events is not None:
            message = f"{self._settings.place}: connected, but no reply comes: is mqtt.port that of an MQTT broker?"
            events.ended(Disconnect(DisconnectReason.WRONG_VERSION, message))

    def _cancel_connack(self) -> None:
        if self._connack is not None:
            self._connack.cancel()
            self._connack = None

    def _answered(self, reason: int, properties: Properties | None) -> None:
        if self._events is None:
            return
        self._cancel_connack()
        if reason >= REFUSED_FROM:
            ending = DisconnectReason.WRONG_VERSION if reason == UNSUPPORTED_VERSION else DisconnectReason.REFUSED
            self._end(Disconnect(ending, f"{self._settings.place}: {reason_in_words(reason)}", reason))
            return
        self._accepted = True
        self._events.accepted(
            Accepted(
                self._version,
                getattr(properties, "ReceiveMaximum", RECEIVE_MAXIMUM_UNSAID),
                getattr(properties, "MaximumPacketSize", None),
            )
        )

    def _gone(self, reason: int | None, cause: BaseException | str | None) -> None:
        """Note the end of the connection; `reason` is that of the broker's DISCONNECT, `cause` another one."""
        place, left, accepted = self._settings.place, self._left, self._accepted
        self._end(gone(place, left=left, accepted=accepted, reason=reason, cause=cause))

    def _failed(self, caught: Exception) -> None:
        """Note an error of our own side, or one of the socket before it was open."""
        if self._opened:
            self._gone(None, caught)
        else:
            self._end(failed(caught, self._settings))

    def _end(self, ended: Disconnect) -> None:
        events, self._events = self._events, None
        self._cancel_connack()
        self._forget()
        if events is not None:
            events.ended(ended)

    def _forget(self) -> None:
        # Without the way back to us no cycle is left, and what paho holds is freed with the last reference.
        client = self._client
        client.on_socket_open = client.on_socket_close = client.on_connect = client.on_disconnect = None
        client.on_publish = client.on_subscribe = client.on_message = None

    def _acknowledged(self, mid: int, reason: int) -> None:
        if self._events is not None:
            self._events.acknowledged(mid, reason)

    def _subscribed(self, mid: int, reasons: tuple[int, ...]) -> None:
        if self._events is not None:
            self._events.subscribed(mid, reasons)

    def _arrived(self, message: MQTTMessage) -> None:
        if self._events is None:
            return
        with contextlib.suppress(UnicodeDecodeError):  # a topic that is no UTF-8 is none of ours
            properties = message.properties
            self._events.arrived(
                Incoming(
                    message.topic,
                    bytes(message.payload),
                    message.retain,
                    getattr(properties, "ResponseTopic", None),
                    getattr(properties, "CorrelationData", None),
                )
            )
        self._client.ack(message.mid, message.qos)
