"""The data files on the wire: printed frames of the makers' documents, and simulated devices that play them."""

from __future__ import annotations

from dataclasses import replace
from itertools import product
from pathlib import Path

import pytest

from lfs10d.modbus.frames import Checksum, Codec, Framing
from lfs10d.modbus.request import ReadRegisters, Request, WriteRegister
from lfs10d.profiles.library import builtin_names, load_profile
from lfs10d.profiles.profile import ChecksumName, FramingName, Profile
from lfs10d.reading import Fault, Number
from lfs10d.simulator.blueprint import blueprint_of
from lfs10d.simulator.sensor import Sensor
from lfs10d.simulator.wire import unseal

RTU = Codec(Framing.RTU)
SUM = Codec(Framing.RTU, Checksum.SUM)
ASCII = Codec(Framing.ASCII)

ROOT = Path(__file__).parents[2]
DEVICES = [*builtin_names(), "config/profiles/wind-vane.yaml"]


def load(name: str) -> Profile:
    return load_profile(name, relative_to=ROOT)


SPOKEN = [
    (name, framing, checksum)
    for name in DEVICES
    for framing, checksum in product(load(name).framings, load(name).checksums)
]


def polled(profile: Profile, codec: Codec, answers: list[bytes]) -> dict[str, object]:
    """Return the values of one poll from the frames that answered it."""
    numbers: dict[str, object] = {}
    for block, answer in zip(profile.reads(), answers, strict=True):
        body = codec.unwrap(answer)
        assert body is not None
        values = block.decode(codec.decode(body))
        assert not isinstance(values, Fault)
        numbers |= values
    return numbers


@pytest.mark.parametrize(
    ("name", "codec", "request_frame", "answer", "values"),
    [
        ("lfs10", RTU, "010300010002 95CB", "010304414FD70A 002F", {"wind_speed": 12.99}),
        ("ld-e", RTU, "010310040002 810A", "010304D0F50000 D2C1", {"displacement": 53493}),
    ],
)
def test_a_poll_is_the_frame_that_the_document_prints(
    name: str, codec: Codec, request_frame: str, answer: str, values: dict[str, Number]
) -> None:
    profile = load(name)
    (block,) = profile.reads()
    request = ReadRegisters(1, block.address, block.count, block.function)
    assert codec.encode(request) == bytes.fromhex(request_frame)
    assert polled(profile, codec, [bytes.fromhex(answer)]) == values


def test_the_laser_is_polled_in_ascii_as_its_manual_prints() -> None:
    profile = load("ld-e")
    (block,) = profile.reads()
    assert ASCII.encode(ReadRegisters(1, block.address, block.count, block.function)) == b":010310040002E6\r\n"
    assert polled(profile, ASCII, [b":010304D0F5000033\r\n"]) == {"displacement": 53493}


def test_the_laser_is_written_as_its_manual_prints_but_with_the_right_check() -> None:
    (setting,) = load("ld-e").settings
    assert setting.refusal(1) is None
    request = WriteRegister(1, setting.register, 1)
    assert RTU.encode(request) == bytes.fromhex("010610000001 4CCA")
    assert ASCII.encode(request) == b":010610000001E8\r\n"


def test_the_barrier_of_the_eh600_is_the_read_that_its_manual_prints() -> None:
    barrier = load("eh600").barrier
    assert barrier is not None
    request = ReadRegisters(1, barrier.register, barrier.count, barrier.function)
    assert RTU.encode(request) == bytes.fromhex("0103F0020002 56CB")


def test_the_eh600_with_the_other_check_is_asked_with_the_sum_of_the_bytes() -> None:
    profile = load("eh600")
    block = profile.reads()[0]
    request = ReadRegisters(1, block.address, block.count, block.function)
    assert SUM.encode(request) == bytes.fromhex("010310010001 0016")


GOLDEN = [
    ("lfs10", RTU, ReadRegisters(1, 0x0001, 2), "010300010002 95CB", "010304414FD70A 002F", (0x414F, 0xD70A)),
    ("lfs10", RTU, WriteRegister(1, 0x0004, 2), "010600040002 49CA", "010600040002 49CA", (2,)),
    ("ld-e", RTU, ReadRegisters(1, 0x1004, 2), "010310040002 810A", "010304D0F50000 D2C1", (0xD0F5, 0)),
    ("ld-e", ASCII, ReadRegisters(1, 0x1004, 2), b":010310040002E6", b":010304D0F5000033", (0xD0F5, 0)),
    ("ld-e", RTU, WriteRegister(1, 0x1000, 1), "010610000001 4CCA", "010610000001 4CCA", (1,)),
    ("ld-e", ASCII, WriteRegister(1, 0x1000, 1), b":010610000001E8", b":010610000001E8", (1,)),
    ("fuling-dzb", RTU, ReadRegisters(1, 0x0004, 2), "010300040002 85CA", "01030400000000 FA33", (0, 0)),
    ("fuling-dzb", ASCII, ReadRegisters(1, 0x0004, 2), b":010300040002F6", b":01030400000000F8", (0, 0)),
    ("eh600", RTU, ReadRegisters(1, 0xF002, 2), "0103F0020002 56CB", "01030400000000 FA33", (0, 0)),
    ("eh600", SUM, ReadRegisters(1, 0xF002, 2), "0103F0020002 00F8", "01030400000000 0008", (0, 0)),
    ("eh600", RTU, WriteRegister(2, 0xF00B, 5000), "0206F00B1388 C66D", "0206F00B1388 C66D", (5000,)),
    ("eh600", SUM, WriteRegister(2, 0xF00B, 5000), "0206F00B1388 019E", "0206F00B1388 019E", (5000,)),
    (
        "ecowitt-wn90lp",
        RTU,
        ReadRegisters(0x90, 0x0165, 9),
        "900301650009 88AE",
        "90031206E7000D0296003C0000000000960000271A 6062",
        (1767, 13, 662, 60, 0, 0, 150, 0, 10010),
    ),
    ("renke-rs-fsjt", RTU, ReadRegisters(1, 0x0000, 1), "010300000001 840A", "0103020020 B99C", (32,)),
    ("renke-rs-fxjt", RTU, ReadRegisters(1, 0x0000, 2), "010300000002 C40B", "0103040002005A DBC8", (2, 90)),
    ("pr-3000-fsjt", RTU, ReadRegisters(1, 0x0000, 1), "010300000001 840A", "0103020020 B99C", (32,)),
    ("dfrobot-sen0482", RTU, ReadRegisters(2, 0x0000, 2), "020300000002 C438", "020304028F0003 B961", (655, 3)),
    ("dfrobot-sen0483", RTU, ReadRegisters(2, 0x0000, 1), "020300000001 8439", "0203020025 3D9F", (37,)),
]
"""Frames of the makers' documents, with the check of each framing that the device speaks."""


@pytest.mark.parametrize(("name", "codec", "request_", "asked", "answered", "content"), GOLDEN)
def test_every_frame_of_the_documents_is_made_and_understood(
    name: str, codec: Codec, request_: Request, asked: str | bytes, answered: str | bytes, content: tuple[int, ...]
) -> None:
    profile = load(name)
    assert codec.framing.value in profile.framings
    assert codec.framing is Framing.ASCII or codec.checksum.value in profile.checksums
    frames = [bytes.fromhex(each) if isinstance(each, str) else each + b"\r\n" for each in (asked, answered)]
    assert codec.encode(request_) == frames[0]
    assert codec.answer_size(request_) == len(frames[1])
    body = codec.unwrap(frames[1])
    assert body is not None
    assert codec.decode(body) == content


def test_the_golden_frames_cover_every_device_in_every_framing_and_check() -> None:
    seen = {(name, codec.framing.value, codec.checksum.value) for name, codec, *_ in GOLDEN}
    assert {spoken for spoken in SPOKEN if spoken[0] in builtin_names()} <= seen


@pytest.mark.parametrize(("name", "framing", "check"), SPOKEN)
def test_a_simulated_device_is_polled_to_the_values_it_means(
    name: str, framing: FramingName, check: ChecksumName
) -> None:
    profile = load(name)
    codec = Codec(Framing(framing), Checksum(check))
    blueprint = replace(blueprint_of(profile), check=check)
    sensor = Sensor(7, blueprint=blueprint, framing=framing, source=lambda _now: 10.0)
    answers = []
    for block in profile.reads():
        request = ReadRegisters(7, block.address, block.count, block.function)
        asked = unseal(codec.encode(request), framing, check)
        assert asked is not None
        reply = sensor.hear(asked, 0)
        assert reply is not None
        assert len(reply.data) == codec.answer_size(request)
        answers.append(reply.data)
    meant = {signal.name: signal.settled(signal.fitted(10.0)) for signal in blueprint.signals}
    assert polled(profile, codec, answers) == meant


@pytest.mark.parametrize(("name", "framing", "check"), [each for each in SPOKEN if load(each[0]).barrier])
def test_the_answer_to_a_barrier_has_a_length_that_no_poll_has(
    name: str, framing: FramingName, check: ChecksumName
) -> None:
    profile = load(name)
    codec = Codec(Framing(framing), Checksum(check))
    assert profile.barrier is not None
    sizes = {codec.answer_size(ReadRegisters(1, b.address, b.count, b.function)) for b in profile.reads()}
    barrier = ReadRegisters(1, profile.barrier.register, profile.barrier.count, profile.barrier.function)
    assert codec.answer_size(barrier) not in sizes
