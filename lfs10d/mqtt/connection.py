"""One connection to the broker from its beginning to its end; the only importer of paho.

paho runs one thread per connection. Its callbacks do nothing but pass on what happened to the asyncio loop: to
take a lock there would dead-lock with `publish`. It keeps no queue and reconnects nothing here; both are others'
business. Nothing in this module blocks the loop: name resolution, connecting, TLS, and reading the
password and the certificates all happen in paho's thread, and a thread that hangs there is left to itself.
"""

from __future__ import annotations

import asyncio
import contextlib
import socket
from typing import TYPE_CHECKING

from paho.mqtt.client import Client, ConnectFlags, DisconnectFlags, MQTTMessage
from paho.mqtt.enums import CallbackAPIVersion, MQTTErrorCode, MQTTProtocolVersion
from paho.mqtt.packettypes import PacketTypes
from paho.mqtt.properties import Properties
from paho.mqtt.subscribeoptions import SubscribeOptions

from lfs10d.mqtt.endings import (
    REFUSED_FROM,
    SESSION_TAKEN_OVER,
    UNSUPPORTED_VERSION,
    Ended,
    Ending,
    failed,
    reason_in_words,
)
from lfs10d.mqtt.messages import RECEIVE_MAXIMUM_UNSAID, Accepted, Incoming
from lfs10d.mqtt.settings import Version
from lfs10d.mqtt.tls import tls_context

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from paho.mqtt.reasoncodes import ReasonCode

    from lfs10d.mqtt.messages import Events, Filter, Will
    from lfs10d.mqtt.settings import BrokerSettings

CONNECT_TIMEOUT = 5.0
"""Seconds for each address of the broker to answer, and for each step of the TLS handshake."""

CONNACK_TIMEOUT = 5.0
"""Seconds from an open connection to the broker's CONNACK; amqtt 0.12 leaves a CONNECT of MQTT 5 unanswered."""

RECEIVE_MAXIMUM = 64
"""Requests the broker may have under way to us: a flood waits there, not in our memory."""


class _Client(Client):
    """paho's client whose thread prepares itself, never prints a traceback, and says when it is over."""

    prepare: Callable[[], None]
    over: Callable[[Ended | None], None]
    explain: Callable[[Exception], Ended]

    def loop_forever(
        self,
        timeout: float = 1.0,
        retry_first_connection: bool = False,  # noqa: ARG002, FBT001, FBT002 - paho's signature; it is never retried
    ) -> MQTTErrorCode:
        ended: Ended | None = None
        try:
            self.prepare()
            return super().loop_forever(timeout, retry_first_connection=False)
        except Exception as caught:  # noqa: BLE001 - whatever a broker provokes ends this connection and no more
            ended = self.explain(caught)
            return MQTTErrorCode.MQTT_ERR_UNKNOWN
        finally:
            self.over(ended)
            self._forget()

    def _forget(self) -> None:
        # Without the way back to the connection no cycle is left, and the sockets are closed with the last
        # reference rather than when the garbage collector comes by.
        self.on_socket_open = self.on_connect = self.on_disconnect = None
        self.on_publish = self.on_subscribe = self.on_message = None
        del self.prepare, self.over, self.explain


class Connection:
    """One connection, begun when it is built, inside a running loop."""

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
        self._client = self._build(will)
        self._client.loop_start()

    def _build(self, will: Will | None) -> _Client:
        settings = self._settings
        five = self._version is Version.V5
        client = _Client(
            CallbackAPIVersion.VERSION2,
            settings.client_id,
            clean_session=None if five else True,
            protocol=MQTTProtocolVersion.MQTTv5 if five else MQTTProtocolVersion.MQTTv311,
            reconnect_on_failure=False,
            manual_ack=True,
        )
        client.connect_timeout = CONNECT_TIMEOUT
        client.max_inflight_messages_set(0)  # the outbox counts
        if will is not None:
            client.will_set(will.topic, will.payload, qos=1, retain=True)
        client.prepare = self._prepare
        client.over = self._over
        client.explain = self._explain
        client.on_socket_open = self._on_socket_open
        client.on_connect = self._on_connect
        client.on_disconnect = self._on_disconnect
        client.on_publish = self._on_publish
        client.on_subscribe = self._on_subscribe
        client.on_message = self._on_message
        if five:
            properties = _properties(PacketTypes.CONNECT)
            properties.ReceiveMaximum = RECEIVE_MAXIMUM
            client.connect_async(
                settings.host, settings.port, settings.keepalive, clean_start=True, properties=properties
            )
        else:
            client.connect_async(settings.host, settings.port, settings.keepalive)
        return client

    # From the loop

    def publish(
        self, topic: str, payload: bytes, *, qos: int = 1, retain: bool = False, correlation: bytes | None = None
    ) -> int | None:
        """Hand over one message; return its id, None where there is no connection now. By 5: `correlation`."""
        properties = None
        if correlation is not None and self._version is Version.V5:
            properties = _properties(PacketTypes.PUBLISH)
            properties.CorrelationData = correlation
        info = self._client.publish(topic, payload, qos, retain, properties)
        return info.mid if info.rc == MQTTErrorCode.MQTT_ERR_SUCCESS else None

    def subscribe(self, filters: Sequence[Filter]) -> int | None:
        """Subscribe, retained messages first; return the id, None where there is no connection now."""
        if self._version is Version.V5:
            _, mid = self._client.subscribe(
                [
                    (
                        each.topic,
                        SubscribeOptions(
                            qos=each.qos,
                            noLocal=each.no_local,
                            retainAsPublished=each.retain_as_published,
                            retainHandling=SubscribeOptions.RETAIN_SEND_ON_SUBSCRIBE,
                        ),
                    )
                    for each in filters
                ]
            )
        else:
            _, mid = self._client.subscribe([(each.topic, each.qos) for each in filters])
        return mid

    def unsubscribe(self, topics: Sequence[str]) -> None:
        """End subscriptions."""
        self._client.unsubscribe(list(topics))

    def leave(self) -> None:
        """Disconnect in order, which makes the broker drop the will; `ended` follows if the broker lives."""
        self._left = True
        self._client.disconnect()

    def abandon(self) -> None:
        """End it at once and say nothing more; the broker publishes the will."""
        self._abandoned = True
        self._events = None
        self._cancel_connack()
        opened = self._client.socket()
        if isinstance(opened, socket.socket):
            with contextlib.suppress(OSError):
                # Below TLS: its own shutdown would wait, and races with paho's thread.
                socket.socket.shutdown(opened, socket.SHUT_RDWR)

    # In paho's thread

    def _prepare(self) -> None:
        settings = self._settings
        if settings.username is not None:
            password = settings.password()
            self._client.username_pw_set(settings.username, None if password is None else password.reveal())
        if settings.tls is not None:
            self._client.tls_set_context(tls_context(settings.tls))

    def _on_socket_open(self, _client: Client, _userdata: object, opened: object) -> None:
        if self._abandoned and isinstance(opened, socket.socket):
            opened.close()
            raise ConnectionAbortedError
        self._post(self._begin_connack)

    def _on_connect(
        self, _c: Client, _u: object, _flags: ConnectFlags, reason: ReasonCode, properties: Properties | None
    ) -> None:
        self._post(self._answered, reason.value, properties)

    def _on_disconnect(
        self, _c: Client, _u: object, flags: DisconnectFlags, reason: ReasonCode, _p: Properties | None
    ) -> None:
        self._post(self._gone, reason.value if flags.is_disconnect_packet_from_server else None)

    def _on_publish(self, _c: Client, _u: object, mid: int, reason: ReasonCode, _p: Properties) -> None:
        self._post(self._acknowledged, mid, reason.value)

    def _on_subscribe(self, _c: Client, _u: object, mid: int, reasons: list[ReasonCode], _p: Properties | None) -> None:
        self._post(self._subscribed, mid, tuple(reason.value for reason in reasons))

    def _on_message(self, _client: Client, _userdata: object, message: MQTTMessage) -> None:
        self._post(self._arrived, message)

    def _explain(self, error: Exception) -> Ended:
        return failed(error, self._settings)

    def _over(self, ended: Ended | None) -> None:
        self._post(self._finished, ended)

    def _post(self, call: Callable[..., None], *values: object) -> None:
        # The loop is closed when an abandoned thread outlives it.
        with contextlib.suppress(RuntimeError):
            self._loop.call_soon_threadsafe(call, *values)

    # In the loop again

    def _begin_connack(self) -> None:
        self._opened = True
        if self._events is not None:
            self._connack = self._loop.call_later(CONNACK_TIMEOUT, self._unanswered)

    def _unanswered(self) -> None:
        events = self._events
        self.abandon()
        if events is not None:
            message = f"{self._settings.place}: connected, but says nothing: is mqtt.port that of an MQTT broker?"
            events.ended(Ended(Ending.WRONG_VERSION, message))

    def _cancel_connack(self) -> None:
        if self._connack is not None:
            self._connack.cancel()
            self._connack = None

    def _answered(self, reason: int, properties: Properties | None) -> None:
        if self._events is None:
            return
        self._cancel_connack()
        if reason >= REFUSED_FROM:
            ending = Ending.WRONG_VERSION if reason == UNSUPPORTED_VERSION else Ending.REFUSED
            self._end(Ended(ending, f"{self._settings.place}: {reason_in_words(reason)}", reason))
            return
        self._accepted = True
        self._events.accepted(
            Accepted(
                self._version,
                getattr(properties, "ReceiveMaximum", RECEIVE_MAXIMUM_UNSAID),
                getattr(properties, "MaximumPacketSize", None),
            )
        )

    def _gone(self, reason: int | None) -> None:
        """Note the end of the connection; `reason` is that of the broker's DISCONNECT."""
        place = self._settings.place
        if self._left:
            self._end(Ended(Ending.LEFT, f"{place}: disconnected"))
        elif not self._accepted:
            message = f"{place}: closed the connection without an answer: check mqtt.port and mqtt.tls"
            self._end(Ended(Ending.WRONG_VERSION, message))
        elif reason is None:
            self._end(Ended(Ending.LOST, f"{place}: the connection is lost"))
        else:
            ending = Ending.TAKEN_OVER if reason == SESSION_TAKEN_OVER else Ending.LOST
            self._end(Ended(ending, f"{place}: {reason_in_words(reason)}", reason))

    def _finished(self, ended: Ended | None) -> None:
        """Note that paho's thread is over, `ended` by an error of its own or after its `on_disconnect`."""
        if ended is not None and not self._opened:
            self._end(ended)
        else:
            self._gone(None)

    def _end(self, ended: Ended) -> None:
        events, self._events = self._events, None
        self._cancel_connack()
        if events is not None:
            events.ended(ended)

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


def _properties(packet: int) -> Properties:
    return Properties(packet)  # type: ignore[no-untyped-call]  # paho leaves it untyped
