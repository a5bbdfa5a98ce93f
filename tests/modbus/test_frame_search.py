"""Frames are found through noise, at every offset, in any pieces."""

from __future__ import annotations

from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lfs10d.modbus.frame_search import KEPT, ExpectedFrame, FoundFrame, FrameSearch
from lfs10d.modbus.frames import Codec, Framing
from lfs10d.modbus.request import ReadRegisters

RTU = Codec(Framing.RTU)
NORMAL, EXCEPTION = RTU.shapes(ReadRegisters(1, 0x0001, 2))
ANSWER = bytes.fromhex("010304414FD70A002F")
BROKEN = bytes.fromhex("010304414FD70A0030")


def fed(*pieces: bytes) -> tuple[FrameSearch, ExpectedFrame, FoundFrame | None]:
    """Feed pieces at 0, 1, 2 ... s; return what was caught first."""
    search, expected, caught = FrameSearch(), ExpectedFrame(RTU, NORMAL), None
    for now, piece in enumerate(pieces):
        search.feed(piece, float(now))
        caught = caught or search.seek(expected)
    return search, expected, caught


def test_a_frame_is_caught_the_moment_it_is_whole() -> None:
    search, expected, caught = fed(ANSWER[:-1])
    assert caught is None
    assert expected.partial
    search.feed(ANSWER[-1:], 7.0)
    assert search.seek(expected) == FoundFrame(ANSWER[:-2], 0, 9, 0.0, 7.0)


def test_a_frame_that_came_in_part_is_caught_when_the_rest_comes_in_pieces() -> None:
    search, expected, caught = fed(ANSWER[:4], ANSWER[4:6])
    assert caught is None
    assert expected.partial
    search.feed(ANSWER[6:], 7.0)
    assert search.seek(expected) == FoundFrame(ANSWER[:-2], 0, 9, 0.0, 7.0)


@given(st.binary(max_size=40), st.binary(max_size=40), st.lists(st.integers(0, 89), max_size=6))
def test_noise_and_pieces_hide_no_frame(before: bytes, after: bytes, cuts: list[int]) -> None:
    stream = before + ANSWER + after
    places = [0, *sorted(min(cut, len(stream)) for cut in cuts), len(stream)]
    pieces = [stream[begin:end] for begin, end in pairwise(places)]
    _, _, caught = fed(*pieces)
    assert caught is not None
    assert caught.body == ANSWER[:-2]


def test_a_false_beginning_does_not_hide_the_frame() -> None:
    _, expected, caught = fed(ANSWER[:3] + ANSWER)
    assert caught is not None
    assert (caught.begin, caught.end, expected.start) == (3, 12, 12)


def test_a_frame_with_a_wrong_check_counts_as_begun_only() -> None:
    search, expected, caught = fed(BROKEN)
    assert caught is None
    assert search.begins(expected)


@pytest.mark.parametrize(("tail", "begins"), [("01", False), ("0103", True), ("010302", False), ("000103", True)])
def test_slave_and_function_at_the_end_are_a_beginning(tail: str, *, begins: bool) -> None:
    search, expected, _ = fed(bytes.fromhex(tail))
    assert search.begins(expected) is begins


def test_what_came_before_the_start_is_not_looked_at() -> None:
    search, expected, _ = fed(b"\x00" * 3)
    expected.skip(5)
    expected.skip(4)
    assert expected.start == 5
    search.feed(b"\x01\x01" + ANSWER, 1.0)
    caught = search.seek(expected)
    assert caught is not None
    assert caught.begin == 5


def test_first_and_last_byte_have_their_own_times() -> None:
    _, _, caught = fed(b"\x00" + ANSWER[:1], ANSWER[1:5], ANSWER[5:])
    assert caught is not None
    assert (caught.first_at, caught.last_at) == (0.0, 2.0)


def test_a_frame_is_claimed_where_one_byte_of_it_is() -> None:
    search, _, caught = fed(ANSWER)
    assert caught is not None
    assert not search.claimed(caught)
    search.claim(caught)
    assert search.claimed(caught)
    assert search.claimed(FoundFrame(b"", 8, 12, 0.0, 0.0))
    assert not search.claimed(FoundFrame(b"", 9, 12, 0.0, 0.0))


def test_claimed_frames_are_explained() -> None:
    search, expected, caught = fed(b"\xaa" + ANSWER + b"\xbb")
    assert caught is not None
    search.claim(caught)
    assert search.unclaimed(0) == b"\xaa\xbb"
    assert search.unclaimed(5) == b"\xbb"
    assert (search.unclaimed_count(0), search.unclaimed_count(5), search.unclaimed_count(10)) == (2, 1, 1)
    search.feed(ANSWER, 1.0)
    again = search.seek(expected)
    assert again is not None
    search.claim(again)
    assert search.unclaimed(0) == b"\xaa\xbb"


def test_long_garbage_is_forgotten_and_the_frame_behind_it_found() -> None:
    pieces = [b"\x01\x03" * 300] * 20
    search, _, caught = fed(*pieces, ANSWER)
    assert caught is not None
    assert caught.begin == 20 * 600
    assert caught.last_at == 20.0
    assert len(search._stream) < 3 * KEPT
    assert len(search.unclaimed(0)) == KEPT
    assert search.unclaimed_count(0) == 20 * 600 + 9


def test_one_huge_piece_is_searched_whole() -> None:
    _, _, caught = fed(b"\x00" * 5000 + ANSWER + b"\x00" * 5000)
    assert caught is not None
    assert caught.begin == 5000


@pytest.mark.parametrize(
    ("heard", "missing"),
    [
        ("", 0),
        ("FF", 0),
        ("01", 8),
        ("0103", 7),
        ("010304", 6),
        ("010304414F", 4),
        ("0183", 3),
        ("018302C0", 1),
        ("010304018302", 2),
        ("FF01", 8),
        ("010304414FD70A002F01", 8),
    ],
)
def test_what_is_missing_is_what_the_soonest_frame_still_needs(heard: str, missing: int) -> None:
    search, normal, exception = FrameSearch(), ExpectedFrame(RTU, NORMAL), ExpectedFrame(RTU, EXCEPTION)
    search.feed(bytes.fromhex(heard), 0.0)
    for expected in (normal, exception):
        search.seek(expected)
    assert search.missing([normal, exception]) == missing


def test_of_two_frames_the_first_is_caught_first() -> None:
    search, expected, caught = fed(ANSWER + ANSWER)
    assert caught is not None
    assert (caught.begin, caught.end) == (0, 9)
    again = search.seek(expected)
    assert again is not None
    assert (again.begin, again.end) == (9, 18)


def test_a_head_that_overlaps_a_false_one_is_found() -> None:
    (normal, _) = RTU.shapes(ReadRegisters(4, 0x0001, 2, 4))
    frame = RTU.wrap(bytes.fromhex("040404414FD70A"))
    search, expected = FrameSearch(), ExpectedFrame(RTU, normal)
    search.feed(b"\x04" + frame, 0.0)
    caught = search.seek(expected)
    assert caught is not None
    assert caught.begin == 1


def test_skipping_ahead_leaves_a_frame_begun_there_and_skipping_on_the_spot_does_not() -> None:
    _, expected, _ = fed(ANSWER[:5])
    expected.skip(expected.start)
    assert expected.partial
    expected.skip(expected.start + 1)
    assert not expected.partial


def test_a_frame_that_spans_what_is_forgotten_keeps_the_time_of_its_first_byte() -> None:
    _, _, caught = fed(b"\xff" * 2 * KEPT, ANSWER[:5], ANSWER[5:])
    assert caught is not None
    assert (caught.first_at, caught.last_at) == (1.0, 2.0)


def test_no_more_is_kept_than_twice_the_least() -> None:
    search = FrameSearch()
    for now in range(100):
        search.feed(b"\xff" * 100, float(now))
        assert len(search._stream) <= 2 * KEPT + 100
    assert search.end == 10_000


def test_frames_side_by_side_do_not_claim_each_other() -> None:
    search, expected, first = fed(ANSWER + ANSWER)
    second = search.seek(expected)
    assert first is not None
    assert second is not None
    search.claim(second)
    assert not search.claimed(first)
    assert search.unclaimed(0) == ANSWER


def test_a_frame_at_the_very_beginning_is_explained_whole() -> None:
    search, _, caught = fed(ANSWER + b"\xff")
    assert caught is not None
    search.claim(caught)
    assert search.unclaimed(0) == b"\xff"


def test_what_lies_around_a_claimed_frame_is_told_though_older_bytes_are_forgotten() -> None:
    search, _, caught = fed(b"\xff" * 3 * KEPT, b"\xfe" * 3, ANSWER, b"\xfd")
    assert caught is not None
    search.claim(caught)
    assert search.unclaimed(3 * KEPT) == b"\xfe\xfe\xfe\xfd"


def test_a_head_that_began_before_the_start_is_no_beginning() -> None:
    search, expected = FrameSearch(), ExpectedFrame(RTU, NORMAL)
    expected.skip(1)
    search.feed(ANSWER[:2], 0.0)
    assert search.seek(expected) is None
    assert not search.begins(expected)


def test_what_belongs_to_no_frame_is_given_in_pieces_with_the_times_at_which_they_were_read() -> None:
    search, _, caught = fed(b"ab", b"cd" + ANSWER[:4], ANSWER[4:] + b"e", b"f")
    assert caught is not None
    assert search.pieces(0) == [(b"ab", 0.0), (b"cd" + ANSWER[:4], 1.0), (ANSWER[4:] + b"e", 2.0), (b"f", 3.0)]
    search.claim(caught)
    assert search.pieces(0) == [(b"ab", 0.0), (b"cd", 1.0), (b"e", 2.0), (b"f", 3.0)]
    assert search.pieces(1) == [(b"b", 0.0), (b"cd", 1.0), (b"e", 2.0), (b"f", 3.0)]


def test_what_belongs_to_no_frame_between_two_positions() -> None:
    search, _, caught = fed(b"abcd", ANSWER, b"ef")
    assert caught is not None
    search.claim(caught)
    assert search.unclaimed_between(1, 14) == b"bcde"
    assert search.unclaimed_between(0, 6) == b"abcd"
    assert search.unclaimed_between(5, 15) == b"ef"
