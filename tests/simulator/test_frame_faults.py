"""Replies as faults leave them."""

from __future__ import annotations

from random import Random

import pytest

from lfs10d.simulator.faults import FaultKind
from lfs10d.simulator.frame_faults import broken_float, distorted, spoilt
from tests.support.faulty_sensors import sensor_fault

READ = bytes((3, 3, 4, 65, 32, 0, 0))
WRITE = bytes((3, 6, 0, 5, 0, 7))


def drawn(seed: int) -> Random:
    return Random(seed)  # noqa: S311 - repeatable faults, no secret


@pytest.mark.parametrize(
    ("kind", "value", "body", "expected"),
    [
        ("wrong_id", None, READ, bytes((4,)) + READ[1:]),
        ("wrong_id", 9, READ, bytes((9,)) + READ[1:]),
        ("wrong_function", None, READ, bytes((3, 4)) + READ[2:]),
        ("wrong_count", None, READ, bytes((3, 3, 6)) + READ[3:] + READ[-2:]),
        ("wrong_count", None, WRITE, WRITE),
        ("wrong_echo", None, WRITE, WRITE[:-1] + bytes((6,))),
        ("wrong_echo", None, READ, READ),
        ("noisy", None, READ, READ),
    ],
)
def test_a_body_is_wrong_in_the_way_of_its_fault(kind: str, value: int | None, body: bytes, expected: bytes) -> None:
    fault = sensor_fault(kind, value=value)
    assert distorted(body, {fault.kind: fault}) == expected


@pytest.mark.parametrize(
    ("kind", "length", "lengths"),
    [("garbage", None, {7}), ("garbage", 3, {3}), ("truncated", 2, {2}), ("truncated", None, set(range(1, 7)))],
)
def test_a_frame_is_cut_or_replaced(kind: str, length: int | None, lengths: set[int]) -> None:
    fault = sensor_fault(kind, length=length)
    assert {len(spoilt(READ, {fault.kind: fault}, drawn(seed), "rtu")) for seed in range(99)} == lengths


@pytest.mark.parametrize(("kind", "part"), [("leading_noise", slice(3, None)), ("trailing_noise", slice(0, -3))])
def test_noise_beside_a_frame_leaves_it_whole(kind: str, part: slice) -> None:
    fault = sensor_fault(kind)
    frame = spoilt(READ, {fault.kind: fault}, drawn(1), "rtu")
    assert len(frame) == len(READ) + 3
    assert frame[part] == READ


def test_one_bit_of_a_noisy_frame_is_flipped() -> None:
    fault = sensor_fault("noisy")
    frames = [spoilt(READ, {fault.kind: fault}, drawn(seed), "rtu") for seed in range(20)]
    flipped = {sum((one ^ other).bit_count() for one, other in zip(READ, frame, strict=True)) for frame in frames}
    assert flipped == {1}


def test_a_value_is_broken_by_its_kind_alone() -> None:
    fault = sensor_fault("nan")
    assert broken_float({}) is None
    assert broken_float({FaultKind.STUCK: sensor_fault("stuck")}) is None
    assert broken_float({fault.kind: fault}) == 0x7FC0_0000
