"""Late answers to earlier requests and other slaves' are found in what was received."""

from __future__ import annotations

import pytest

from lfs10d.modbus.frames import Checksum, Codec, Framing
from lfs10d.modbus.pending import Pending
from lfs10d.modbus.reception import Reception
from lfs10d.modbus.request import ReadRegisters, Request
from tests.support.exchanges import Attempt
from tests.support.receptions import ANSWER, CONFIRMED, MOVE, REFUSED, REQUEST, RTU, WHO, WIND, reception

LATE = RTU.wrap(bytes.fromhex("0103020007"))


def test_bytes_before_the_request_are_only_searched_for_late_answers() -> None:
    ear = reception(earlier=(WHO,), sent=False)
    ear.take(b"\xff" + LATE + ANSWER, -0.1)
    ear.sent(0.0)
    assert [late.request for late in ear.late] == [WHO]
    assert (ear.answer, ear.rest, ear.unsolicited) == (None, 0, 10)
    assert ear.late_at == -0.1
    assert ear.heard == b""


def test_a_late_answer_is_claimed_wherever_it_lies() -> None:
    ear = reception(earlier=(WHO, MOVE))
    ear.take(b"\xff" + LATE + CONFIRMED + ANSWER, 0.05)
    assert [late.request for late in ear.late] == [WHO, MOVE]
    assert ear.answer is not None
    assert ear.leftover() == b"\xff"


OTHER, OTHERS_ID = ReadRegisters(4, 1, 2), ReadRegisters(4, 5, 1)
LATE_OTHER, LATE_ID = RTU.wrap(bytes.fromhex("040304414FD70A")), RTU.wrap(bytes.fromhex("0403020004"))


def elsewhere(*requests: Request, heard: bytes) -> Reception:
    """Return an ear that heard this while these were unanswered, and looked for them at the end."""
    pending: dict[int, tuple[Pending, ...]] = {}
    for each in requests:
        pending[each.slave] = (*pending.get(each.slave, ()), Pending(each, RTU, -0.5))
    ear = Attempt(WIND, RTU, elsewhere=pending).reception(REQUEST)
    ear.sent(0.0)
    ear.take(heard, 0.05)
    ear.look_elsewhere()
    return ear


@pytest.mark.parametrize(
    ("requests", "heard", "late", "rest"),
    [
        pytest.param((OTHER,), LATE_OTHER, [OTHER], b"", id="alone"),
        pytest.param((OTHER,), b"\xff" + LATE_OTHER + ANSWER, [OTHER], b"\xff", id="between noise and ours"),
        pytest.param((OTHER,), ANSWER, [], b"", id="only ours came"),
        pytest.param((OTHER,), LATE_OTHER[:-1] + b"\0", [], LATE_OTHER[:-1] + b"\0", id="broken"),
        pytest.param((OTHER, OTHERS_ID), LATE_OTHER + LATE_ID, [OTHER, OTHERS_ID], b"", id="two of one slave"),
        pytest.param((OTHER, OTHER), LATE_OTHER, [OTHER], b"", id="asked twice, answered once"),
        pytest.param((OTHERS_ID, OTHER), LATE_OTHER + LATE_ID, [OTHERS_ID], LATE_OTHER, id="never out of turn"),
    ],
)
def test_late_answers_of_other_slaves_are_found_in_what_belongs_to_nothing(
    requests: tuple[Request, ...], heard: bytes, late: list[Request], rest: bytes
) -> None:
    ear = elsewhere(*requests, heard=heard)
    assert [each.request for each in ear.late] == late
    assert ear.leftover() == rest
    assert ear.late_at < 0


def test_the_asked_slaves_own_late_answer_is_reported_once() -> None:
    ear = elsewhere(WHO, heard=LATE)
    assert [each.request for each in ear.late] == [WHO]
    assert (ear.leftover(), ear.late_at) == (b"", 0.05)


def test_a_frame_inside_our_answer_is_nobodys_late_answer() -> None:
    inner = RTU.wrap(bytes.fromhex("048302"))
    answer = RTU.wrap(bytes.fromhex("010306") + inner + b"\0")
    pending = {4: (Pending(OTHER, RTU, -0.5),)}
    ear = Attempt(ReadRegisters(1, 1, 3), RTU, elsewhere=pending).reception(REQUEST)
    ear.sent(0.0)
    ear.take(b"\x04\x83" + answer, 0.05)
    ear.look_elsewhere()
    assert ear.answer is not None
    assert (ear.late, ear.unsolicited) == ([], 2)


@pytest.mark.parametrize(
    ("request_", "earlier", "heard", "ambiguous"),
    [
        (WIND, (WHO,), REFUSED, True),
        (WIND, (MOVE,), REFUSED, False),
        (WIND, (ReadRegisters(2, 1, 2),), REFUSED, False),
        (WIND, (WHO,), LATE + REFUSED, False),
        (WHO, (WHO,), LATE, False),
        (WHO, (ReadRegisters(1, 4, 1),), LATE, True),
        (WHO, (WIND,), LATE, False),
    ],
)
def test_what_another_request_could_have_asked_for_is_ambiguous(
    request_: Request, earlier: tuple[Request, ...], heard: bytes, *, ambiguous: bool
) -> None:
    ear = reception(request_, earlier=earlier)
    ear.take(heard, 0.03)
    assert ear.answer is not None
    assert ear.ambiguous is ambiguous


def test_a_slave_with_another_check_field_is_heard_late_too() -> None:
    summed = Codec(Framing.RTU, Checksum.SUM)
    pending = Pending(WHO, summed, -1.0)
    ear = Attempt(WIND, RTU, earlier=(pending,)).reception(REQUEST)
    ear.take(LATE, 0.4)
    assert not ear.late
    ear.take(summed.wrap(bytes.fromhex("0103020007")), 0.5)
    assert ear.late[0].latency == 1.5


OLDER = ReadRegisters(1, 0x0001, 5)
LATE_OLDER = RTU.wrap(bytes.fromhex("01030A") + bytes(10))


def test_of_two_earlier_requests_the_one_that_was_answered_is_told_and_the_older_is_over() -> None:
    ear = reception(earlier=(WHO, OLDER))
    ear.take(LATE_OLDER, 0.1)
    assert [(late.request, round(late.latency, 9)) for late in ear.late] == [(OLDER, 0.6)]
    ear.take(LATE, 0.15)
    assert len(ear.late) == 1


def test_two_late_answers_in_two_pieces_are_both_told() -> None:
    ear = reception(earlier=(WHO, OLDER))
    ear.take(LATE, 0.1)
    ear.take(LATE_OLDER, 0.15)
    assert [late.request for late in ear.late] == [WHO, OLDER]
    assert ear.late_at == 0.15


REFUSED_OTHER = RTU.wrap(bytes.fromhex("048302"))


def owed_by_two(*heard: bytes) -> Reception:
    """Return an ear that heard these bytes, one piece every 100 ms, while slaves 1 and 4 still owe answers."""
    owed = {1: (Pending(WHO, RTU, -0.5),), 4: (Pending(OTHER, RTU, -0.5),)}
    ear = Attempt(WIND, RTU, elsewhere=owed).reception(REQUEST)
    ear.sent(0.0)
    for n, piece in enumerate(heard, 1):
        ear.take(piece, 0.1 * n)
    ear.look_elsewhere()
    return ear


def test_a_late_answer_of_another_slave_is_told_with_its_age() -> None:
    ear = owed_by_two(LATE_OTHER)
    assert [(late.request, round(late.latency, 9)) for late in ear.late] == [(OTHER, 0.6)]


def test_of_two_frames_that_could_be_the_late_answer_the_first_is() -> None:
    ear = owed_by_two(REFUSED_OTHER, LATE_OTHER)
    assert [(late.request, round(late.latency, 9)) for late in ear.late] == [(OTHER, 0.6)]
    assert ear.unsolicited == len(LATE_OTHER)
