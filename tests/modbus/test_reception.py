"""What was heard is sorted: echo, what came too early, late answers, the answer, the rest."""

from __future__ import annotations

import pytest

from lfs10d.modbus.echo import Echo
from lfs10d.modbus.frames import Checksum, Codec, Framing
from lfs10d.modbus.pending import Pending
from lfs10d.modbus.reception import HEARD_KEPT, Reception
from lfs10d.modbus.request import ReadRegisters, Request, WriteRegister
from lfs10d.modbus.timing import LineTiming
from tests.support.exchanges import Attempt

RTU, ASCII = Codec(Framing.RTU), Codec(Framing.ASCII)
WIND, WHO, MOVE = ReadRegisters(1, 0x0001, 2), ReadRegisters(1, 0x0005, 1), WriteRegister(1, 0x0005, 7)
ANSWER, REFUSED = bytes.fromhex("010304414FD70A002F"), bytes.fromhex("018302C0F1")
LATE = RTU.wrap(bytes.fromhex("0103020007"))
CONFIRMED = RTU.encode(MOVE)
REQUEST = RTU.encode(WIND)
TIMING = LineTiming.of(9600)


def reception(
    request: Request = WIND,
    *,
    echo: Echo = Echo.OFF,
    earlier: tuple[Request, ...] = (),
    codec: Codec = RTU,
    paced: bool = True,
    sent: bool = True,
) -> Reception:
    """Return the ear of an exchange whose request was begun at 0."""
    attempt = Attempt(
        request=request,
        codec=codec,
        timing=TIMING,
        timeout=0.2,
        patience=None,
        echo=echo,
        adapter_latency=0.02,
        earlier=tuple(Pending(each, codec, -0.5) for each in earlier),
        paced=paced,
    )
    ear = attempt.reception()
    if sent:
        ear.sent(0.0)
    return ear


def test_nothing_amounts_to_nothing() -> None:
    ear = reception()
    assert (ear.answer, ear.spare, ear.late, ear.rest, ear.leftover()) == (None, None, [], 0, b"")
    assert (ear.begun, ear.echoed, ear.echo_changed, ear.ambiguous, ear.unsolicited) == (False, None, False, False, 0)


def test_an_answer_in_two_pieces_is_an_answer() -> None:
    ear = reception()
    ear.take(ANSWER[:4], 0.02)
    assert ear.begun
    assert ear.whole_at == pytest.approx(0.02 + 5 * TIMING.character)
    ear.take(ANSWER[4:], 0.03)
    assert ear.answer is not None
    assert (ear.answer.first_at, ear.answer.last_at) == (0.02, 0.03)
    assert (ear.rest, ear.unsolicited, ear.echoed) == (0, 0, False)


def test_a_later_piece_never_postpones_the_end_of_its_frame() -> None:
    ear = reception()
    ear.take(ANSWER[:4], 0.02)
    ear.take(ANSWER[4:5], 0.024)
    assert ear.whole_at == pytest.approx(0.02 + 5 * TIMING.character)


def test_ascii_is_heard_in_either_case() -> None:
    ear = reception(codec=ASCII)
    ear.take(b":010304d0f5000033\r\n", 0.1)
    assert ear.answer is not None


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


def test_what_comes_too_early_on_a_wire_is_no_answer() -> None:
    ear = reception()
    ear.take(ANSWER, 0.001)
    assert (ear.answer, ear.spare, ear.rest, ear.unsolicited) == (None, None, 0, 9)


@pytest.mark.parametrize(("later", "rest"), [(-0.01, 0), (0.01, 1), (1.01, 2), (9.0, 9)])
def test_of_one_piece_only_the_last_bytes_can_have_come_after_the_request(later: float, rest: int) -> None:
    """Counted in characters, at the fastest, from when seven of the request's eight had left."""
    ear = reception()
    ear.take(b"\xff" * 9, (7 + 0.9 * later) * TIMING.character)
    assert ear.rest == rest


def test_what_comes_too_early_without_a_pace_is_a_spare() -> None:
    ear = reception(paced=False)
    ear.take(ANSWER, 0.001)
    assert ear.answer is None
    assert ear.spare is not None
    assert (ear.begun, ear.echoed, ear.ambiguous) == (True, False, False)
    ear.take(ANSWER, 0.02)
    assert ear.answer is not None


def test_an_echo_is_taken_out() -> None:
    ear = reception(echo=Echo.UNKNOWN)
    ear.take(REQUEST[:3], 0.003)
    assert (ear.rest, ear.begun, ear.leftover(), ear.unsolicited) == (3, True, REQUEST[:3], 0)
    assert ear.whole_at == 0.003
    ear.take(REQUEST[3:], 0.009)
    assert (ear.rest, ear.begun, ear.echoed, ear.only_request) == (0, False, True, True)
    ear.take(ANSWER, 0.03)
    assert ear.answer is not None
    assert not ear.only_request


def test_the_end_of_an_echo_and_the_answer_may_come_in_one_piece() -> None:
    ear = reception(echo=Echo.ON)
    ear.take(REQUEST[:3], 0.003)
    ear.take(REQUEST[3:] + ANSWER, 0.03)
    assert ear.answer is not None
    assert (ear.echoed, ear.unsolicited) == (True, 0)


def test_half_an_echo_belongs_to_no_answer() -> None:
    ear = reception(echo=Echo.ON)
    ear.take(REQUEST[:3], 0.003)
    assert ear.unsolicited == 3


def test_an_expected_echo_of_which_nothing_came_has_not_changed() -> None:
    assert not reception(echo=Echo.ON).echo_changed


def test_what_seemed_echo_and_is_none_is_given_back() -> None:
    ear = reception(echo=Echo.UNKNOWN)
    ear.take(ANSWER[:2], 0.02)
    ear.take(ANSWER[2:], 0.03)
    assert ear.answer is not None
    assert ear.answer.first_at == 0.02
    assert ear.echoed is False


def test_an_echo_behind_noise_proves_nothing() -> None:
    ear = reception()
    ear.take(b"\x00" + REQUEST + ANSWER, 0.03)
    assert ear.answer is not None
    assert ear.echoed is None


def test_an_echo_that_nobody_expects_is_noticed() -> None:
    ear = reception()
    ear.take(REQUEST + ANSWER, 0.03)
    assert ear.echoed is True


def test_an_expected_echo_that_came_back_otherwise_has_changed() -> None:
    ear = reception(echo=Echo.ON)
    ear.take(REQUEST[:3], 0.003)
    assert ear.echo_changed
    assert ear.whole_at == pytest.approx(0.003 + 5 * TIMING.character)
    ear.take(b"\xff" * 5, 0.009)
    assert ear.echo_changed
    assert not ear.begun
    whole = reception(echo=Echo.ON)
    whole.take(REQUEST, 0.009)
    assert not whole.echo_changed


@pytest.mark.parametrize(("echo", "echoed"), [(Echo.ON, True), (Echo.UNKNOWN, None), (Echo.OFF, None)])
def test_one_frame_confirms_a_write_only_where_there_is_no_echo(echo: Echo, *, echoed: bool | None) -> None:
    ear = reception(MOVE, echo=echo)
    ear.take(CONFIRMED, 0.03)
    assert (ear.answer is not None) is (echo is Echo.OFF)
    assert ear.echoed is echoed


def test_two_frames_confirm_a_write_behind_an_echo() -> None:
    ear = reception(MOVE, echo=Echo.UNKNOWN)
    ear.take(CONFIRMED + CONFIRMED, 0.03)
    assert ear.answer is not None
    assert ear.echoed is True
    changed = reception(MOVE, echo=Echo.ON)
    changed.take(b"\x00" + CONFIRMED, 0.03)
    assert changed.answer is None


def test_a_broadcast_has_no_answer() -> None:
    ear = reception(WriteRegister(0, 5, 7))
    ear.take(RTU.encode(WriteRegister(0, 5, 7)), 0.03)
    assert ear.answer is None


def test_how_long_the_answer_should_be_depends_on_what_it_begins_as() -> None:
    ear = reception()
    ear.take(REFUSED[:4], 0.02)
    assert (ear.expected, ear.unsolicited) == (5, 0)
    both = reception()
    both.take(REFUSED[:4] + ANSWER[:4], 0.02)
    assert (both.expected, both.unsolicited) == (9, 0)


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


def test_only_the_last_of_very_much_is_remembered() -> None:
    ear = reception()
    for step in range(10):
        ear.take(b"\x55" * 500, 1.0 + step)
    assert HEARD_KEPT <= len(ear.heard) <= 2 * HEARD_KEPT
    assert ear.rest == ear.unsolicited == 5000


def test_a_slave_with_another_check_field_is_heard_late_too() -> None:
    summed = Codec(Framing.RTU, Checksum.SUM)
    pending = Pending(WHO, summed, -1.0)
    ear = Attempt(WIND, RTU, earlier=(pending,)).reception(REQUEST)
    ear.take(LATE, 0.4)
    assert not ear.late
    ear.take(summed.wrap(bytes.fromhex("0103020007")), 0.5)
    assert ear.late[0].latency == 1.5


def test_nothing_heard_before_is_held_against_a_byte_that_comes_just_in_time() -> None:
    ear = reception()
    ear.take(b"\xff", TIMING.transmission(len(REQUEST) - 1))
    assert ear.rest == 1


def test_huge_pieces_do_not_make_the_memory_grow() -> None:
    ear = reception()
    for n in range(10):
        ear.take(b"\xff" * 5000, 0.02 + n)
        assert len(ear.heard) <= 2 * HEARD_KEPT


def test_what_was_no_echo_is_not_taken_for_the_rest_of_one_later() -> None:
    ear = reception(echo=Echo.UNKNOWN)
    pieces = (REQUEST[:3], b"\xff", REQUEST[3:])
    for n, piece in enumerate(pieces):
        ear.take(piece, 0.05 + 0.01 * n)
    assert ear.leftover() == b"".join(pieces)


def test_two_bytes_that_may_be_echo_may_be_the_answers_first() -> None:
    ear = reception(echo=Echo.UNKNOWN)
    ear.take(REQUEST[:2], 0.05)
    assert ear.begun


def test_an_echo_has_changed_where_it_was_expected_and_a_single_other_byte_came() -> None:
    ear = reception(echo=Echo.ON)
    ear.take(b"\xff", 0.05)
    assert ear.echo_changed
    ear = reception(echo=Echo.OFF)
    ear.take(b"\xff", 0.05)
    assert not ear.echo_changed
    ear = reception(echo=Echo.ON)
    ear.take(REQUEST + b"\xff", 0.05)
    assert not ear.echo_changed


def test_an_echo_in_many_pieces_is_left_over_as_it_came() -> None:
    ear = reception(echo=Echo.UNKNOWN)
    for at in range(5):
        ear.take(REQUEST[at : at + 1], 0.05 + at * TIMING.character)
    assert ear.leftover() == REQUEST[:5]


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


def test_the_last_byte_of_a_frame_is_not_postponed_either() -> None:
    ear = reception()
    ear.take(ANSWER[:7], 0.02)
    ear.take(ANSWER[7:8], 0.024)
    assert ear.whole_at == pytest.approx(0.02 + 2 * TIMING.character)


def test_a_frame_that_begins_anew_is_waited_for_anew() -> None:
    ear = reception()
    ear.take(ANSWER[:1], 0.02)
    ear.take(ANSWER[:1], 0.03)
    assert ear.whole_at == pytest.approx(0.03 + 8 * TIMING.character)
