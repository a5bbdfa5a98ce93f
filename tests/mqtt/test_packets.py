"""What we send is what paho, an independent client, sends; and what the specification prints."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st
from paho.mqtt.client import Client
from paho.mqtt.enums import CallbackAPIVersion, MQTTProtocolVersion
from paho.mqtt.packettypes import PacketTypes
from paho.mqtt.properties import Properties
from paho.mqtt.subscribeoptions import SubscribeOptions

from lfs10d.mqtt import packets
from lfs10d.mqtt.messages import Filter, Will
from lfs10d.mqtt.settings import Version


class Tap:
    """Stands in for paho's socket and keeps what is written."""

    def __init__(self) -> None:
        self.written = b""

    def send(self, data: bytes) -> int:
        self.written += data
        return len(data)

    def close(self) -> None:
        """Need nothing."""


def tapped(version: Version) -> tuple[Client, Tap]:
    protocol = MQTTProtocolVersion.MQTTv5 if version is Version.V5 else MQTTProtocolVersion.MQTTv311
    client = Client(CallbackAPIVersion.VERSION2, "x", protocol=protocol)
    tap = Tap()
    client._sock = tap  # type: ignore[assignment]  # the only way to see paho's bytes without a broker
    return client, tap


def properties(packet: int) -> Properties:
    return Properties(packet)  # type: ignore[no-untyped-call]  # paho leaves it untyped


TOPICS = st.text("aß/", min_size=1, max_size=40)
VERSIONS = st.sampled_from(Version)


@given(
    topic=TOPICS,
    length=st.one_of(st.integers(0, 300), st.sampled_from([16_000, 16_383, 16_390, 2_097_152])),
    version=VERSIONS,
    qos=st.sampled_from([0, 1]),
    retain=st.booleans(),
    response_topic=st.one_of(st.none(), TOPICS),
    correlation=st.one_of(st.none(), st.binary(max_size=200)),
)
def test_a_publish_is_paho_s(
    *,
    topic: str,
    length: int,
    version: Version,
    qos: int,
    retain: bool,
    response_topic: str | None,
    correlation: bytes | None,
) -> None:
    client, tap = tapped(version)
    said = None
    if version is Version.V5:
        said = properties(PacketTypes.PUBLISH)
        if response_topic is not None:
            said.ResponseTopic = response_topic
        if correlation is not None:
            said.CorrelationData = correlation
    mid = client.publish(topic, b"x" * length, qos, retain, said).mid
    ours = packets.publish(
        version,
        topic,
        b"x" * length,
        mid=mid if qos else None,
        retain=retain,
        response_topic=response_topic,
        correlation=correlation,
    )
    assert ours == tap.written


@given(
    topics=st.lists(TOPICS, min_size=1, max_size=3), version=VERSIONS, as_published=st.booleans(), qos=st.integers(0, 1)
)
def test_a_subscribe_is_paho_s(topics: list[str], version: Version, *, as_published: bool, qos: int) -> None:
    client, tap = tapped(version)
    filters = [Filter(each, qos, retain_as_published=as_published, no_local=not as_published) for each in topics]
    if version is Version.V5:
        options = SubscribeOptions(qos=qos, noLocal=not as_published, retainAsPublished=as_published)
        _, mid = client.subscribe([(each, options) for each in topics])
    else:
        _, mid = client.subscribe([(each, qos) for each in topics])
    assert mid is not None
    assert packets.subscribe(version, mid, filters) == tap.written


@given(topics=st.lists(TOPICS, min_size=1, max_size=3), version=VERSIONS)
def test_an_unsubscribe_is_paho_s(topics: list[str], version: Version) -> None:
    client, tap = tapped(version)
    _, mid = client.unsubscribe(list(topics))
    assert mid is not None
    assert packets.unsubscribe(version, mid, topics) == tap.written


@given(
    version=VERSIONS,
    username=st.one_of(st.none(), st.just("gate")),
    password=st.one_of(st.none(), st.just("ß" * 100)),
    will=st.one_of(st.none(), st.just(Will("b/line0/availability", b"offline"))),
)
def test_a_connect_is_paho_s(version: Version, username: str | None, password: str | None, will: Will | None) -> None:
    client, tap = tapped(version)
    if username is not None:
        client.username_pw_set(username, password)
    if will is not None:
        client.will_set(will.topic, will.payload, qos=1, retain=True)
    if version is Version.V5:
        client._connect_properties = properties(PacketTypes.CONNECT)
        client._connect_properties.ReceiveMaximum = 64
    client._send_connect(20)
    ours = packets.connect(
        version, "x", keepalive=20, receive_maximum=64, username=username, password=password, will=will
    )
    assert ours == tap.written


def test_an_acknowledgement_names_its_message() -> None:
    assert packets.acknowledge(0x1234) == b"\x40\x02\x12\x34"


def test_what_no_packet_can_hold_is_refused() -> None:
    with pytest.raises(ValueError, match="at most 268435455 bytes, not 268435456"):
        packets._length(packets.LONGEST + 1)


@pytest.mark.parametrize(
    ("number", "written"),
    [(0, "00"), (127, "7f"), (128, "8001"), (16_383, "ff7f"), (16_384, "808001"), (packets.LONGEST, "ffffff7f")],
)
def test_lengths_are_those_of_table_1_1(number: int, written: str) -> None:
    assert packets._length(number).hex() == written
