"""What belongs to no other frame is searched for answers to earlier requests."""

from __future__ import annotations

from lfs10d.modbus.frame_search import ExpectedFrame, FrameSearch
from lfs10d.modbus.frames import Codec
from lfs10d.modbus.late_answers import find_late_answers
from lfs10d.modbus.outcome import LateAnswer
from lfs10d.modbus.pending import Pending
from lfs10d.modbus.request import ReadRegisters
from tests.support.receptions import RTU

VALUE, NUMBER = ReadRegisters(4, 1, 2), ReadRegisters(4, 5, 1)
VALUE_READ, NUMBER_READ = RTU.wrap(bytes.fromhex("040304414FD70A")), RTU.wrap(bytes.fromhex("0403020004"))


def pending(*requests: ReadRegisters, codec: Codec = RTU) -> dict[int, list[Pending]]:
    return {4: [Pending(each, codec, sent_end=1.0) for each in requests]}


def heard(data: bytes, at: float = 1.25) -> FrameSearch:
    search = FrameSearch()
    search.feed(data, at)
    return search


def test_an_answer_is_claimed_with_the_time_it_took() -> None:
    search = heard(b"\xff" + VALUE_READ + b"\xfe")
    assert list(find_late_answers(search, pending(VALUE))) == [LateAnswer(VALUE, 0.25)]
    assert search.unclaimed(0) == b"\xff\xfe"


def test_an_answer_that_was_begun_before_the_request_had_left_took_no_time() -> None:
    assert [late.latency for late in find_late_answers(heard(VALUE_READ, 0.9), pending(VALUE))] == [0.0]


def test_a_slave_answers_in_order() -> None:
    both = VALUE_READ + NUMBER_READ
    assert [late.request for late in find_late_answers(heard(both), pending(VALUE, NUMBER))] == [VALUE, NUMBER]
    assert [late.request for late in find_late_answers(heard(both), pending(NUMBER, VALUE))] == [NUMBER]


def test_what_is_not_there_or_belongs_to_another_frame_is_no_answer() -> None:
    assert not list(find_late_answers(heard(NUMBER_READ), pending(VALUE)))
    search = heard(VALUE_READ)
    (shape, _) = RTU.shapes(VALUE)
    own = search.seek(ExpectedFrame(RTU, shape))
    assert own is not None
    search.claim(own)
    assert not list(find_late_answers(search, pending(VALUE)))
