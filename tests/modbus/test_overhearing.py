"""What others say on the line."""

from __future__ import annotations

import itertools

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lfs10d.modbus.frames import Codec
from lfs10d.modbus.overhearing import PAUSE, Overheard, Overhearing
from lfs10d.modbus.request import ReadRegisters
from tests.support.exchanges import ANSWER, ASCII, REFUSED, RTU, SUM, WIND, framed

REQUEST = RTU.encode(WIND)


def hear(*pieces: tuple[bytes, float], codec: Codec = RTU) -> list[Overheard]:
    overhearing = Overhearing()
    overhearing.listen_to({1: codec, 2: codec if codec is ASCII else RTU})
    return list(overhearing.hear(pieces))


def test_requests_answers_and_exceptions_are_told_in_order() -> None:
    noise = bytes.fromhex("FF 01 07 03")
    assert hear((noise + REQUEST, 1.0), (ANSWER + noise, 1.1), (REFUSED, 1.15)) == [
        Overheard(1, 1.0, REQUEST[:-2], WIND),
        Overheard(1, 1.1, ANSWER[:-2]),
        Overheard(1, 1.15, REFUSED[:-2]),
    ]


@given(st.lists(st.integers(1, len(ANSWER) - 1), max_size=4))
def test_a_frame_in_pieces_is_whole_by_its_last(cuts: list[int]) -> None:
    places = [0, *sorted(set(cuts)), len(ANSWER)]
    pieces = [(ANSWER[a:b], 1.0 + 0.01 * n) for n, (a, b) in enumerate(itertools.pairwise(places))]
    assert hear(*pieces) == [Overheard(1, pieces[-1][1], ANSWER[:-2])]


def test_what_a_pause_cuts_is_no_frame() -> None:
    assert hear((ANSWER[:4], 1.0), (ANSWER[4:], 1.0 + 2 * PAUSE)) == []


@pytest.mark.parametrize(
    "frame",
    [
        RTU.encode(ReadRegisters(9, 1, 2)),  # nobody polls it
        framed("01 06 00 05 00 07"),
        framed("01 03 03 00 05 00"),  # an odd count
        framed("01 03 00 01 00 00"),  # no register at all
        framed("01 03 FF FF 00 02"),
        framed("01 83"),
        framed("01 83 02 00"),
        ANSWER[:-1] + b"X",
    ],
)
def test_anything_else_is_passed_over(frame: bytes) -> None:
    assert hear((frame, 1.0)) == []


def test_each_slave_has_its_own_check() -> None:
    answer = SUM.wrap(ANSWER[:-2])
    assert hear((answer, 1.0), codec=SUM) == [Overheard(1, 1.0, ANSWER[:-2])]
    assert hear((answer, 1.0)) == []
    assert hear((ANSWER, 1.0), codec=SUM) == []


def test_ascii_frames_are_heard_too() -> None:
    assert hear((ASCII.encode(WIND).lower(), 1.0), codec=ASCII) == [Overheard(1, 1.0, REQUEST[:-2], WIND)]


def test_endless_bytes_are_not_kept() -> None:
    overhearing = Overhearing()
    assert list(overhearing.hear([(ANSWER, 0.5)])) == []  # nobody is listened to yet
    overhearing.listen_to({})
    assert list(overhearing.hear([(ANSWER, 0.6)])) == []
    overhearing.listen_to({1: RTU})
    assert list(overhearing.hear((bytes(100), 1.0 + 0.01 * n) for n in range(200))) == []
    assert list(overhearing.hear([(ANSWER, 3.01)])) == [Overheard(1, 3.01, ANSWER[:-2])]


def test_frames_right_behind_each_other_and_behind_half_a_one_are_all_heard() -> None:
    assert [each.body for each in hear((ANSWER[:7] + REQUEST + ANSWER + REFUSED + ANSWER[:2], 1.0))] == [
        REQUEST[:-2],
        ANSWER[:-2],
        REFUSED[:-2],
    ]


def test_noise_in_ascii_is_passed_over() -> None:
    noise = b"\n:01\r\nxx" + ASCII.encode(ReadRegisters(9, 1, 2)) + framed("010600050007", ASCII) + b":0103:"
    assert hear((noise + ASCII.encode(WIND)[1:], 1.0), codec=ASCII) == [Overheard(1, 1.0, REQUEST[:-2], WIND)]


def test_what_looks_like_a_head_inside_a_frame_is_data() -> None:
    frame = framed("0103040103040A")
    assert [each.body for each in hear((frame + ANSWER, 1.0))] == [frame[:-2], ANSWER[:-2]]


@pytest.mark.parametrize(("function", "answer"), [(1, "01 01 01 05"), (2, "01 02 02 FF 01")])
def test_bits_that_another_master_reads_are_overheard_too(function: int, answer: str) -> None:
    request = ReadRegisters(1, 3, 9, function)
    body = bytes.fromhex(answer)
    assert hear((RTU.encode(request), 1.0), (RTU.wrap(body), 1.02)) == [
        Overheard(1, 1.0, RTU.encode(request)[:-2], request),
        Overheard(1, 1.02, body),
    ]


def test_more_bits_than_one_read_brings_are_no_request() -> None:
    assert hear((framed("01 01 00 00 07 D1"), 1.0)) == []
    assert hear((framed("01 03 00 00 00 7E"), 1.0)) == []
