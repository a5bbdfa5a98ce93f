"""Each fault has its code, and words for the person on the roof."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lfs10d.modbus import diagnosis
from lfs10d.modbus.duplicates import Twice
from lfs10d.modbus.echo import Echo
from lfs10d.modbus.frames import Codec, Framing
from lfs10d.modbus.pending import Pending
from lfs10d.modbus.reception import Reception
from lfs10d.modbus.request import ReadRegisters, Request, WriteRegister
from lfs10d.modbus.timing import LineTiming
from lfs10d.reading import FaultCode
from tests.support.exchanges import Attempt

RTU = Codec(Framing.RTU)
WIND = ReadRegisters(3, 0x0001, 2)
MOVE = WriteRegister(3, 0x0005, 7)
BITS = ReadRegisters(3, 0x0000, 9, 1)
SEVERAL = WriteRegister(3, 0x0005, 7, 16)


def framed(*bodies: str) -> bytes:
    return b"".join(RTU.wrap(bytes.fromhex(body)) for body in bodies)


@pytest.mark.parametrize(
    ("request_", "body", "code", "message"),
    [
        (WIND, "040304414FD70A", FaultCode.WRONG_SLAVE, "slave 4 answered in place of slave 3"),
        (WIND, "048302", FaultCode.WRONG_SLAVE, "slave 4 answered in place of slave 3"),
        (WIND, "040300010002", FaultCode.WRONG_SLAVE, "a request to slave 4 was received: is there a second master?"),
        (WIND, "030404414FD70A", FaultCode.WRONG_FUNCTION, "slave 3 answered function 04 in place of 03"),
        (WIND, "034104414FD70A", FaultCode.WRONG_FUNCTION, "slave 3 answered function 41 in place of 03"),
        (WIND, "038602", FaultCode.WRONG_FUNCTION, "slave 3 answered function 06 in place of 03"),
        (WIND, "030302414F", FaultCode.MALFORMED, "slave 3 sent 2 data bytes (announced: 2) instead of 4"),
        (WIND, "030306414FD70A", FaultCode.MALFORMED, "slave 3 sent 4 data bytes (announced: 6) instead of 4"),
        (WIND, "0303", FaultCode.MALFORMED, "slave 3 sent 0 data bytes (announced: 0) instead of 4"),
        (
            WIND,
            "030300010002",
            FaultCode.COLLISION,  # the contract's new word for a second master
            "a request to slave 3 was received in place of its answer: an echo, or a second master",
        ),
        (BITS, "030101FF", FaultCode.MALFORMED, "slave 3 sent 1 data bytes (announced: 1) instead of 2"),
        (
            BITS,
            "030100000009",
            FaultCode.COLLISION,
            "a request to slave 3 was received in place of its answer: an echo, or a second master",
        ),
        (SEVERAL, "031000050002", FaultCode.MALFORMED, "slave 3 confirmed another write: 00 05 00 02"),
        (MOVE, "030600050008", FaultCode.MALFORMED, "slave 3 confirmed another write: 00 05 00 08"),
    ],
)
def test_a_right_frame_that_is_no_answer_is_named(request_: Request, body: str, code: FaultCode, message: str) -> None:
    assert diagnosis.stranger(request_, RTU, framed(body)) == (code, message)


def test_of_several_frames_the_nearest_to_an_answer_counts() -> None:
    heard = framed("040304414FD70A", "030302414F", "030404414FD70A")
    found = diagnosis.stranger(WIND, RTU, heard)
    assert found is not None
    assert found.code is FaultCode.MALFORMED


def test_noise_is_no_frame() -> None:
    assert diagnosis.stranger(WIND, RTU, b"\x03\x03\x04\x00\x00\x00\x00\x00\x00") is None


@pytest.mark.parametrize(
    ("count", "begun", "code", "message"),
    [
        (9, True, FaultCode.CRC, "check failed (9 bytes): noise, two devices with one id, or a wrong baud rate"),
        (12, False, FaultCode.CRC, "check failed (12 bytes): noise, two devices with one id, or a wrong baud rate"),
        (5, True, FaultCode.MALFORMED, "answer cut short: 5 of 9 bytes"),
        (5, False, FaultCode.MALFORMED, "5 bytes in place of an answer of 9: noise"),
        (1, False, FaultCode.MALFORMED, "1 byte in place of an answer of 9: noise"),
    ],
)
def test_broken_bytes_are_told_by_their_number(count: int, code: FaultCode, message: str, *, begun: bool) -> None:
    assert diagnosis.broken(b"\xff" * count, 9, begun=begun) == (code, message)


def test_the_other_faults_have_words() -> None:
    assert diagnosis.silent(0.2).message == "no answer in 200 ms"
    assert diagnosis.silent(0.2, own=True).message == (
        "no answer in 200 ms but our own request came back: does the adapter echo?"
    )
    assert diagnosis.late(0.5504).message == "only the answer to an earlier request came, 550.4 ms after that request"
    assert diagnosis.babble(0.2).message == (
        "the line did not fall silent in 200 ms, nothing was sent: a second master, a babbling device or noise"
    )
    assert diagnosis.changed_echo().code is FaultCode.COLLISION


@pytest.mark.parametrize(
    ("request_", "words"),
    [
        (ReadRegisters(1, 1, 2), "reading 2 registers at 0x0001"),
        (ReadRegisters(1, 0x1F4, 1), "reading 1 register at 0x01F4"),
        (ReadRegisters(1, 0, 10, 4), "reading 10 input registers at 0x0000"),
        (WriteRegister(1, 5, 9), "writing 0x0009 to 0x0005"),
        (WriteRegister(1, 5, 9, 16), "writing 0x0009 to 0x0005"),
        (ReadRegisters(1, 0, 1, 1), "reading 1 coil at 0x0000"),
        (ReadRegisters(1, 0x10, 12, 2), "reading 12 discrete inputs at 0x0010"),
    ],
)
def test_an_exception_names_the_registers_that_were_asked(request_: Request, words: str) -> None:
    assert diagnosis.refusal(2, request_).message == f"exception 02 illegal register address, {words}"
    assert diagnosis.refusal(0x55, request_).message == f"exception 55 of the device's own, {words}"


@pytest.mark.parametrize(("seconds", "words"), [(0.2, "200 ms"), (0.0036458, "3.6 ms"), (1.0, "1000 ms")])
def test_durations_are_told_in_milliseconds(seconds: float, words: str) -> None:
    assert diagnosis.milliseconds(seconds) == words


LATE = framed("0303020007")
STRANGER = framed("040304414FD70A")
BEGUN = bytes.fromhex("0303044142")


def heard_by(request_: Request, echo: Echo, heard: bytes) -> Reception:
    """Return the ear of an exchange that may still hear a late answer of slave 3, and what it heard."""
    attempt = Attempt(
        request=request_,
        codec=RTU,
        timing=LineTiming.of(9600),
        timeout=0.2,
        patience=None,
        echo=echo,
        adapter_latency=0.02,
        earlier=(Pending(ReadRegisters(3, 0x0005, 1), RTU, -0.5),),
    )
    reception = attempt.reception()
    reception.sent(0.0)
    reception.take(heard, 0.03)
    return reception


@pytest.mark.parametrize(
    ("request_", "echo", "heard", "code"),
    [
        (WIND, Echo.OFF, b"", FaultCode.TIMEOUT),
        (WIND, Echo.OFF, RTU.encode(WIND), FaultCode.TIMEOUT),
        (WIND, Echo.ON, RTU.encode(WIND), FaultCode.TIMEOUT),
        (WIND, Echo.ON, RTU.encode(WIND)[:5], FaultCode.COLLISION),
        (WIND, Echo.OFF, STRANGER, FaultCode.WRONG_SLAVE),
        (WIND, Echo.OFF, LATE, FaultCode.LATE),
        (WIND, Echo.OFF, LATE + STRANGER, FaultCode.WRONG_SLAVE),
        (WIND, Echo.OFF, LATE + b"\xff", FaultCode.LATE),
        (WIND, Echo.OFF, LATE + BEGUN, FaultCode.MALFORMED),
        (WIND, Echo.OFF, b"\xff" * 9, FaultCode.CRC),
        (WriteRegister(0, 5, 7), Echo.OFF, b"\xff", None),
        (WriteRegister(0, 5, 7), Echo.ON, b"\xff", FaultCode.COLLISION),
    ],
)
def test_the_nearest_thing_to_an_answer_names_the_fault(
    request_: Request, echo: Echo, heard: bytes, code: FaultCode | None
) -> None:
    reception = heard_by(request_, echo, heard)
    found = diagnosis.judge(reception._ask, reception)
    assert (found and found.code) == code


@pytest.mark.parametrize(("heard", "spoke"), [(STRANGER, True), (b"\xff" + STRANGER, True), (BEGUN, False)])
def test_a_right_frame_of_somebody_else_is_a_stranger(heard: bytes, *, spoke: bool) -> None:
    reception = heard_by(WIND, Echo.OFF, heard)
    assert diagnosis.stranger_spoke(reception._ask, reception) is spoke


def test_the_remaining_faults_have_their_codes() -> None:
    assert diagnosis.babble(0.2).code is FaultCode.COLLISION
    assert diagnosis.refusal(2, WIND).code is FaultCode.EXCEPTION
    assert diagnosis.changed_echo() == (
        FaultCode.COLLISION,
        "our own request came back changed: another device sent at the same time, or noise",
    )


def test_two_bytes_are_several() -> None:
    assert diagnosis.broken(b"\xff\xff", 9, begun=False).message == "2 bytes in place of an answer of 9: noise"


def test_a_request_to_read_input_registers_is_a_request_too() -> None:
    found = diagnosis.stranger(WIND, RTU, framed("040400010002"))
    assert found == (FaultCode.WRONG_SLAVE, "a request to slave 4 was received: is there a second master?")


def test_another_write_is_told_in_capital_digits() -> None:
    found = diagnosis.stranger(MOVE, RTU, framed("0306000500FA"))
    assert found == (FaultCode.MALFORMED, "slave 3 confirmed another write: 00 05 00 FA")


def test_a_frame_of_an_unknown_function_is_found_behind_noise_where_it_is_the_slaves_own() -> None:
    found = diagnosis.stranger(WIND, RTU, b"\xff" + framed("034104414FD70A"))
    assert found == (FaultCode.WRONG_FUNCTION, "slave 3 answered function 41 in place of 03")


@pytest.mark.parametrize(
    ("heard", "message"),
    [
        (BEGUN, "answer cut short: 5 of 9 bytes"),
        (RTU.encode(WIND), "no answer in 200 ms but our own request came back: does the adapter echo?"),
        (b"", "no answer in 200 ms"),
    ],
)
def test_the_verdict_is_in_words(heard: bytes, message: str) -> None:
    reception = heard_by(WIND, Echo.OFF, heard)
    found = diagnosis.judge(reception._ask, reception)
    assert found is not None
    assert found.message == message


PIECES = st.sampled_from([LATE, STRANGER, BEGUN, RTU.encode(WIND), RTU.encode(MOVE), framed("038302")]) | st.binary(
    max_size=40
)


@given(st.sampled_from([WIND, MOVE, WriteRegister(0, 5, 7)]), st.sampled_from(Echo), st.lists(PIECES, max_size=8))
def test_whatever_was_heard_there_is_one_verdict_in_words_that_can_be_printed(
    request_: Request, echo: Echo, pieces: list[bytes]
) -> None:
    reception = heard_by(request_, echo, b"".join(pieces))
    found = diagnosis.judge(reception._ask, reception)
    assert (found is None) is (request_.slave == 0 and not reception.echo_changed)
    assert found is None or found.message.isprintable()


def test_what_another_master_may_have_asked_for_is_a_collision() -> None:
    found = diagnosis.displaced(3)
    assert found.code is FaultCode.COLLISION
    assert "another master sent a request to slave 3" in found.message


def test_a_second_answer_is_told_with_its_delay() -> None:
    assert diagnosis.twice(Twice(3, 0.0371)).startswith("slave 3 is answered for twice, 37.1 ms apart: a second sensor")
