"""Names the fault of an exchange without an answer: its code, and a message for the installer."""

from __future__ import annotations

from typing import NamedTuple

from lfs10d.modbus.ask import Ask
from lfs10d.modbus.duplicates import Twice
from lfs10d.modbus.frames import EXCEPTION_FLAG, EXCEPTION_NAMES, Codec
from lfs10d.modbus.reception import Reception
from lfs10d.modbus.request import (
    BROADCAST,
    READ_COILS,
    READ_DISCRETE_INPUTS,
    READ_HOLDING_REGISTERS,
    READ_INPUT_REGISTERS,
    READS,
    ReadRegisters,
    Request,
)
from lfs10d.reading import FaultCode

_REQUEST_BODY = 6
"""Slave, function, address and count: what a master sends, and no answer of a read can be."""


class Diagnosis(NamedTuple):
    """A fault's code and message."""

    code: FaultCode
    message: str


def milliseconds(seconds: float) -> str:
    """Return a duration for people, to a tenth of a millisecond: `200 ms`, `3.6 ms`."""
    return f"{seconds * 1000:.1f}".removesuffix(".0") + " ms"


def judge(ask: Ask, reception: Reception) -> Diagnosis | None:
    """Return the fault of an exchange that is over; None for a broadcast.

    The nearest thing to an answer counts: a frame with a right check, then a late answer, then broken bytes.
    """
    if reception.echo_changed:
        return changed_echo()
    if ask.request.slave == BROADCAST:
        return None
    heard = reception.leftover()
    if heard and not reception.only_request:
        found = stranger(ask.request, ask.codec, heard)
        if found is not None:
            return found
        if reception.begun or not reception.late:
            return broken(heard, reception.expected, begun=reception.begun)
    if reception.late:
        return late(reception.late[-1].latency)
    return silent(ask.timeout, own=bool(heard))


def stranger_spoke(ask: Ask, reception: Reception) -> bool:
    """Whether a valid frame came that is no answer to our request: ours may still follow."""
    return stranger(ask.request, ask.codec, reception.leftover()) is not None


def silent(timeout: float, *, own: bool = False) -> Diagnosis:
    """Return the fault of a silence; `own`: our request came back though no echo was expected."""
    hint = " but our own request came back: does the adapter echo?" if own else ""
    return Diagnosis(FaultCode.TIMEOUT, f"no answer in {milliseconds(timeout)}{hint}")


def late(latency: float) -> Diagnosis:
    """Return the fault of an answer to an earlier request only, `latency` s after that."""
    since = milliseconds(latency)
    return Diagnosis(FaultCode.LATE, f"only the answer to an earlier request came, {since} after that request")


def babble(waited_for: float) -> Diagnosis:
    """Return the fault of a line that did not fall silent in `waited_for` s."""
    waited = milliseconds(waited_for)
    return Diagnosis(
        FaultCode.COLLISION,
        f"the line did not fall silent in {waited}, nothing was sent: a second master, a babbling device or noise",
    )


def changed_echo() -> Diagnosis:
    """Return the fault of a changed echo."""
    message = "our own request came back changed: another device sent at the same time, or noise"
    return Diagnosis(FaultCode.COLLISION, message)


def displaced(slave: int) -> Diagnosis:
    """Return the fault of an answer that may be another master's."""
    message = f"another master sent a request to slave {slave} at the same time: the answer may be for either"
    return Diagnosis(FaultCode.COLLISION, message)


def twice(found: Twice) -> str:
    """Return the message that each request gets a second answer."""
    return (
        f"slave {found.slave} is answered for twice, {milliseconds(found.delay)} apart: a second sensor with this id, "
        "or a repeater; the first answer is published"
    )


UNDECIDED = (
    "two answers came to one request: a second sensor with this id, or a repeater; which is whose cannot be decided"
)
RUN_INTO = "broken bytes came right behind the answer: noise, or another answer by a second sensor with this id"


def refusal(code: int, request: Request) -> Diagnosis:
    """Return the fault of an exception; the message names the requested registers."""
    name = EXCEPTION_NAMES.get(code, "of the device's own")
    return Diagnosis(FaultCode.EXCEPTION, f"exception {code:02X} {name}, {_asking(request)}")


def _asking(request: Request) -> str:
    """Return the request in words: `reading 2 registers at 0x0001`."""
    if isinstance(request, ReadRegisters):
        kind = _KINDS[request.function]
        return f"reading {request.count} {kind}{'s' * (request.count > 1)} at 0x{request.address:04X}"
    return f"writing 0x{request.value:04X} to 0x{request.address:04X}"


_KINDS = {
    READ_COILS: "coil",
    READ_DISCRETE_INPUTS: "discrete input",
    READ_HOLDING_REGISTERS: "register",
    READ_INPUT_REGISTERS: "input register",
}
"""What each function reads."""


def stranger(request: Request, codec: Codec, heard: bytes) -> Diagnosis | None:
    """Return the fault of the nearest valid frame in `heard` that is no answer to `request`; None without one."""
    size = codec.answer_size(request)
    diagnoses = [_judge(request, body) for _, _, body in codec.frames(heard, request.slave, size)]
    return max(diagnoses, key=_closeness, default=None)


def broken(heard: bytes, size: int, *, begun: bool) -> Diagnosis:
    """Return the fault of bytes without a valid frame, for an answer of `size`; `begun`: they begin as one.

    `heard` is what is left when echo, earlier answers and what came too early are taken out, at least one byte.
    """
    count = len(heard)
    if count >= size:
        return Diagnosis(
            FaultCode.CRC, f"check failed ({count} bytes): noise, two devices with one id, or a wrong baud rate"
        )
    if begun:
        return Diagnosis(FaultCode.MALFORMED, f"answer cut short: {count} of {size} bytes")
    plural = "s" * (count > 1)
    return Diagnosis(FaultCode.MALFORMED, f"{count} byte{plural} in place of an answer of {size}: noise")


_CLOSENESS = {FaultCode.COLLISION: 4, FaultCode.MALFORMED: 3, FaultCode.WRONG_FUNCTION: 2, FaultCode.WRONG_SLAVE: 1}
"""Rank of several frames: a frame of the asked slave that is nearest to the expected answer counts most."""


def _closeness(diagnosis: Diagnosis) -> int:
    return _CLOSENESS[diagnosis.code]


def _judge(request: Request, body: bytes) -> Diagnosis:
    """Return the fault of a valid frame that is no answer to `request`."""
    slave, function, data = body[0], body[1] & ~EXCEPTION_FLAG, body[2:]
    asked = len(body) == _REQUEST_BODY and function in READS
    if slave != request.slave:
        if asked:
            return Diagnosis(
                FaultCode.WRONG_SLAVE, f"a request to slave {slave} was received: is there a second master?"
            )
        return Diagnosis(FaultCode.WRONG_SLAVE, f"slave {slave} answered in place of slave {request.slave}")
    if function != request.function:
        wrong = f"slave {slave} answered function {function:02X} in place of {request.function:02X}"
        return Diagnosis(FaultCode.WRONG_FUNCTION, wrong)
    if not isinstance(request, ReadRegisters):
        told = f"slave {slave} confirmed another write: {data.hex(' ').upper()}"
    elif asked:
        told = f"a request to slave {slave} was received in place of its answer: an echo, or a second master"
        return Diagnosis(FaultCode.COLLISION, told)
    else:
        came, announced = max(0, len(data) - 1), sum(data[:1])
        told = f"slave {slave} sent {came} data bytes (announced: {announced}) instead of {request.data_bytes}"
    return Diagnosis(FaultCode.MALFORMED, told)
