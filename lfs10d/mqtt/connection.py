"""One connection to the broker from its beginning to its end.

A thread of its own, gone afterwards, does what may block: the password and the certificates are read, the name is
resolved, the socket is connected, TLS is agreed upon. A thread that hangs there is left to itself. From then on all
happens in the asyncio loop, which watches the socket: a thread for it would wake twice for every message (see
docs/decisions/0003-one-loop.md). Its bytes are made in `packets` and read in `stream`. It keeps no queue of messages
and reconnects nothing here.
"""

from __future__ import annotations

import asyncio
import contextlib
import socket
import ssl
import threading
from itertools import cycle
from typing import TYPE_CHECKING

from lfs10d.mqtt import packets, stream
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
from lfs10d.mqtt.stream import MalformedError, Type
from lfs10d.mqtt.tls import tls_context

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from lfs10d.mqtt.messages import Events, Filter, Will
    from lfs10d.mqtt.settings import BrokerSettings, Version

CONNECT_TIMEOUT = 5.0
"""Seconds for each address of the broker to answer, and for each step of the TLS handshake."""

CONNACK_TIMEOUT = 5.0
"""Seconds from an open connection to the broker's CONNACK; amqtt 0.12 leaves a CONNECT of MQTT 5 unanswered."""

UPKEEP_EVERY = 1.0
"""Seconds between two looks at the keepalive."""

RECEIVE_MAXIMUM = 64
"""Requests the broker may have under way to us: a flood waits there, not in our memory."""

READ_SIZE = 65_536

LAST_MID = 65_535
"""Packet ids are 1 to this (MQTT 5.0, section 2.2.1); none is used twice before all others were, minutes later."""

_NOT_NOW = (BlockingIOError, InterruptedError, ssl.SSLWantReadError, ssl.SSLWantWriteError)


class Connection:
    """One connection, begun when it is built, inside a running loop."""

    def __init__(self, settings: BrokerSettings, version: Version, events: Events, *, will: Will | None = None) -> None:
        self._settings = settings
        self._version = version
        self._events: Events | None = events
        self._will = will
        self._loop = asyncio.get_running_loop()
        self._socket: socket.socket | None = None
        self._accepted = False
        self._left = False
        self._abandoned = False
        self._connack: asyncio.TimerHandle | None = None
        self._upkeep: asyncio.TimerHandle | None = None
        self._keepalive = settings.keepalive
        self._spoke = self._heard = self._loop.time()
        self._pinged: float | None = None
        self._incoming = bytearray()
        self._outgoing = bytearray()
        self._watched = False  # for room to write
        self._unconfirmed: list[int] = []  # ids of QoS 0 that are not written yet
        self._mids = cycle(range(1, LAST_MID + 1))
        threading.Thread(target=self._connect, name="connect", daemon=True).start()

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
        hold: bool = False,
    ) -> int | None:
        """Send one message; return its id, None where there is no connection now.

        With `hold` it waits for `flush`, that several go at once. By 3.1.1 there is neither `response_topic` nor
        `correlation`.
        """
        if self._socket is None:
            return None
        mid = next(self._mids)
        packet = packets.publish(
            self._version,
            topic,
            payload,
            mid=mid if qos else None,
            retain=retain,
            response_topic=response_topic,
            correlation=correlation,
        )
        if not qos:
            self._unconfirmed.append(mid)
        self._send(packet, hold=hold)
        return mid

    def subscribe(self, filters: Sequence[Filter]) -> int | None:
        """Subscribe, retained messages first; return the id, None where there is no connection now."""
        mid = next(self._mids)
        return mid if self._send(packets.subscribe(self._version, mid, filters)) else None

    def unsubscribe(self, topics: Sequence[str]) -> None:
        """End subscriptions."""
        self._send(packets.unsubscribe(self._version, next(self._mids), topics))

    def leave(self) -> None:
        """Disconnect in order, which makes the broker drop the will; `ended` follows if the broker lives."""
        self._left = True
        self._send(packets.DISCONNECT)

    def abandon(self) -> None:
        """End it at once and say nothing more; the broker publishes the will."""
        self._abandoned = True
        self._events = None
        self._close()

    def flush(self) -> None:
        """Send what is held."""
        if self._socket is None or self._watched or not self._outgoing:
            return
        try:
            del self._outgoing[: self._socket.send(self._outgoing)]
        except _NOT_NOW:
            pass
        except OSError:
            self._loop.call_soon(self._lost)
            return
        self._spoke = self._loop.time()
        if self._outgoing:
            self._watched = True
            self._loop.add_writer(self._socket, self._writable)
        else:
            self._written()

    def _send(self, packet: bytes, *, hold: bool = False) -> bool:
        """Send a packet as soon as the socket takes it; return False where there is no connection now."""
        if self._socket is None:
            return False
        self._outgoing += packet
        if not hold:
            self.flush()
        return True

    def _written(self) -> None:
        """All is handed over: that is all that is ever known of QoS 0, and of a DISCONNECT."""
        if self._unconfirmed:
            written, self._unconfirmed = self._unconfirmed, []
            self._loop.call_soon(self._confirm, written)
        if self._left:
            self._loop.call_soon(self._lost)

    def _writable(self) -> None:
        if self._socket is not None:
            self._loop.remove_writer(self._socket)
        self._watched = False
        self.flush()

    # In the thread that connects

    def _connect(self) -> None:
        opened: socket.socket | None = None
        try:
            settings = self._settings
            secret = settings.password() if settings.username is not None else None
            context = None if settings.tls is None else tls_context(settings.tls)
            hello = packets.connect(
                self._version,
                settings.client_id,
                keepalive=settings.keepalive,
                receive_maximum=RECEIVE_MAXIMUM,
                username=settings.username,
                password=None if secret is None else secret.reveal(),
                will=self._will,
            )
            if self._abandoned:
                return
            opened = socket.create_connection((settings.host, settings.port), CONNECT_TIMEOUT)
            opened.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            if context is not None:
                opened = context.wrap_socket(opened, server_hostname=settings.host, do_handshake_on_connect=False)
                opened.do_handshake()
            opened.setblocking(False)  # noqa: FBT003 - the signature of the library
        except Exception as caught:  # noqa: BLE001 - whatever a broker provokes ends this connection and no more
            if opened is not None:
                opened.close()
            self._post(self._end, failed(caught, self._settings))
        else:
            if not self._post(self._opened, opened, hello):
                opened.close()

    def _post(self, call: Callable[..., None], *values: object) -> bool:
        # The loop is closed when an abandoned thread outlives it.
        with contextlib.suppress(RuntimeError):
            self._loop.call_soon_threadsafe(call, *values)
            return True
        return False

    # The socket, in the loop

    def _opened(self, opened: socket.socket, hello: bytes) -> None:
        """Take the connected socket over from the thread, and say who we are."""
        if self._abandoned:
            opened.close()
            return
        self._socket = opened
        self._connack = self._loop.call_later(CONNACK_TIMEOUT, self._unanswered)
        self._loop.add_reader(opened, self._readable, opened)
        self._keep_up()
        self._send(hello)

    def _close(self) -> None:
        """Stop watching the socket and close it without a word."""
        opened, self._socket = self._socket, None
        for timer in (self._connack, self._upkeep):
            if timer is not None:
                timer.cancel()
        self._connack = self._upkeep = None
        if opened is None:
            return
        self._loop.remove_reader(opened)
        if self._watched:
            self._loop.remove_writer(opened)
            self._watched = False
        with contextlib.suppress(OSError):
            # Below TLS, whose own shutdown would wait.
            socket.socket.shutdown(opened, socket.SHUT_RDWR)
        opened.close()

    def _readable(self, opened: socket.socket) -> None:
        pending = getattr(opened, "pending", None)  # what TLS has decrypted makes no descriptor readable
        alive = self._read(opened)
        while alive and pending is not None and pending():
            alive = self._read(opened)
        self._heard = self._loop.time()
        try:
            for packet in stream.packets(self._incoming):
                self._take(packet)
        except MalformedError:
            alive = False
        if not alive:
            self._lost()

    def _read(self, opened: socket.socket) -> bool:
        """Take what came; return False at the end of everything."""
        try:
            data = opened.recv(READ_SIZE)
        except _NOT_NOW:
            return True
        except OSError:
            return False
        self._incoming += data
        return bool(data)

    def _take(self, packet: stream.Packet) -> None:
        events = self._events
        if events is None:
            return
        body = packet.body
        match packet.type:
            case Type.PUBACK:
                events.acknowledged(*stream.puback(body))
            case Type.PUBLISH:
                self._arrived(stream.delivery(packet, self._version), events)
            case Type.SUBACK:
                events.subscribed(*stream.suback(body, self._version))
            case Type.CONNACK:
                self._answered(stream.connack(body, self._version), events)
            case Type.DISCONNECT:
                self._lost(stream.disconnected(body))
            case Type.PINGRESP:
                self._pinged = None
            case Type.UNSUBACK:
                pass

    def _keep_up(self) -> None:
        """Ping where nothing was said or heard for the keepalive, and notice that no ping is answered."""
        self._upkeep = self._loop.call_later(UPKEEP_EVERY, self._keep_up)
        now = self._loop.time()
        if not self._keepalive or not self._accepted:
            return
        if self._pinged is None:
            if now - min(self._spoke, self._heard) >= self._keepalive:
                self._pinged = now
                self._send(packets.PINGREQ)
        elif now - self._pinged >= self._keepalive:
            self._lost()

    # What became of it

    def _unanswered(self) -> None:
        events = self._events
        self.abandon()
        if events is not None:
            message = f"{self._settings.place}: connected, but says nothing: is mqtt.port that of an MQTT broker?"
            events.ended(Ended(Ending.WRONG_VERSION, message))

    def _answered(self, said: stream.Connack, events: Events) -> None:
        if self._connack is not None:
            self._connack.cancel()
            self._connack = None
        if said.reason >= REFUSED_FROM:
            ending = Ending.WRONG_VERSION if said.reason == UNSUPPORTED_VERSION else Ending.REFUSED
            self._end(Ended(ending, f"{self._settings.place}: {reason_in_words(said.reason)}", said.reason))
            return
        self._accepted = True
        if said.keepalive is not None:
            self._keepalive = said.keepalive
        receive_maximum = RECEIVE_MAXIMUM_UNSAID if said.receive_maximum is None else said.receive_maximum
        events.accepted(Accepted(self._version, receive_maximum, said.maximum_packet_size))

    def _arrived(self, delivery: stream.Delivery, events: Events) -> None:
        with contextlib.suppress(UnicodeDecodeError):  # a topic that is no UTF-8 is none of ours
            response_topic = delivery.response_topic
            events.arrived(
                Incoming(
                    delivery.topic.decode(),
                    delivery.payload,
                    delivery.retained,
                    None if response_topic is None else response_topic.decode(),
                    delivery.correlation,
                )
            )
        if delivery.mid is not None:
            self._send(packets.acknowledge(delivery.mid))

    def _confirm(self, mids: list[int]) -> None:
        for mid in mids:
            if self._events is not None:
                self._events.acknowledged(mid, 0)

    def _lost(self, reason: int | None = None) -> None:
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

    def _end(self, ended: Ended) -> None:
        events, self._events = self._events, None
        self._close()
        if events is not None:
            events.ended(ended)
