"""Is anybody there? A slave id that nobody polls is asked, and what came is told once."""

from __future__ import annotations

from pathlib import Path

import pytest

from lfs10d.line.jobs.job import Done, Requeue
from lfs10d.line.jobs.ping import Ping
from lfs10d.modbus.ask import Ask
from lfs10d.modbus.frames import Codec, Framing
from lfs10d.modbus.outcome import Outcome
from lfs10d.modbus.request import ReadRegisters
from lfs10d.profiles.library import load_profile
from lfs10d.reading import Fault, FaultCode
from tests.support.outcomes import ended

CODEC = Codec(Framing.RTU)
LFS10 = load_profile("lfs10", relative_to=Path())
LD_E = load_profile("ld-e", relative_to=Path())
SILENCE = Fault(FaultCode.TIMEOUT, "no answer")
NOISE = Fault(FaultCode.CRC, "the check is wrong", heard=b"\x05\x03\x02")


def outcome(request: ReadRegisters, answer: tuple[int, ...] | None, fault: Fault | None) -> Outcome:
    return ended(request, answer=answer, fault=fault, answered=fault is None, sent=CODEC.encode(request))


class Door:
    """A ping at slave 5 and what comes of it."""

    def __init__(self) -> None:
        self.told: list[Ping] = []
        self.ping = Ping(5, LFS10, CODEC, self.told.append)
        self.timeouts: list[float] = []

    def hear(self, *faults: Fault | None) -> bool:
        """Answer one question after the other with these faults, None for an answer; return whether it is over."""
        following: object = None
        for fault in faults:
            ask = self.ping.ask(0.0)
            assert isinstance(ask, Ask)
            assert isinstance(ask.request, ReadRegisters)
            self.timeouts.append(ask.timeout)
            following = self.ping.on_outcome(outcome(ask.request, (5,) if fault is None else None, fault), 1.0)
        assert following in (Done(), Requeue(1.0))
        assert self.told == ([self.ping] if following == Done() else [])
        return following == Done()


def test_the_register_of_the_slave_id_is_asked_and_nothing_written() -> None:
    ask = Door().ping.ask(0.0)
    assert ask.request == ReadRegisters(5, 0x0005, 1)


def test_a_device_without_one_is_asked_for_its_first_values() -> None:
    block = LD_E.reads()[0]
    ask = Ping(5, LD_E, CODEC, lambda _: None).ask(0.0)
    assert ask.request == ReadRegisters(5, block.address, block.count, block.function)


def test_nobody_else_asks_it_meanwhile() -> None:
    assert Door().ping.excludes == {5}


def test_an_answer_ends_it() -> None:
    door = Door()
    assert door.hear(None)
    assert (door.ping.answered, door.ping.fault) == (True, None)


def test_a_refusal_is_an_answer() -> None:
    door = Door()
    assert door.hear(Fault(FaultCode.EXCEPTION, "refused", exception_code=2))
    assert door.ping.answered


def test_silence_is_asked_again_and_more_patiently_and_then_told() -> None:
    door = Door()
    assert not door.hear(SILENCE, SILENCE)
    assert door.hear(SILENCE)
    assert door.timeouts == [0.2, 0.4, 1.0]
    assert (door.ping.answered, door.ping.fault) == (False, SILENCE)


@pytest.mark.parametrize("order", [(NOISE, SILENCE, SILENCE), (SILENCE, NOISE, SILENCE), (SILENCE, SILENCE, NOISE)])
def test_what_was_heard_says_more_than_silence(order: tuple[Fault, ...]) -> None:
    door = Door()
    assert door.hear(*order)
    assert (door.ping.answered, door.ping.fault) == (False, NOISE)


def test_an_answer_after_silence_is_one() -> None:
    door = Door()
    assert door.hear(SILENCE, None)
    assert door.ping.answered


def test_when_the_port_is_lost_nothing_is_known() -> None:
    door = Door()
    door.hear(SILENCE)
    door.ping.cut_off(2.0)
    assert door.told == [door.ping]
    assert (door.ping.answered, door.ping.fault) == (False, None)
