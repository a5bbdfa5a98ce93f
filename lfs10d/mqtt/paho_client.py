"""Additions to paho's client: packets of any size, unknown reason codes, and why a connection ended.

paho 2.2 takes a packet into memory whole, however large; it closes the connection at a reason code that is not in its
table, for it calls that packet malformed; and it says only in its log what went wrong.
"""

from __future__ import annotations

import logging
import socket
from collections.abc import Callable, Mapping, Sequence
from typing import Literal

from paho.mqtt.client import Client, MQTTMessage
from paho.mqtt.enums import CallbackAPIVersion, MQTTErrorCode, MQTTProtocolVersion
from paho.mqtt.packettypes import PacketTypes
from paho.mqtt.properties import Properties
from paho.mqtt.reasoncodes import ReasonCode
from paho.mqtt.subscribeoptions import SubscribeOptions

from lfs10d.mqtt.messages import Filter, Will
from lfs10d.mqtt.settings import BrokerSettings, Version

CONNECT_TIMEOUT = 5.0
"""Seconds for each address of the broker to answer, and for each step of the TLS handshake."""

RECEIVE_MAXIMUM = 64
"""Our Receive Maximum: a flood of requests waits at the broker, not in our memory."""

LARGEST_PACKET = 128 * 1024
"""Largest packet in bytes; the rest is skipped. By MQTT 5 the broker is asked to send none larger."""

PASSED_OVER_AT_ONCE = 64 * 1024
PASSES = 16
"""Bytes passed over by one call of the system, and calls in one turn of the loop."""

RETAINED_QOS_0 = 0x31
"""First byte of a PUBLISH of QoS 0 that is retained and no repetition (MQTT 5.0, section 3.3.1)."""

PACKET_ID = 2
"""Bytes of a packet id."""

_ANSWERS = (
    PacketTypes.CONNACK,
    PacketTypes.PUBACK,
    PacketTypes.PUBREC,
    PacketTypes.SUBACK,
    PacketTypes.UNSUBACK,
    PacketTypes.DISCONNECT,
)
"""The packets in which a broker refuses something."""


def every_reason(known: Mapping[int, Mapping[str, list[int]]]) -> dict[int, dict[str, list[int]]]:
    """Return a table of reason codes in which each code from 0x80 on has a name in each packet.

    It is a plain dict, which paho copies for every reason code that it makes in half the time of its own.
    """
    table = {code: dict(names) for code, names in known.items()}
    for code in range(0x80, 0x100):
        named = {packet for packets in table.setdefault(code, {}).values() for packet in packets}
        unnamed = [packet for packet in _ANSWERS if packet not in named]
        if unnamed:
            table[code][f"Reason code 0x{code:02X}"] = unnamed
    return table


ReasonCode.names = every_reason(ReasonCode.names)

_TAKEN = {
    b"": ReasonCode(PacketTypes.PUBACK),
    b"\x10": ReasonCode(PacketTypes.PUBACK, "No matching subscribers"),
}
"""What follows the packet id in a PUBACK by which a broker takes a message (MQTT 5.0, section 3.4.2.1)."""

_NOTHING_MORE = Properties(PacketTypes.PUBACK)  # type: ignore[no-untyped-call]  # paho leaves it untyped


class _Trouble(logging.Logger):
    """Takes what paho logs, and keeps the last of it that is an error, or an exception."""

    def __init__(self) -> None:
        super().__init__("paho")
        self.last: BaseException | str | None = None

    def log(self, level: int, msg: object, *args: object, **_: object) -> None:
        """Keep an error; paho tells of a packet it does not understand at level debug."""
        if level < logging.ERROR and not (level == logging.DEBUG and msg == "Received malformed packet: %s"):
            return
        caught = next((each for each in args if isinstance(each, OSError)), None)
        self.last = caught or (str(msg) % args)


class BoundedClient(Client):
    """A client that holds at most `LARGEST_PACKET` bytes of a packet; a longer message comes cut to that."""

    _passing_over = 0
    """Bytes of the packet before that are still to come."""

    def __init__(self, *arguments: object, **named: object) -> None:
        super().__init__(*arguments, **named)  # type: ignore[arg-type]  # passed on as they are
        self._trouble = _Trouble()
        self.enable_logger(self._trouble)

    @property
    def trouble(self) -> BaseException | str | None:
        """The last error; None: the broker closed the connection."""
        return self._trouble.last

    dial: Callable[[], tuple[str, int, socket.socket]] | None = None
    """Opens the connection to one of several nodes, and names host and port; None: to the one of the settings."""

    def _create_socket_connection(self) -> socket.socket:
        if self.dial is None:
            return super()._create_socket_connection()
        self._host, self._port, opened = self.dial()  # TLS checks the name of the host that answered
        return opened

    def _sock_recv(self, bufsize: int) -> bytes:
        # paho asks for all that is missing of a packet at once.
        if bufsize > LARGEST_PACKET:
            self._passing_over = bufsize - LARGEST_PACKET
            self._in_packet["to_process"] = bufsize = LARGEST_PACKET
        return super()._sock_recv(bufsize)

    def _handle_publish(self) -> MQTTErrorCode:
        # What is retained comes by thousands at once where somebody left it: without properties that is half the work.
        packet = self._in_packet["packet"]
        end = 2 + int.from_bytes(packet[:2], "big")
        begin = end + (self._protocol == MQTTProtocolVersion.MQTTv5)
        if self._in_packet["command"] != RETAINED_QOS_0 or begin > len(packet) or any(packet[end:begin]):
            return super()._handle_publish()
        message = MQTTMessage(0, bytes(packet[2:end]))
        message.payload, message.retain = bytes(packet[begin:]), True
        if self.on_message is not None:
            self.on_message(self, self._userdata, message)
        return MQTTErrorCode.MQTT_ERR_SUCCESS

    def _handle_pubackcomp(self, cmd: Literal["PUBACK", "PUBCOMP"]) -> MQTTErrorCode:
        # Two come for each sample, without properties. paho makes a reason code and properties of each anew.
        packet = self._in_packet["packet"]
        reason = _TAKEN.get(bytes(packet[PACKET_ID:])) if cmd == "PUBACK" and len(packet) >= PACKET_ID else None
        if reason is None:
            return super()._handle_pubackcomp(cmd)
        with self._out_message_mutex:
            packet_id = int.from_bytes(packet[:PACKET_ID], "big")
            if packet_id in self._out_messages:
                return self._do_on_publish(packet_id, reason, _NOTHING_MORE)
        return MQTTErrorCode.MQTT_ERR_SUCCESS

    def _packet_read(self) -> MQTTErrorCode:
        for _ in range(PASSES):
            if not self._passing_over or self._in_packet["command"]:
                return super()._packet_read()
            try:
                passed = len(self._sock_recv(min(self._passing_over, PASSED_OVER_AT_ONCE)))
            except BlockingIOError:
                return MQTTErrorCode.MQTT_ERR_AGAIN
            except OSError as error:
                self._trouble.last = error
                return MQTTErrorCode.MQTT_ERR_CONN_LOST
            if not passed:
                return MQTTErrorCode.MQTT_ERR_CONN_LOST
            self._passing_over -= passed
        return MQTTErrorCode.MQTT_ERR_AGAIN


def build_client(settings: BrokerSettings, version: Version, will: Will | None) -> BoundedClient:
    """Return a client that `reconnect()` connects, without callbacks."""
    five = version is Version.V5
    client = BoundedClient(
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
    if five:
        properties = properties_of(PacketTypes.CONNECT)
        properties.ReceiveMaximum = RECEIVE_MAXIMUM
        properties.MaximumPacketSize = LARGEST_PACKET
        client.connect_async(settings.host, settings.port, settings.keepalive, clean_start=True, properties=properties)
    else:
        client.connect_async(settings.host, settings.port, settings.keepalive)
    return client


def subscriptions(
    filters: Sequence[Filter], version: Version
) -> list[tuple[str, int]] | list[tuple[str, SubscribeOptions]]:
    """Return subscriptions as paho takes them: the broker sends what it retains for each."""
    if version is not Version.V5:
        return [(each.topic, each.qos) for each in filters]
    return [
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


def properties_of(packet: int) -> Properties:
    """Return an empty set of MQTT 5 properties for a packet type."""
    return Properties(packet)  # type: ignore[no-untyped-call]  # paho leaves it untyped
