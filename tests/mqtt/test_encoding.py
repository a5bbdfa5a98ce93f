"""Payloads become strict, compact JSON, and the size on the wire is known before it is sent."""

from __future__ import annotations

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st
from paho.mqtt.client import Client
from paho.mqtt.enums import CallbackAPIVersion, MQTTProtocolVersion
from paho.mqtt.packettypes import PacketTypes
from paho.mqtt.properties import Properties

from lfs10d.mqtt.encoding import array, encode, packet_size
from lfs10d.mqtt.settings import Version


def test_an_object_is_compact_json() -> None:
    assert encode({"a": 1, "b": [None, 12.99]}) == b'{"a":1,"b":[null,12.99]}'


def test_a_bare_word_stays_bare() -> None:
    assert encode("online") == b"online"


def test_nothing_is_no_byte() -> None:
    assert encode(None) == b""


def test_text_is_utf_8() -> None:
    assert encode({"label": "Höhe 10 m"}) == '{"label":"Höhe 10 m"}'.encode()


def test_text_that_is_no_unicode_becomes_question_marks() -> None:
    assert encode({"label": "a\ud800b"}) == b'{"label":"a?b"}'


@pytest.mark.parametrize("number", [float("nan"), float("inf"), float("-inf")])
def test_what_json_does_not_have_is_refused(number: float) -> None:
    with pytest.raises(ValueError, match="not JSON compliant"):
        encode({"wind_speed": number})


@given(st.lists(st.dictionaries(st.text(max_size=3), st.integers(), max_size=3), max_size=5))
def test_a_batch_of_encoded_elements_is_the_encoded_batch(elements: list[dict[str, object]]) -> None:
    assert json.loads(array(encode(each) for each in elements)) == elements


class Tap:
    """Stands in for paho's socket and keeps what is written."""

    def __init__(self) -> None:
        self.written = b""

    def send(self, data: bytes) -> int:
        self.written += data
        return len(data)

    def close(self) -> None:
        """Need nothing."""


@given(
    topic=st.text("aß/", min_size=1, max_size=40),
    length=st.one_of(st.integers(0, 300), st.sampled_from([16_000, 16_383, 16_390, 2_097_152])),
    version=st.sampled_from(Version),
    qos=st.sampled_from([0, 1]),
    correlation=st.one_of(st.none(), st.binary(max_size=200)),
)
def test_the_size_is_that_of_the_packet_paho_sends(
    topic: str, length: int, version: Version, qos: int, correlation: bytes | None
) -> None:
    protocol = MQTTProtocolVersion.MQTTv5 if version is Version.V5 else MQTTProtocolVersion.MQTTv311
    client = Client(CallbackAPIVersion.VERSION2, "x", protocol=protocol)
    tap = Tap()
    client._sock = tap  # type: ignore[assignment]  # the only way to see paho's bytes without a broker
    properties = None
    if version is Version.V5 and correlation is not None:
        properties = Properties(PacketTypes.PUBLISH)  # type: ignore[no-untyped-call]  # paho leaves it untyped
        properties.CorrelationData = correlation
    client.publish(topic, b"x" * length, qos, properties=properties)
    size = packet_size(topic, b"x" * length, version=version, qos=qos, correlation=correlation)
    assert size == len(tap.written)
