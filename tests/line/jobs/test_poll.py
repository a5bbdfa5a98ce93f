"""A poll reads all values once, behind a barrier where it must, and tries again what the line spoilt."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from lfs10d.line.device import Device, DeviceSpec, PollRules
from lfs10d.line.jobs.job import Done, Hold, Requeue
from lfs10d.line.jobs.poll import Poll
from lfs10d.modbus.ask import Ask
from lfs10d.modbus.frames import Codec, Framing
from lfs10d.modbus.outcome import LateAnswer
from lfs10d.modbus.pending import PendingRequests
from lfs10d.modbus.request import ReadRegisters
from lfs10d.profiles.library import load_profile
from lfs10d.reading import Fault, FaultCode, Purpose
from tests.support.outcomes import ended

RTU = Codec(Framing.RTU)
LFS10, DZB = (load_profile(name, relative_to=Path()) for name in ("lfs10", "fuling-dzb"))
WIND, WHO = ReadRegisters(1, 0x0001, 2), ReadRegisters(1, 0x0005, 1)
VALUE = (0x414F, 0xD70A)
NAN = (0x7FC0, 0x0000)
PLAIN = ended(WIND)


class Rig:
    """A device on a line, and a poll of it."""

    def __init__(self, purpose: Purpose = Purpose.POLL, *, profile: str = "lfs10", retries: int = 1) -> None:
        self.pending = PendingRequests()
        chosen = load_profile(profile, relative_to=Path())
        self.device = Device(DeviceSpec("mast", 1, chosen, RTU, 1.0), PollRules(retries=retries), 1)
        self.device.answered()
        self.purpose = purpose
        self.begin()

    def begin(self) -> None:
        self.poll = Poll(self.device, self.pending, due=0.0, purpose=self.purpose)

    def asks(self, now: float = 0.0) -> ReadRegisters:
        ask = self.poll.ask(now)
        assert isinstance(ask, Ask)
        assert isinstance(ask.request, ReadRegisters)
        self.asked = ask
        return ask.request

    def hears(
        self,
        now: float,
        answer: tuple[int, ...] | None = None,
        code: FaultCode | None = None,
        *,
        late: tuple[ReadRegisters, ...] = (),
        ambiguous: bool = False,
        heard: bytes = b"",
    ) -> Requeue | Done:
        """Ask and hear; remembered by the line as in the scheduler."""
        request = self.asks(now)
        fault = None if code is None else Fault(code, "", 2 if code is FaultCode.EXCEPTION else None)
        outcome = replace(
            PLAIN,
            request=request,
            answer=answer,
            fault=fault,
            sent_end=now,
            ended=now + 0.02,
            rtt=0.02 if answer else None,
            answered=answer is not None or code is FaultCode.EXCEPTION,
            late=tuple(LateAnswer(each, 0.3) for each in late),
            ambiguous=ambiguous,
            heard=heard,
        )
        self.pending.on_outcome(outcome, RTU, 0.2, now + 0.02)
        following = self.poll.on_outcome(outcome, now + 0.02)
        assert isinstance(following, Requeue | Done)
        return following


def test_a_poll_is_one_read_and_its_value() -> None:
    rig = Rig()
    assert rig.asks() == WIND
    assert rig.hears(0.0, VALUE) == Done()
    assert rig.poll.good == {"wind_speed": 12.99}
    assert (rig.poll.fault, rig.poll.rtt, rig.poll.at) == (None, 0.02, 0.02)


def test_values_that_do_not_fit_into_one_read_take_several() -> None:
    rig = Rig(profile="fuling-dzb")
    blocks = DZB.reads()
    for block in blocks[:-1]:
        assert rig.hears(0.0, (0,) * block.count) == Requeue(0.0)
    assert rig.hears(0.0, (0,) * blocks[-1].count) == Done()
    assert rig.poll.good is not None
    assert set(rig.poll.good) == set(DZB.value_names)


def test_after_silence_the_retry_asks_the_barrier_first_and_the_value_when_nothing_can_linger() -> None:
    rig = Rig()
    assert rig.hears(0.0, code=FaultCode.TIMEOUT) == Requeue(0.02)
    assert rig.asks(0.1) == WHO
    assert rig.hears(0.1, (1,)) == Requeue(0.02)
    assert rig.poll.ask(0.2) == Hold(1.0)
    assert rig.asks(1.0) == WIND
    assert rig.hears(1.0, VALUE) == Done()
    assert rig.poll.failed_attempts == [FaultCode.TIMEOUT]
    assert rig.poll.good


def test_after_broken_bytes_the_value_is_asked_right_behind_the_barrier() -> None:
    rig = Rig()
    rig.hears(0.0, code=FaultCode.CRC)
    rig.hears(0.1, (1,))
    assert rig.asks(0.2) == WIND


@pytest.mark.parametrize("code", [FaultCode.TIMEOUT, FaultCode.CRC, FaultCode.WRONG_SLAVE, FaultCode.COLLISION])
def test_a_fault_of_the_line_is_tried_again_so_often_as_allowed(code: FaultCode) -> None:
    rig = Rig(retries=2)
    for now in (0.0, 2.0):
        assert rig.hears(now, code=code) == Requeue(now + 0.02)
    assert rig.hears(4.0, code=code) == Done()
    assert rig.poll.fault is not None
    assert rig.poll.fault.code is code
    assert rig.poll.failed_attempts == [code, code]
    assert rig.poll.good is None


@pytest.mark.parametrize(("codes", "busy"), [((2,), True), ((1, 2, 6), True), ((6,), False), ((), False)])
def test_which_exceptions_mean_busy_is_the_profiles_word(codes: tuple[int, ...], *, busy: bool) -> None:
    rig = Rig()
    rig.device.spec = replace(rig.device.spec, profile=LFS10.model_copy(update={"busy_exceptions": codes}))
    rig.begin()
    rig.hears(0.0, code=FaultCode.EXCEPTION)
    assert rig.poll.fault == Fault(FaultCode.EXCEPTION, "", 2, busy=busy)


def test_a_fault_without_an_exception_is_never_busy() -> None:
    rig = Rig(retries=0)
    rig.hears(0.0, code=FaultCode.CRC)
    assert rig.poll.fault == Fault(FaultCode.CRC, "")


def test_a_refusal_and_a_bad_value_are_final() -> None:
    rig = Rig()
    assert rig.hears(0.0, code=FaultCode.EXCEPTION) == Done()
    rig = Rig()
    assert rig.hears(0.0, NAN) == Done()
    assert rig.poll.fault is not None
    assert rig.poll.fault.code is FaultCode.NOT_FINITE
    assert rig.poll.good is None


def test_the_fault_of_a_bad_value_shows_the_last_bytes_that_were_heard() -> None:
    rig = Rig()
    frame = bytes.fromhex("01 03 04 7F C0 00 00 E2 27")
    rig.hears(0.0, NAN, heard=bytes(30) + frame)
    assert rig.poll.fault is not None
    assert rig.poll.fault.heard == bytes(23) + frame


def test_an_answer_of_another_length_is_malformed_and_tried_again() -> None:
    rig = Rig()
    assert rig.hears(0.0, VALUE[:1], heard=b"\x01\x03\x02") == Requeue(0.02)
    assert rig.poll.failed_attempts == [FaultCode.MALFORMED]
    assert rig.hears(0.1, VALUE[:1], heard=b"\x01\x03\x02") == Done()
    assert rig.poll.fault == Fault(FaultCode.MALFORMED, "1 registers came, 2 were requested", heard=b"\x01\x03\x02")


def test_a_refused_barrier_will_do_unless_the_refusal_may_be_an_older_ones() -> None:
    rig = Rig()
    rig.hears(0.0, code=FaultCode.CRC)
    assert rig.hears(0.1, code=FaultCode.EXCEPTION) == Requeue(0.02)
    assert rig.asks(0.2) == WIND
    rig = Rig()
    rig.hears(0.0, code=FaultCode.TIMEOUT)
    assert rig.hears(0.1, code=FaultCode.EXCEPTION, ambiguous=True) == Done()
    rig.begin()
    assert rig.poll.ask(0.5) == Hold(1.1)
    assert rig.asks(1.1) == WIND


def test_a_probe_begins_with_the_barrier_and_is_never_tried_again() -> None:
    rig = Rig(Purpose.PROBE)
    assert rig.asks() == WHO
    assert rig.hears(0.0, (1,)) == Requeue(0.0)
    assert rig.asks(0.1) == WIND
    assert rig.hears(0.1, VALUE) == Done()
    rig.begin()
    assert rig.hears(0.0, code=FaultCode.TIMEOUT) == Done()


def test_a_probe_waits_as_probes_do_and_a_poll_as_was_learned() -> None:
    rig = Rig(Purpose.PROBE)
    for _ in range(20):
        rig.device.response_times.learn(0.01)
    rig.device.failed(Fault(FaultCode.TIMEOUT, ""), 0.0)
    rig.asks()
    assert (rig.asked.timeout, rig.asked.patience) == (0.2, 0.01)
    rig = Rig()
    for _ in range(20):
        rig.device.response_times.learn(0.1)
    rig.asks()
    assert rig.asked.timeout == pytest.approx(0.22)
    assert rig.asked.patience == 0.1


def test_without_a_barrier_the_slave_is_left_alone() -> None:
    rig = Rig()
    plain = LFS10.model_copy(update={"barrier": None})
    rig.device.spec = replace(rig.device.spec, profile=plain)
    rig.begin()
    rig.hears(0.0, code=FaultCode.TIMEOUT)
    assert rig.poll.ask(0.2) == Hold(1.0)
    assert rig.asks(1.0) == WIND
    rig.purpose = Purpose.PROBE
    rig.begin()
    assert rig.asks(1.0) == WIND


def test_late_answers_are_counted_once() -> None:
    rig = Rig()
    rig.hears(0.0, code=FaultCode.TIMEOUT)
    assert rig.hears(0.1, code=FaultCode.LATE, late=(WIND,)) == Done()
    assert rig.poll.failed_attempts == [FaultCode.TIMEOUT]
    rig = Rig()
    rig.hears(0.0, code=FaultCode.TIMEOUT)
    rig.hears(0.1, (1,), late=(WIND,))
    rig.hears(0.2, VALUE, late=(ReadRegisters(9, 1, 2),))
    assert rig.poll.failed_attempts == [FaultCode.TIMEOUT, FaultCode.LATE]


def test_one_that_is_cut_off_says_when() -> None:
    rig = Rig()
    rig.poll.cut_off(5.0)
    assert rig.poll.at == 5.0


def sleeper(rig: Rig, helped: int) -> None:
    """Let asking again at once after a pause have helped so many times, the last time at 0."""
    for ended_at in range(-10 * helped, 0, 10):
        rig.device.gap.exchanged(ended_at + 9.0, ended_at + 9.2, spoke=False, silent=True)
        rig.device.gap.exchanged(ended_at + 9.21, ended_at + 10.0, spoke=True, silent=False)
    rig.begin()


def test_one_that_sleeps_is_woken_by_its_barrier_and_that_is_no_failed_attempt() -> None:
    rig = Rig(retries=0)
    sleeper(rig, 2)
    assert rig.asks(5.0) == WHO
    assert rig.hears(5.0, code=FaultCode.TIMEOUT) == Requeue(0.0)
    rig.device.gap.exchanged(5.0, 5.2, spoke=False, silent=True)
    assert rig.asks(5.21) == WIND
    assert isinstance(rig.hears(5.21, VALUE), Done)
    assert (rig.poll.fault, rig.poll.failed_attempts, rig.poll.begun) == (None, [], True)


def test_where_asking_again_has_helped_once_it_is_tried_and_counts_as_a_failed_attempt() -> None:
    rig = Rig(retries=0)
    sleeper(rig, 1)
    assert rig.asks(5.0) == WIND
    assert rig.hears(5.0, code=FaultCode.TIMEOUT) == Requeue(0.0)
    assert rig.poll.failed_attempts == [FaultCode.TIMEOUT]
    rig.device.gap.exchanged(5.0, 5.2, spoke=False, silent=True)
    assert rig.hears(5.21, code=FaultCode.TIMEOUT) == Done()
    assert rig.poll.fault is not None


def test_a_poll_wakes_its_device_three_times_at_most() -> None:
    rig = Rig(retries=0)
    sleeper(rig, 2)
    outcomes = [rig.hears(now, code=FaultCode.TIMEOUT) for now in (5.0, 10.0, 15.0, 20.0)]
    assert outcomes == [Requeue(0.0)] * 3 + [Done()]
