"""Frames of the line as they are told on `trace`."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, cast

import pytest

from docs.generate.contract import check
from lfs10d.commands.trace import LONGEST, FrameTrace, TracedDevice
from lfs10d.modbus.frames import Checksum, Codec, Framing
from lfs10d.profiles.library import load_profile
from lfs10d.profiles.profile import Profile
from lfs10d.reading import Exchanged, FaultCode, Purpose
from lfs10d.system.clock import Instant

NOW = Instant(100.0, 1_795_298_000.0, "synced")
RTU = Codec(Framing.RTU)
LFS10 = load_profile("lfs10", relative_to=Path())
MAST = TracedDevice("mast-top", RTU, LFS10)
READ_WIND = bytes.fromhex("01 03 00 01 00 02 95 CB")
ANSWER = bytes.fromhex("01 03 04 41 4F D7 0A 00 2F")


def exchange(
    sent: bytes = READ_WIND, heard: bytes = ANSWER, *, began: float | None = 99.9, gap: float | None = 0.00365
) -> Exchanged:
    fault = None if heard else FaultCode.TIMEOUT
    return Exchanged(99.95, 99.8, began, gap, 1, Purpose.POLL, fault, sent, heard)


def told(what: Exchanged, device: TracedDevice | None = None) -> list[dict[str, Any]]:
    """Return the payloads; each is as the documentation promises. `device` is that of slave 1."""
    trace = FrameTrace(200.0, {} if device is None else {1: device}, RTU)
    published = trace.publications(what, NOW)
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
    (frame,) = told(exchange(summed, b""), TracedDevice("motor", Codec(Framing.RTU, Checksum.SUM), LFS10))
    assert frame["text"] == "motor: write 0x0001 to 0x2000 of slave 1"


def texts(sent: str, heard: str, device: TracedDevice, fault: FaultCode | None = None) -> list[str]:
    """Return what is told of an exchange whose frames, their checks left out, are these."""
    asked, answered = (device.codec.wrap(bytes.fromhex(each)) for each in (sent, heard))
    what = Exchanged(99.95, 99.8, 99.9, None, 1, Purpose.POLL, fault, asked, answered)
    return [each["text"] for each in told(what, device)]


@pytest.mark.parametrize("codec", [RTU, Codec(Framing.ASCII)])
def test_a_value_stands_beside_its_frame_under_the_name_of_the_device(codec: Codec) -> None:
    mast = TracedDevice("mast-top", codec, LFS10)
    assert texts("01 03 00 01 00 02", "01 03 04 41 4F D7 0A", mast) == [
        "mast-top: read 2 registers at 0x0001 of slave 1",
        "mast-top: slave 1 answers 414F D70A: wind_speed 12.99 m/s",
    ]
    assert texts("01 03 00 05 00 01", "01 03 02 00 01", mast)[1] == (
        "mast-top: slave 1 answers 0001: its slave id is 1"
    )


def test_a_bare_number_has_no_unit() -> None:
    value = {"name": "count", "register": 1, "type": "uint16", "unit": "1"}
    counter = Profile.model_validate({"name": "counter", "title": "Counter", "values": [value]})
    heard = texts("01 03 00 01 00 01", "01 03 02 00 07", TracedDevice("gate", RTU, counter))[1]
    assert heard == "gate: slave 1 answers 0007: count 7"


def test_a_value_that_cannot_be_is_told_as_that() -> None:
    (_, heard) = texts("01 03 00 01 00 02", "01 03 04 7F C0 00 00", MAST)
    assert heard.startswith("mast-top: slave 1 answers 7FC0 0000: wind_speed")
    assert "m/s" not in heard


@pytest.mark.parametrize(
    ("sent", "heard", "fault"),
    [
        ("01 03 00 01 00 02", "01 03 04 41 4F D7 0A", FaultCode.LATE),
        ("01 03 00 01 00 02", "01 83 02", FaultCode.EXCEPTION),
        ("01 03 00 20 00 02", "01 03 04 41 4F D7 0A", None),
        ("01 03 00 01 00 02", "01 03 02 41 4F", None),
        ("01 06 00 05 00 02", "01 06 00 05 00 02", None),
        ("01 08 00 00 00 02 00", "01 08 00 00 00 02 00", None),
    ],
)
def test_what_is_no_good_answer_of_a_value_is_told_without_one(sent: str, heard: str, fault: FaultCode | None) -> None:
    assert not any("wind_speed" in text or "slave id is" in text for text in texts(sent, heard, MAST, fault))


def test_of_two_frames_that_could_be_the_answer_neither_is_shown_as_a_value() -> None:
    (_, frame) = told(exchange(heard=ANSWER + ANSWER), MAST)
    assert frame["text"] == "mast-top: slave 1 answers 414F D70A; slave 1 answers 414F D70A"


@pytest.mark.parametrize("more", [0, 1, 50_000])
def test_of_a_babble_only_the_beginning_is_told(more: int) -> None:
    (frame,) = told(exchange(heard=bytes(LONGEST + more), began=None))
    assert len(frame["hex"].split()) == LONGEST
    assert frame["text"].endswith(f"; {more} bytes more") is (more > 0)
