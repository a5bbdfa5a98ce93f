"""Answers that are wrong, late, broken, noisy or refused, at their rate."""

from __future__ import annotations

import math
import struct
from collections.abc import Callable
from itertools import pairwise

import pytest

from lfs10d.profiles.profile import Profile
from lfs10d.simulator.blueprint import blueprint_of
from lfs10d.simulator.sensor import Sensor
from lfs10d.simulator.wire import unseal
from tests.support.faulty_sensors import add_fault, believable
from tests.support.sensor_values import ID, Maker, wind_in


@pytest.mark.parametrize(
    ("kind", "holds"),
    [
        ("nan", math.isnan),
        ("infinite", math.isinf),
        ("out_of_range", lambda speed: speed == 1e6),
        ("subnormal", lambda speed: 0 < speed < 1e-40),
    ],
)
def test_a_broken_value_is_sent_as_such(bench: Maker, kind: str, holds: Callable[[float], bool]) -> None:
    line = bench(Sensor(1))
    add_fault(line.line.sensor(1), kind)
    assert holds(wind_in(line.read(1)))
    assert line.answer.values == ()


def test_a_stuck_sensor_repeats_its_value(bench: Maker) -> None:
    line = bench(Sensor(1))
    add_fault(line.line.sensor(1), "stuck")
    assert wind_in(line.read(1)) == wind_in(line.read(1))


def test_a_refusal_has_the_code_it_was_given(bench: Maker) -> None:
    line = bench(Sensor(1))
    add_fault(line.line.sensor(1), "exception", code=6)
    assert line.read(1) == bytes.fromhex("01 83 06")


@pytest.mark.parametrize(
    ("kind", "particulars", "first"),
    [
        ("wrong_id", {}, "02 03 04"),
        ("wrong_id", {"value": 77}, "4D 03 04"),
        ("wrong_function", {}, "01 04 04"),
        ("wrong_count", {}, "01 03 06"),
        ("wrong_echo", {}, "01 03 04"),
    ],
)
def test_a_wrong_answer_has_a_right_check(bench: Maker, kind: str, particulars: dict[str, int], first: str) -> None:
    line = bench(Sensor(1))
    add_fault(line.line.sensor(1), kind, **particulars)
    body = line.read(1)
    assert body is not None
    assert body[:3] == bytes.fromhex(first)
    assert len(body) == 3 + body[2]
    assert not believable(line.answer)


def test_a_wrong_echo_carries_another_value(bench: Maker) -> None:
    line = bench(Sensor(1))
    add_fault(line.line.sensor(1), "wrong_echo")
    add_fault(line.line.sensor(1), "wrong_count")
    assert line.write(1, ID, 1) == bytes.fromhex("01 06 00 05 00 00")


@pytest.mark.parametrize("framing", ["rtu", "ascii"])
def test_a_noisy_answer_never_passes_its_check(bench: Maker, framing: str) -> None:
    line = bench(Sensor(1, framing=framing), framing=framing)  # type: ignore[arg-type]  # a literal
    add_fault(line.line.sensor(1), "noisy")
    for _ in range(200):
        assert line.read(1) is None
        assert line.heard
    assert not believable(line.answer)


@pytest.mark.parametrize(
    ("kind", "particulars", "lengths"),
    [
        ("garbage", {}, {9}),
        ("garbage", {"length": 30}, {30}),
        ("truncated", {"length": 4}, {4}),
        ("truncated", {}, set(range(1, 9))),
    ],
)
def test_a_spoilt_answer_has_the_length_it_was_given(
    bench: Maker, kind: str, particulars: dict[str, int], lengths: set[int]
) -> None:
    line = bench(Sensor(1))
    add_fault(line.line.sensor(1), kind, **particulars)
    seen = set()
    for _ in range(100):
        assert line.read(1) is None
        seen.add(len(line.heard))
    assert seen == lengths


@pytest.mark.parametrize(("kind", "part"), [("leading_noise", slice(5, None)), ("trailing_noise", slice(9))])
def test_noise_around_an_answer_leaves_it_whole(bench: Maker, kind: str, part: slice) -> None:
    line = bench(Sensor(1))
    add_fault(line.line.sensor(1), kind, length=5)
    line.read(1)
    assert len(line.heard) == 14
    assert unseal(line.heard[part]) is not None
    assert believable(line.answer)


def test_a_late_answer_comes_into_the_next_request(bench: Maker) -> None:
    line = bench(Sensor(1), Sensor(2))
    add_fault(line.line.sensor(1), "late", delay=0.2)
    assert line.read(1, wait=0.1) is None
    assert line.read(2, wait=0.05) is not None
    line.listen(0.1)
    assert unseal(line.heard) is not None
    assert believable(line.line.log[0].answers[0])


def test_bytes_can_come_with_pauses(bench: Maker) -> None:
    line = bench(Sensor(1))
    add_fault(line.line.sensor(1), "slow_bytes", delay=0.002)
    line.read(1)
    ends = line.answer.burst.ends
    assert {after - before for before, after in pairwise(ends)} <= {3_041_666, 3_041_667}


def test_a_fault_shows_at_its_rate(bench: Maker) -> None:
    line = bench(Sensor(1))
    add_fault(line.line.sensor(1), "silent", 0.3)
    answers = sum(line.id_of(1) is not None for _ in range(300))
    assert 170 < answers < 250


def built(*values: dict[str, object], **keys: object) -> Sensor:
    """Return a device of a profile with these values, at slave id 1."""
    profile = {"name": "any", "title": "Any device", "values": list(values), **keys}
    return Sensor(1, blueprint=blueprint_of(Profile.model_validate(profile)))


@pytest.mark.parametrize(
    ("nothing", "sent"),
    [
        pytest.param(0xFF, 0x00FF, id="a content of the part alone is in its bits"),
        pytest.param(0xFFFF, 0xFFFF, id="what no part can hold fills the register"),
    ],
)
def test_a_part_of_a_register_says_that_it_has_no_value(bench: Maker, nothing: int, sent: int) -> None:
    part = {"name": "a", "register": 7, "type": "uint16", "unit": "x", "bits": [0, 7], "unavailable": [nothing]}
    sensor = built(part)
    add_fault(sensor, "unavailable", values=("a",))
    assert bench(sensor).read(1, 7, 1) == struct.pack(">BBBH", 1, 3, 2, sent)


def test_registers_that_a_profile_may_skip_are_there(bench: Maker) -> None:
    values = [{"name": name, "register": at, "type": "uint16", "unit": "x"} for name, at in (("a", 7), ("b", 9))]
    assert bench(built(*values, may_skip=1)).read(1, 8, 1) == struct.pack(">BBBH", 1, 3, 2, 0)
    assert bench(built(*values)).read(1, 8, 1) == bytes((1, 0x83, 2))


def test_whatever_a_read_may_span_is_there_though_the_profiles_own_reads_end_elsewhere(bench: Maker) -> None:
    """Without the first of them, three values of which two fit into a read are read as one and two."""
    plain = {"type": "uint16", "unit": "x"}
    values = [{"name": name, "register": at} | plain for name, at in (("a", 4), ("b", 6), ("c", 8), ("d", 12))]
    line = bench(built(*values, {"name": "e", "register": 5, "function": 4} | plain, may_skip=1, max_words=3))
    assert line.read(1, 6, 3) is not None
    assert [line.read(1, at, 1) for at in (10, 11)] == [bytes((1, 0x83, 2))] * 2


def test_a_part_without_a_value_leaves_the_rest_of_its_register_alone(bench: Maker) -> None:
    low = {"name": "a", "register": 7, "type": "uint16", "unit": "x", "bits": [0, 7], "unavailable": [0xFFFF]}
    sensor = built(low, {"name": "b", "register": 7, "type": "uint16", "unit": "x", "bits": [10, 14]})
    sensor.words[7] = 0x8000
    add_fault(sensor, "unavailable", values=("a",))
    line = bench(sensor)
    assert line.read(1, 7, 1) == bytes((1, 3, 2, 0xFF, 0xFF))
    assert dict(line.answer.measured) == {"a": None, "b": None}  # all ones do not say what b measures
    sensor.faults = [one for one in sensor.faults if one.kind != "unavailable"]
    answer = line.read(1, 7, 1)
    assert answer is not None
    assert (answer[3] & 0x83, dict(line.answer.measured)["b"]) == (0x80, answer[3] >> 2 & 31)
    assert dict(line.answer.measured)["a"] == answer[4]


def test_two_parts_of_a_long_content_do_not_overwrite_each_other(bench: Maker) -> None:
    long = {"register": 7, "type": "uint32", "unit": "x", "word_order": "low_first", "byte_order": "little"}
    line = bench(built({"name": "a", "bits": [4, 20]} | long, {"name": "b", "bits": [21, 31]} | long))
    answer = line.read(1, 7, 2)
    assert answer is not None
    content = int.from_bytes(answer[3:7], "little")
    assert dict(line.answer.measured) == {"a": content >> 4 & 0x1FFFF, "b": content >> 21}
