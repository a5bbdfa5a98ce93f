"""What we add to paho: every reason code is known, any packet costs little, and the cause of an end is kept."""

from __future__ import annotations

import asyncio
import contextlib
import errno
from collections.abc import Callable
from contextlib import AbstractAsyncContextManager
from typing import TypeAlias

import pytest
from paho.mqtt.client import MQTTMessage
from paho.mqtt.enums import CallbackAPIVersion, LogLevel, MQTTErrorCode, MQTTProtocolVersion
from paho.mqtt.exception import MQTTException
from paho.mqtt.packettypes import PacketTypes
from paho.mqtt.reasoncodes import ReasonCode

from lfs10d.mqtt.broker_client import BrokerClient
from lfs10d.mqtt.messages import Accepted, Filter, Incoming
from lfs10d.mqtt.paho_client import LARGEST_PACKET, BoundedClient, every_reason
from lfs10d.mqtt.reasons import Disconnect
from lfs10d.mqtt.settings import BrokerSettings, Version
from tests.support.old_brokers import Answer

Serving: TypeAlias = Callable[[Answer], AbstractAsyncContextManager[int]]


@pytest.mark.parametrize(
    "packet", [PacketTypes.CONNACK, PacketTypes.PUBACK, PacketTypes.SUBACK, PacketTypes.DISCONNECT]
)
def test_every_reason_code_from_0x80_on_is_understood_in_every_packet(packet: int) -> None:
    for code in range(0x80, 0x100):
        reason = ReasonCode(packet, identifier=0x80)
        reason.unpack(bytes((code,)))
        assert reason.value == code
        assert str(reason)


def test_what_paho_knows_keeps_its_name() -> None:
    known = {0: {"Success": [PacketTypes.PUBACK]}, 0x95: {"Packet too large": [PacketTypes.CONNACK]}}
    table = every_reason(known)
    assert table[0] == known[0]
    assert table[0x95]["Packet too large"] == [PacketTypes.CONNACK]
    assert PacketTypes.CONNACK not in table[0x95]["Reason code 0x95"]
    assert str(ReasonCode(PacketTypes.DISCONNECT, identifier=0x8E)) == "Session taken over"


class Taker:
    """Takes what a connection tells, and subscribes."""

    def __init__(self) -> None:
        self.client: BrokerClient
        self.messages: list[Incoming] = []
        self.endings: list[Disconnect] = []
        self.come = asyncio.Event()

    def accepted(self, _: Accepted) -> None:
        connection = self.client.connection
        assert connection is not None
        connection.subscribe([Filter("t")])

    def ended(self, ended: Disconnect) -> None:
        self.endings.append(ended)
        self.come.set()

    def acknowledged(self, mid: int, reason: int) -> None:
        raise AssertionError((mid, reason))

    def subscribed(self, _mid: int, _reasons: tuple[int, ...]) -> None:
        return

    def arrived(self, message: Incoming) -> None:
        self.messages.append(message)
        self.come.set()

    async def until(self, claim: Callable[[], bool]) -> None:
        async with asyncio.timeout(20.0):
            while not claim():
                self.come.clear()
                await self.come.wait()


def head(first: int, length: int) -> bytes:
    """Return a fixed header."""
    encoded = bytearray((first,))
    while True:
        length, digit = divmod(length, 128)
        encoded.append(digit | (0x80 if length else 0))
        if not length:
            return bytes(encoded)


@pytest.mark.parametrize("version", list(Version))
def test_a_payload_of_any_size_comes_cut_is_acknowledged_and_followed_by_the_next(
    serving: Serving, version: Version
) -> None:
    """By MQTT 5 the broker was asked not to send it; this one does not care."""
    five = version is Version.V5
    said = bytearray()
    done = asyncio.Event()

    async def answer(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        said.extend(await reader.read(1000))
        writer.write(b"\x20\x03\x00\x00\x00" if five else b"\x20\x02\x00\x00")
        said.extend(await reader.read(1000))
        for mid in (1, 2, 3):
            variable = b"\x00\x01t" + bytes((0, mid)) + (b"\x00" if five else b"")
            size = 20_000_000 if mid < 3 else 5
            writer.write(head(0x32, len(variable) + size) + variable)
            for _ in range(size // 100_000):
                writer.write(b"\x30\x05\x00\x01t" * 20_000)  # what would be packets if it were not passed over
                await writer.drain()
            if mid == 3:
                writer.write(b"hello")
        while data := await reader.read(1000):
            said.extend(data)
            if said.endswith(b"\x40\x02\x00\x03"):
                done.set()

    async def scenario() -> None:
        async with serving(answer) as port:
            taker = Taker()
            taker.client = BrokerClient(BrokerSettings("127.0.0.1", port, "me", version), taker)
            taker.client.start()
            with contextlib.suppress(TimeoutError):
                await taker.until(lambda: len(taker.messages) == 3 or bool(taker.endings))
            assert not taker.endings
            sizes = [len(each.payload) for each in taker.messages]
            variable = 6 if five else 5
            assert sizes == [LARGEST_PACKET - variable, LARGEST_PACKET - variable, 5]
            async with asyncio.timeout(5.0):
                await done.wait()
            await taker.client.leave(0.1)

    asyncio.run(scenario())
    for mid in (1, 2, 3):
        assert bytes((0x40, 2, 0, mid)) in said
    asked = b"\x27" + LARGEST_PACKET.to_bytes(4, "big")  # Maximum Packet Size (MQTT 5.0, section 3.1.2.11.4)
    assert (asked in said) is five


@pytest.mark.parametrize(
    ("bytes_said", "words"),
    [
        (b"\x30\x02\x00\x09", "the connection is lost: Received malformed packet: "),
        (b"\x00\x00", "the connection is lost: Error: Unrecognised command 0"),
        (b"", "the connection is lost: the broker closed it without giving a reason"),
        (b"\xe0\x01\x87", "not authorized: check mqtt.username"),
        (b"\xe0\x00", "the connection is lost: the broker closed it without giving a reason"),
    ],
)
def test_why_a_connection_ended_is_reported(serving: Serving, bytes_said: bytes, words: str) -> None:
    async def answer(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        await reader.read(1000)
        writer.write(b"\x20\x03\x00\x00\x00")
        await reader.read(1000)
        writer.write(bytes_said)
        if bytes_said:
            await reader.read(1000)

    async def scenario() -> None:
        async with serving(answer) as port:
            taker = Taker()
            taker.client = BrokerClient(BrokerSettings("127.0.0.1", port, "me"), taker)
            taker.client.start()
            await taker.until(lambda: bool(taker.endings))
            assert taker.endings[0].message.startswith(f"broker 127.0.0.1:{port}: {words}")
            await taker.client.leave(0.1)

    asyncio.run(scenario())


@pytest.mark.parametrize("version", list(Version))
def test_a_retained_message_of_qos_0_comes_whole_with_properties_or_without(serving: Serving, version: Version) -> None:
    five = version is Version.V5
    plain = b"\x31" + (b"\x06\x00\x01t\x00hi" if five else b"\x05\x00\x01thi")
    correlated = b"\x31\x0a\x00\x01t\x04\x09\x00\x01chi" if five else plain
    empty = b"\x31" + (b"\x04\x00\x01t\x00" if five else b"\x03\x00\x01t")

    async def answer(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        await reader.read(1000)
        writer.write(b"\x20\x03\x00\x00\x00" if five else b"\x20\x02\x00\x00")
        await reader.read(1000)
        writer.write(plain + correlated + empty + b"\x31\x02\x00\x09")
        await reader.read(1000)

    async def scenario() -> None:
        async with serving(answer) as port:
            taker = Taker()
            taker.client = BrokerClient(BrokerSettings("127.0.0.1", port, "me", version), taker)
            taker.client.start()
            await taker.until(lambda: bool(taker.endings))
            assert taker.messages == [
                Incoming("t", b"hi", retained=True),
                Incoming("t", b"hi", retained=True, correlation=b"c" if five else None),
                Incoming("t", b"", retained=True),
            ]
            assert "malformed" in taker.endings[0].message
            await taker.client.leave(0.1)

    asyncio.run(scenario())


class Torn(BoundedClient):
    """A client in the middle of a packet that it passes over, whose socket says this."""

    def __init__(self, said: bytes | OSError) -> None:
        super().__init__(CallbackAPIVersion.VERSION2)
        self._said = said
        self._passing_over = 10

    def _sock_recv(self, bufsize: int) -> bytes:
        if isinstance(self._said, OSError):
            raise self._said
        return self._said[:bufsize]

    def read(self) -> MQTTErrorCode:
        return self._packet_read()


@pytest.mark.parametrize(
    ("said", "code"),
    [
        (BlockingIOError(), MQTTErrorCode.MQTT_ERR_AGAIN),
        (ConnectionResetError(errno.ECONNRESET, "reset"), MQTTErrorCode.MQTT_ERR_CONN_LOST),
        (b"", MQTTErrorCode.MQTT_ERR_CONN_LOST),
    ],
)
def test_a_connection_may_end_while_a_packet_is_passed_over(said: bytes | OSError, code: MQTTErrorCode) -> None:
    client = Torn(said)
    assert client.read() is code
    assert client.trouble is (said if isinstance(said, ConnectionResetError) else None)


def test_a_long_packet_is_passed_over_in_turns() -> None:
    client = Torn(b"x")
    client._passing_over = 100
    assert client.read() is MQTTErrorCode.MQTT_ERR_AGAIN
    assert client._passing_over == 84


class Acknowledged(BoundedClient):
    """A client that has published packet 7, and is told what the broker says to it."""

    def __init__(self) -> None:
        super().__init__(CallbackAPIVersion.VERSION2, protocol=MQTTProtocolVersion.MQTTv5)
        self.heard: list[tuple[int, int]] = []
        self.on_publish = lambda _client, _userdata, mid, reason, _properties: self.heard.append((mid, reason.value))
        self._sent = MQTTMessage(7, b"t")
        self._sent.qos = 1
        self._out_messages[7] = self._sent

    def hears(self, body: bytes) -> MQTTErrorCode:
        self._in_packet["packet"] = bytearray(body)
        return self._handle_pubackcomp("PUBACK")

    @property
    def waiting(self) -> bool:
        return bool(self._out_messages) or not self._sent.info.is_published()


@pytest.mark.parametrize(
    ("body", "reason"),
    [
        (b"\x00\x07", 0),
        (b"\x00\x07\x10", 0x10),
        (b"\x00\x07\x00", 0),
        (b"\x00\x07\x10\x00", 0x10),
        (b"\x00\x07\x97", 0x97),
    ],
)
def test_an_acknowledgement_comes_with_its_reason_and_once(body: bytes, reason: int) -> None:
    client = Acknowledged()
    for _ in range(2):
        assert client.hears(body) is MQTTErrorCode.MQTT_ERR_SUCCESS
    assert client.heard == [(7, reason)]
    assert not client.waiting


def test_an_acknowledgement_of_what_was_not_published_is_passed_over() -> None:
    client = Acknowledged()
    for body in (b"\x00\x08", b"\x00\x08\x10"):
        assert client.hears(body) is MQTTErrorCode.MQTT_ERR_SUCCESS
    assert client.waiting
    with pytest.raises(MQTTException, match="wrong size of packet"):
        client.hears(b"\x07")


def test_only_errors_of_paho_are_kept() -> None:
    client = BoundedClient(CallbackAPIVersion.VERSION2)
    told = []
    for level, error in ((LogLevel.MQTT_LOG_DEBUG, "x"), (LogLevel.MQTT_LOG_ERR, "y")):
        client._easy_log(level, "failed on socket: %s", ValueError(error))
        told.append(client.trouble)
    assert told == [None, "failed on socket: y"]
