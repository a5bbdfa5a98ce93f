"""Frames of the line as they are told on `trace`."""

from __future__ import annotations

import json
from typing import Any, cast

import pytest

from lfs10d.facts import Instant
from lfs10d.modbus.frames import Checksum, Codec, Framing
from lfs10d.outbound import check
from lfs10d.reading import Errand, Exchanged, FaultCode
from lfs10d.tracing import LONGEST, Trace

NOW = Instant(100.0, 1_795_298_000.0, "synced")
RTU = Codec(Framing.RTU)
READ_WIND = bytes.fromhex("01 03 00 01 00 02 95 CB")
ANSWER = bytes.fromhex("01 03 04 41 4F D7 0A 00 2F")


def exchange(
    sent: bytes = READ_WIND, heard: bytes = ANSWER, *, began: float | None = 99.9, gap: float | None = 0.00365
) -> Exchanged:
    fault = None if heard else FaultCode.TIMEOUT
    return Exchanged(99.95, 99.8, began, gap, 1, Errand.POLL, fault, sent, heard)


def told(what: Exchanged, codec: Codec = RTU, **codecs: Codec) -> list[dict[str, Any]]:
    """Return the payloads; each is as the documentation promises."""
    trace = Trace(200.0, {int(key.removeprefix("slave_")): value for key, value in codecs.items()}, codec)
    published = trace.told(what, NOW)
    for each in published:
        assert (each.topic, each.retain, each.qos) == ("trace", False, 0)
        check(each.topic, json.dumps(each.payload))
    return [cast("dict[str, Any]", each.payload) for each in published]


def test_an_exchange_is_what_we_sent_and_what_came_back_in_words() -> None:
    assert told(exchange()) == [
        {
            "v": 1,
            "ts": 1_795_297_999_900,
            "direction": "tx",
            "gap_us": 3650.0,
            "hex": "01 03 00 01 00 02 95 CB",
            "text": "read 2 registers at 0x0001 of slave 1",
        },
        {
            "v": 1,
            "ts": 1_795_297_999_950,
            "direction": "rx",
            "gap_us": None,
            "hex": "01 03 04 41 4F D7 0A 00 2F",
            "text": "slave 1 answers 414F D70A",
        },
    ]


def test_where_nothing_came_back_only_what_we_sent_is_told() -> None:
    assert [each["direction"] for each in told(exchange(heard=b""))] == ["tx"]


def test_where_the_line_never_fell_silent_only_what_was_heard_is_told() -> None:
    (frame,) = told(exchange(heard=b"\x00\xff\x1b[2J", began=None, gap=None))
    assert (frame["direction"], frame["hex"], frame["text"]) == ("rx", "00 FF 1B 5B 32 4A", "6 bytes of no frame")


def test_a_silence_that_was_not_measured_is_null() -> None:
    assert told(exchange(gap=None))[0]["gap_us"] is None


def test_frames_are_read_by_the_codec_of_their_slave() -> None:
    summed = bytes.fromhex("01 06 20 00 00 01 00 28")
    assert told(exchange(summed, b""))[0]["text"] == "8 bytes of no frame"
    (frame,) = told(exchange(summed, b""), slave_1=Codec(Framing.RTU, Checksum.SUM))
    assert frame["text"] == "write 0x0001 to 0x2000 of slave 1"


@pytest.mark.parametrize("more", [0, 1, 50_000])
def test_of_a_babble_only_the_beginning_is_told(more: int) -> None:
    (frame,) = told(exchange(heard=bytes(LONGEST + more), began=None))
    assert len(frame["hex"].split()) == LONGEST
    assert frame["text"].endswith(f"; {more} bytes more") is (more > 0)
