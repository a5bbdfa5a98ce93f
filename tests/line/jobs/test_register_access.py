"""Raw access to registers on a simulated line in virtual time: what is asked, what is written, how it ends."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import pytest

from lfs10d.line.device import DeviceSpec, PollRules
from lfs10d.line.jobs.access_end import End
from lfs10d.line.jobs.job import Hold
from lfs10d.line.jobs.register_access import DIFFERING, ECHO_READS, VERIFY_WITHIN, Access, Target
from lfs10d.line.poller import Poller
from lfs10d.line.scheduler import Scheduler
from lfs10d.modbus.bus import Bus, LineRules
from lfs10d.modbus.echo import Echo
from lfs10d.modbus.frames import Codec, Framing
from lfs10d.modbus.port_settings import PortSettings
from lfs10d.modbus.request import ReadRegisters, Request, WriteRegister
from lfs10d.profiles.library import load_profile
from lfs10d.profiles.profile import Profile
from lfs10d.reading import Event, Exchanged, Fault, FaultCode, Purpose, Reading
from lfs10d.simulator.line import SimulatedLine
from lfs10d.simulator.port import SimulatedPort, VirtualClock, run
from lfs10d.simulator.registers import blueprint_of
from lfs10d.simulator.sensor import Sensor

ROOT = Path(__file__).parents[3]
VANE = load_profile("config/profiles/wind-vane.yaml", relative_to=ROOT)
LFS10 = load_profile("lfs10", relative_to=ROOT)
RTU = Codec(Framing.RTU)
AVERAGING = 0x0010
LONGEST = 60.0
"""Virtual seconds after which an access counts as endless."""


@dataclass
class Rig:
    """A line with a wind vane at id 7, which has one setting, 1 to 60 at 0x0010; `polled` if a poller asks it too."""

    echo: Literal["auto", "on", "off"] = "off"
    adapter_echoes: bool = False
    polled: bool = False
    ended: list[Access] = field(default_factory=list)
    events: list[Event] = field(default_factory=list)
    clock: VirtualClock = field(default_factory=VirtualClock)

    def __post_init__(self) -> None:
        self.vane = Sensor(7, blueprint=blueprint_of(VANE))
        self.line = SimulatedLine([self.vane], seed=1)
        self.port = SimulatedPort(self.line, self.clock, PortSettings("/dev/sim"), echo=self.adapter_echoes)
        self.bus = Bus(self.port, LineRules(echo=self.echo), self.clock)
        self.scheduler = Scheduler(self.bus.line_timing, 0.0)
        self.poller = Poller(self.bus, self.scheduler, self.events.extend, self.clock)
        if self.polled:
            self.poller.replace([DeviceSpec("vane", 7, VANE, RTU, 0.25)], PollRules())

    def begin(self, what: Request, profile: Profile | None = VANE, timeout: float | None = None) -> Access:
        access = Access(
            Target(what.slave, RTU, profile, timeout),
            what,
            pending=self.scheduler.pending,
            echo_known=lambda: self.bus.echo is not Echo.UNKNOWN,
            over=self.ended.append,
        )
        self.poller.submit(access)
        return access

    def pass_time(self, seconds: float) -> None:
        run(self.poller.turn, self.port, self.clock, self.clock.now + seconds)

    def do(self, what: Request, profile: Profile | None = VANE, timeout: float | None = None) -> Access:
        """Have it done; it is told once that it is over, and the judge of the line has nothing to say."""
        access = self.begin(what, profile, timeout)
        while access.end is None:
            assert self.clock.now < LONGEST, "the access does not end"
            self.pass_time(0.05)
        assert self.ended.count(access) == 1
        assert self.line.judge.violations == 0
        return access

    @property
    def asked(self) -> list[bytes]:
        """What the access asked, without slave id and check."""
        return [each.sent[1:-2] for each in self.exchanges]

    @property
    def exchanges(self) -> list[Exchanged]:
        return [each for each in self.events if isinstance(each, Exchanged) and each.purpose is Purpose.REQUEST]

    @property
    def writes(self) -> list[bytes]:
        return [each for each in self.asked if each[:1] == b"\x06"]


def write(value: int = 10, address: int = AVERAGING, slave: int = 7) -> WriteRegister:
    return WriteRegister(slave, address, value)


def read(address: int = AVERAGING, count: int = 1, slave: int = 7) -> ReadRegisters:
    return ReadRegisters(slave, address, count)


# -- reading


def test_registers_are_read_as_they_are() -> None:
    rig = Rig()
    rig.vane.words[AVERAGING] = 17
    access = rig.do(read())
    assert (access.end, access.registers, access.fault, access.sent) == (End.DONE, (17,), None, False)
    assert rig.asked == [bytes.fromhex("03 0010 0001")]


def test_a_register_that_does_not_exist_is_refused_at_once() -> None:
    rig = Rig()
    access = rig.do(read(0x0999))
    assert (access.end, access.registers) == (End.REFUSED, None)
    assert access.fault is not None
    assert access.fault.exception_code == 2
    assert len(rig.asked) == 1


@pytest.mark.parametrize("profile", [VANE, None])
def test_a_silent_slave_is_asked_with_growing_patience(profile: Profile | None) -> None:
    rig = Rig()
    rig.vane.add_fault("silent")
    access = rig.do(read(), profile)
    assert (access.end, access.sent) == (End.UNANSWERED, False)
    assert access.fault is not None
    assert access.fault.code is FaultCode.TIMEOUT
    waited = [each.at - each.asked for each in rig.exchanges]
    assert waited == pytest.approx([0.2, 0.4, 1.0], abs=0.02)


def test_a_fixed_time_out_holds_for_every_try() -> None:
    rig = Rig()
    rig.vane.add_fault("silent")
    rig.do(read(), timeout=0.3)
    assert [each.at - each.asked for each in rig.exchanges] == pytest.approx([0.3] * 3, abs=0.02)


def test_noise_is_asked_again_and_told_as_what_it_is() -> None:
    rig = Rig()
    rig.vane.add_fault("noisy")
    access = rig.do(read())
    assert access.end is End.UNANSWERED
    assert access.fault is not None
    assert access.fault.code is FaultCode.CRC
    assert len(rig.asked) >= 3


def test_a_busy_slave_is_asked_later_and_told_as_busy() -> None:
    rig = Rig()
    rig.vane.add_fault("exception", code=6, last=0.2)
    assert rig.do(read()).end is End.DONE
    assert rig.exchanges[1].asked - rig.exchanges[0].at > 0.29
    rig.vane.add_fault("exception", code=6)
    access = rig.do(read(), None)
    assert (access.end, access.fault and access.fault.busy) == (End.BUSY, True)


def test_which_exception_means_busy_is_the_profiles_word() -> None:
    rig = Rig()
    rig.vane.add_fault("exception", code=6)
    assert rig.do(read(), VANE.model_copy(update={"busy_exceptions": (5,)})).end is End.REFUSED


def test_an_answer_that_comes_too_late_never_passes_for_the_next_one() -> None:
    rig = Rig()
    rig.vane.words[AVERAGING] = 17
    rig.vane.add_fault("late", delay=0.35, last=0.1)
    access = rig.do(read(0x07D0))
    assert (access.end, access.registers) == (End.DONE, (7,))
    assert rig.asked[1] == bytes.fromhex("03 0000 0002")  # another shape: the barrier is as long as what is read


def test_a_slave_without_a_known_second_shape_is_left_alone_until_nothing_can_come() -> None:
    rig = Rig()
    rig.vane.add_fault("late", delay=0.35, last=0.1)
    assert rig.do(read(), None).registers == (1,)
    first, second = rig.exchanges
    assert second.asked - first.at > 0.75
    assert second.late == 0


def test_the_values_shape_is_asked_by_the_barrier_first() -> None:
    rig = Rig()
    rig.vane.add_fault("silent", last=0.1)
    assert rig.do(read(0x0000, 2)).end is End.DONE
    assert rig.asked[1:2] == [bytes.fromhex("03 07D0 0001")]


def test_a_profile_without_a_barrier_lends_the_shape_of_a_poll() -> None:
    rig = Rig()
    rig.vane.add_fault("silent", last=0.1)
    assert rig.do(read(), VANE.model_copy(update={"barrier": None})).end is End.DONE
    assert rig.asked[1:2] == [bytes.fromhex("03 0000 0002")]


def test_two_shapes_unanswered_leave_nothing_to_ask_for_a_while() -> None:
    rig = Rig()
    rig.vane.add_fault("silent", last=0.5)
    assert rig.do(read()).end is End.DONE
    assert rig.asked[:3] == [bytes.fromhex(each) for each in ("03 0010 0001", "03 0000 0002", "03 0010 0001")]
    assert rig.exchanges[2].asked - rig.exchanges[1].asked > 0.75


# -- writing


def test_a_write_is_read_back() -> None:
    rig = Rig()
    access = rig.do(write(10))
    assert (access.end, access.before, access.registers, access.sent) == (End.DONE, 1, (10,), True)
    assert rig.asked == [bytes.fromhex(each) for each in ("03 0010 0001", "06 0010 000A", "03 0010 0001")]
    assert rig.vane.words[AVERAGING] == 10


@pytest.mark.parametrize("adapter_echoes", [False, True])
def test_no_write_goes_out_before_three_reads_have_told_whether_the_adapter_echoes(*, adapter_echoes: bool) -> None:
    rig = Rig(echo="auto", adapter_echoes=adapter_echoes)
    assert rig.do(write(10)).end is End.DONE
    assert [each[0] for each in rig.asked] == [3, 3, 3, 6, 3]


def test_where_the_echo_cannot_be_learned_nothing_is_written() -> None:
    rig = Rig(echo="auto")
    access = rig.begin(write())
    access._echo_known = lambda: False
    rig.pass_time(5.0)
    assert (access.end, access.sent, rig.writes) == (End.ECHO_UNKNOWN, False, [])
    assert len(rig.asked) == 1 + ECHO_READS


def test_a_slave_that_falls_silent_while_the_echo_is_learned_is_not_written() -> None:
    rig = Rig(echo="auto")
    rig.vane.add_fault("silent", first=0.04)
    access = rig.do(write())
    assert (access.end, access.sent, access.before, rig.writes) == (End.UNANSWERED, False, 1, [])


def test_a_silent_slave_is_not_written() -> None:
    rig = Rig()
    rig.vane.add_fault("silent")
    access = rig.do(write())
    assert (access.end, access.sent, rig.writes) == (End.UNANSWERED, False, [])


def test_a_busy_slave_is_not_written() -> None:
    rig = Rig()
    rig.vane.add_fault("exception", code=6)
    access = rig.do(write())
    assert (access.end, access.sent, rig.writes) == (End.BUSY, False, [])


def test_a_register_that_cannot_be_read_is_written_and_the_refusal_told() -> None:
    rig = Rig()
    access = rig.do(write(address=0x0999))
    assert (access.end, access.sent, access.before) == (End.REFUSED, True, None)
    words = "exception 02 illegal register address, writing 0x000A to 0x0999"
    assert access.fault == Fault(FaultCode.EXCEPTION, words, 2, access.fault.heard)  # type: ignore[union-attr]  # equal to a Fault it is one


def test_a_register_that_can_be_written_but_not_read_is_not_verified() -> None:
    rig = Rig(echo="auto")
    del rig.vane.words[AVERAGING]
    rig.vane._write = lambda body, *_: body  # type: ignore[method-assign]  # a device of a kind nobody simulates
    access = rig.do(write())
    assert (access.end, access.sent, access.registers) == (End.NOT_VERIFIED, True, None)


def test_a_write_that_is_answered_busy_is_not_tried_again() -> None:
    rig = Rig()
    rig.vane.add_fault("exception", code=6, first=0.03)
    access = rig.do(write())
    assert (access.end, access.sent, len(rig.writes)) == (End.BUSY, True, 1)
    assert rig.asked[-1] == rig.writes[0]


def test_a_write_that_the_slave_confirms_but_does_not_make_is_not_verified() -> None:
    rig = Rig()
    rig.vane._write = lambda body, *_: body  # type: ignore[method-assign]  # as a register locked by a key switch
    access = rig.do(write(10))
    assert (access.end, access.registers, access.fault) == (End.NOT_VERIFIED, (1,), None)
    assert (len(rig.writes), len(rig.asked)) == (1, 2 + DIFFERING)


@pytest.mark.parametrize("kind", ["echo_losing", "wrong_echo"])
def test_a_write_without_its_answer_is_sent_once_and_read_back(kind: str) -> None:
    rig = Rig()
    rig.vane.add_fault(kind)
    access = rig.do(write(10))
    assert (access.end, access.registers, len(rig.writes)) == (End.DONE, (10,), 1)


def test_a_slave_that_stores_slowly_is_asked_until_it_answers() -> None:
    rig = Rig()
    rig.vane.add_fault("slow_flash", delay=4.0)
    access = rig.do(write(10))
    assert (access.end, access.registers, len(rig.writes)) == (End.DONE, (10,), 1)


def test_a_slave_silent_after_a_write_is_given_up_after_a_while() -> None:
    rig = Rig()
    rig.vane.add_fault("slow_flash", delay=60.0)
    access = rig.do(write(10))
    assert (access.end, access.sent, access.registers) == (End.UNANSWERED, True, None)
    assert VERIFY_WITHIN < rig.clock.now < VERIFY_WITHIN + 3


def test_a_lost_port_ends_it_and_says_whether_a_write_was_sent() -> None:
    rig = Rig()
    rig.vane.add_fault("slow_flash", delay=60.0)
    access = rig.begin(write(10))
    rig.pass_time(0.5)
    rig.port.unplug()
    rig.pass_time(0.5)
    assert (access.end, access.sent, access.fault) == (End.CUT_OFF, True, None)
    second = rig.do(read())
    assert (second.end, second.sent) == (End.CUT_OFF, False)


def test_nobody_polls_the_slave_between_a_write_and_its_verification() -> None:
    rig = Rig(polled=True)
    rig.pass_time(2.0)
    begun = len(rig.events)
    rig.vane.add_fault("slow_flash", delay=1.0)
    rig.do(write(10))
    assert {each.purpose for each in rig.events[begun:] if isinstance(each, Exchanged)} == {Purpose.REQUEST}
    rig.vane.clear_faults()
    rig.pass_time(1.0)
    assert [each.fault for each in rig.events if isinstance(each, Reading)][-1] is None


def test_an_access_rests_without_asking_while_it_waits() -> None:
    rig = Rig()
    access = rig.begin(read())
    access._rest_until = 5.0
    assert access.ask(4.9) == Hold(5.0)
