"""What a broker sends is read whole, however it is cut, and garbage is told from it."""

from __future__ import annotations

import contextlib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lfs10d.mqtt import packets, stream
from lfs10d.mqtt.settings import Version
from lfs10d.mqtt.stream import Connack, Delivery, MalformedError, Packet, Type

PUBACK = b"\x40\x02\x00\x07"
LONG = b"\x30\x81\x01" + b"\x00\x01t" + b"\x00" + b"x" * 125
EVERYTHING = (
    b"\x03\x00\x01c" b"\x08\x00\x01r" b"\x09\x00\x02\x00\xff" b"\x26\x00\x01k\x00\x01v" b"\x0b\x80\x01" b"\x01\x01"
    b"\x02\x00\x00\x00\x09"
)  # fmt: skip
"""Content type, response topic, correlation data, user property, subscription identifier, format, expiry."""


@given(st.lists(st.sampled_from([PUBACK, LONG, b"\xd0\x00"]), max_size=5), st.data())
def test_packets_are_whole_however_the_stream_is_cut(sent: list[bytes], data: st.DataObject) -> None:
    whole = b"".join(sent)
    got: list[Packet] = []
    buffer = bytearray()
    while whole:
        cut = data.draw(st.integers(1, len(whole)))
        buffer += whole[:cut]
        whole = whole[cut:]
        got += stream.packets(buffer)
    assert not buffer
    kinds = {PUBACK: Type.PUBACK, LONG: Type.PUBLISH, b"\xd0\x00": Type.PINGRESP}
    assert [packet.type for packet in got] == [kinds[each] for each in sent]


@given(st.binary(max_size=60), st.sampled_from(Version))
def test_garbage_is_malformed_and_nothing_worse(garbage: bytes, version: Version) -> None:
    with contextlib.suppress(MalformedError):
        for packet in stream.packets(bytearray(garbage)):
            for read in (stream.connack, stream.suback):
                with contextlib.suppress(MalformedError):
                    read(packet.body, version)
            with contextlib.suppress(MalformedError):
                stream.puback(packet.body)
            with contextlib.suppress(MalformedError):
                stream.delivery(packet, version)
            assert stream.disconnected(packet.body) in range(256)


@pytest.mark.parametrize("garbage", [b"\x00\x00", b"\x10\x00", b"\x30\xff\xff\xff\xff\x01"])
def test_what_no_broker_may_send_is_malformed(garbage: bytes) -> None:
    with pytest.raises(MalformedError):
        list(stream.packets(bytearray(garbage)))


@pytest.mark.parametrize(
    ("body", "version", "told"),
    [
        (b"\x00\x00\x00", Version.V5, Connack(0)),
        (b"\x01\x00\x00", Version.V5, Connack(0)),
        (b"\x00\x87\x00", Version.V5, Connack(0x87)),
        (b"\x00\x00\x0b\x21\x00\x14\x27\x00\x00\x10\x00\x13\x00\x3c", Version.V5, Connack(0, 20, 4096, 60)),
        (b"\x00\x00", Version.V311, Connack(0)),
        (b"\x00\x00\x00", Version.V311, Connack(0)),
        (b"\x00\x00", Version.V5, Connack(0x84)),
        (b"\x00\x01", Version.V5, Connack(0x84)),
        (b"\x00\x02", Version.V311, Connack(0x85)),
        (b"\x00\x03", Version.V311, Connack(0x88)),
        (b"\x00\x04", Version.V311, Connack(0x86)),
        (b"\x00\x05", Version.V311, Connack(0x87)),
        (b"\x00\x63", Version.V311, Connack(0x80)),
    ],
)
def test_a_connack_is_read_in_the_words_of_5(body: bytes, version: Version, told: Connack) -> None:
    assert stream.connack(body, version) == told


@pytest.mark.parametrize(
    ("body", "told"), [(b"\x00\x07", (7, 0)), (b"\x01\x00\x10", (256, 0x10)), (b"\x00\x07\x87\x00", (7, 0x87))]
)
def test_a_puback_says_which_message_and_what_became_of_it(body: bytes, told: tuple[int, int]) -> None:
    assert stream.puback(body) == told


@pytest.mark.parametrize(
    ("body", "version"), [(b"\x00\x07\x00\x01\x80", Version.V5), (b"\x00\x07\x01\x80", Version.V311)]
)
def test_a_suback_has_one_reason_per_filter(body: bytes, version: Version) -> None:
    assert stream.suback(body, version) == (7, (1, 0x80))


@pytest.mark.parametrize(("body", "reason"), [(b"", 0), (b"\x8e", 0x8E), (b"\x8b\x00", 0x8B)])
def test_a_disconnect_says_why(body: bytes, reason: int) -> None:
    assert stream.disconnected(body) == reason


def test_a_message_is_read_with_all_that_belongs_to_it() -> None:
    body = b"\x00\x01t\x00\x09" + bytes((len(EVERYTHING),)) + EVERYTHING + b"payload"
    read = stream.delivery(Packet(Type.PUBLISH, 0b0011, body), Version.V5)
    assert read == Delivery(b"t", b"payload", retained=True, mid=9, response_topic=b"r", correlation=b"\x00\xff")


@given(
    topic=st.text(max_size=9),
    payload=st.binary(max_size=200),
    mid=st.one_of(st.none(), st.integers(1, 65_535)),
    retain=st.booleans(),
    reply=st.one_of(st.none(), st.text(max_size=9)),
    tag=st.one_of(st.none(), st.binary(max_size=99)),
    version=st.sampled_from(Version),
)
def test_what_we_publish_is_read_back_the_same(
    *,
    topic: str,
    payload: bytes,
    mid: int | None,
    retain: bool,
    reply: str | None,
    tag: bytes | None,
    version: Version,
) -> None:
    sent = packets.publish(version, topic, payload, mid=mid, retain=retain, response_topic=reply, correlation=tag)
    (packet,) = stream.packets(bytearray(sent))
    read = stream.delivery(packet, version)
    told = (reply, tag) if version is Version.V5 else (None, None)
    response_topic = None if read.response_topic is None else read.response_topic.decode()
    assert (read.topic.decode(), read.payload, read.mid, read.retained) == (topic, payload, mid, retain)
    assert (response_topic, read.correlation) == told


@pytest.mark.parametrize(
    "body",
    [
        b"\x00",  # ends within the topic's length
        b"\x00\x05t",  # ends within the topic
        b"\x00\x01t",  # ends before the packet id
        b"\x00\x01t\x00\x01",  # ends before the properties
        b"\x00\x01t\x00\x01\x02\x7f\x00",  # a property that nobody knows
        b"\x00\x01t\x00\x01\x01\x01\x01",  # a property longer than all of them
        b"\x00\x01t\x00\x01\x05\x01\x01",  # more properties than bytes
        b"\x00\x01t\x00\x01\x80\x80\x80\x80\x01",  # a length of five bytes
    ],
)
def test_a_message_that_ends_where_it_must_not_is_malformed(body: bytes) -> None:
    with pytest.raises(MalformedError):
        stream.delivery(Packet(Type.PUBLISH, 0b0010, body), Version.V5)


@pytest.mark.parametrize("flags", [0b0100, 0b0110])
def test_a_message_of_qos_2_is_malformed(flags: int) -> None:
    with pytest.raises(MalformedError, match="QoS"):
        stream.delivery(Packet(Type.PUBLISH, flags, b"\x00\x01t\x00\x01\x00"), Version.V5)


@pytest.mark.parametrize("body", [b"", b"\x00"])
def test_what_is_too_short_is_malformed(body: bytes) -> None:
    with pytest.raises(MalformedError):
        stream.connack(body, Version.V5)
    with pytest.raises(MalformedError):
        stream.puback(body)
    with pytest.raises(MalformedError):
        stream.suback(body, Version.V311)


def test_a_reason_that_no_puback_has_is_malformed() -> None:
    with pytest.raises(MalformedError):
        stream.puback(b"\x00\x07\xf7")
