"""The bus obeys one order at a time, looks before it speaks, and opens its port again."""

from __future__ import annotations

from dataclasses import replace
from math import inf

import pytest

from lfs10d.errors import PortBusyError, PortGoneError, PortLostError
from lfs10d.modbus.ask import Ask
from lfs10d.modbus.bus import AWAKE_BEFORE, RATE_SETTLE, REOPEN_FIRST, UNHURRIED_AFTER, Bus, LineRules, Wait
from lfs10d.modbus.echo import Echo
from lfs10d.modbus.frames import Codec, Framing
from lfs10d.modbus.outcome import Outcome
from lfs10d.modbus.port_settings import PortSettings
from lfs10d.modbus.request import ReadRegisters, WriteRegister
from lfs10d.modbus.timing import LineTiming
from lfs10d.reading import FaultCode, PortChanged, UartCounters

RTU = Codec(Framing.RTU)
WIND = ReadRegisters(1, 0x0001, 2)
REQUEST = RTU.encode(WIND)
ANSWER = bytes.fromhex("010304414FD70A002F")
SETTINGS = PortSettings("/dev/line")
T9600, T19200 = LineTiming.of(9600), LineTiming.of(19200)
READ = Ask(WIND, RTU, 0.2)


class Clock:
    """A clock that the test moves."""

    def __init__(self) -> None:
        self.now = 100.0

    def __call__(self) -> float:
        return self.now


class FakePort:
    """A port whose bytes and troubles the test hands out; `calls` is what was done to it."""

    def __init__(self) -> None:
        self.settings = SETTINGS
        self.adapter_latency = 0.004
        self.paced = True
        self.calls: list[str] = []
        self.written: list[bytes] = []
        self.incoming = b""
        self.trouble: Exception | None = None

    def _do(self, call: str) -> None:
        self.calls.append(call)
        if self.trouble is not None:
            raise self.trouble

    def open(self) -> None:
        self._do(f"open {self.settings.path} {self.settings.baudrate}")

    def close(self) -> None:
        self.calls.append("close")

    def fileno(self) -> int:
        return 3

    def write(self, frame: bytes) -> None:
        self._do("write")
        self.written.append(frame)

    def read(self) -> bytes:
        self._do("read")
        data, self.incoming = self.incoming, b""
        return data

    def waiting(self) -> int:
        self._do("waiting")
        return len(self.incoming)

    def drain(self) -> None:
        self._do("drain")

    def flush(self) -> None:
        self._do("flush")

    def reconfigure(self, settings: PortSettings) -> None:
        self._do(f"reconfigure {settings.baudrate}")
        self.settings = settings

    def counters(self) -> UartCounters | None:
        self._do("counters")
        return UartCounters(1, 2, 3, 4)


class Rig:
    """A bus on a fake port."""

    def __init__(self, rules: LineRules | None = None) -> None:
        self.clock = Clock()
        self.port = FakePort()
        self.bus = Bus(self.port, rules or LineRules(), self.clock)

    def opened(self) -> Rig:
        assert self.bus.reopen(self.clock.now) == PortChanged(self.clock.now, None)
        return self

    def step(self, after: float = 0.0, incoming: bytes = b"") -> Wait | Outcome | PortChanged:
        self.clock.now += after
        self.port.incoming += incoming
        return self.bus.step(self.clock.now, readable=bool(incoming))

    def waits(self, after: float = 0.0) -> float:
        """Take a step and return for how long it wants to wait."""
        wait = self.step(after)
        assert isinstance(wait, Wait)
        return wait.until - self.clock.now

    def carry_out(self, ask: Ask, answer: bytes = ANSWER) -> Outcome:
        """Carry out an order that is answered after 20 ms."""
        self.bus.ask(ask, {})
        while not self.port.written:
            waited = self.step(0.001)
            assert isinstance(waited, Wait)
        self.port.written.clear()
        outcome = self.step(0.03, answer)
        assert isinstance(outcome, Outcome)
        return outcome


@pytest.fixture
def rig() -> Rig:
    return Rig().opened()


def test_at_rest_it_listens(rig: Rig) -> None:
    assert rig.bus.asked is None
    assert rig.step() == Wait(inf, listen=True)


def test_an_order_waits_for_silence_is_sent_and_answered(rig: Rig) -> None:
    rig.bus.ask(READ, {})
    assert rig.bus.asked is not None
    assert rig.step() == Wait(100.0 + T9600.gap, listen=True)
    wait = rig.step(T9600.gap)
    assert rig.port.written == [REQUEST]
    assert isinstance(wait, Wait)
    assert wait.listen
    begun = rig.step(0.02, ANSWER[:4])
    assert isinstance(begun, Wait)
    assert begun.not_before == pytest.approx(rig.clock.now + 5 * T9600.character - AWAKE_BEFORE)
    outcome = rig.step(0.006, ANSWER[4:])
    assert isinstance(outcome, Outcome)
    assert outcome.answer == (0x414F, 0xD70A)
    assert rig.bus.asked is None


def test_where_nobody_waits_it_looks_once_when_all_of_the_answer_is_there(rig: Rig) -> None:
    rig.bus.ask(READ, {}, hurried=False)
    assert rig.step() == Wait(100.0 + T9600.gap, listen=True, hurried=False)
    assert rig.step(T9600.gap) != Wait(inf, listen=True)
    begun = rig.step(0.02, ANSWER[:4])
    assert isinstance(begun, Wait)
    assert begun.not_before == pytest.approx(rig.clock.now + 5 * T9600.character + UNHURRIED_AFTER)
    assert not begun.hurried


def test_it_knows_until_when_a_request_is_on_the_wire(rig: Rig) -> None:
    assert rig.bus.speaking_until < rig.clock.now
    rig.bus.ask(READ, {})
    rig.step()
    rig.step(T9600.gap)
    assert rig.bus.speaking_until == pytest.approx(rig.clock.now + T9600.transmission(len(REQUEST)))


def test_bytes_that_nobody_asked_for_restart_the_silence(rig: Rig) -> None:
    assert rig.step(1.0, b"\xff\xff") == Wait(inf, listen=True)
    assert rig.bus.unsolicited == 2
    rig.bus.ask(READ, {})
    assert rig.step(0.001) == Wait(101.0 + T9600.gap, listen=True)


def test_it_looks_once_more_before_it_speaks(rig: Rig) -> None:
    rig.bus.ask(READ, {})
    rig.step()
    rig.clock.now += T9600.gap
    rig.port.incoming = b"\xff"
    wait = rig.bus.step(rig.clock.now, readable=False)
    assert rig.port.written == []
    assert wait == Wait(rig.clock.now + T9600.gap, listen=True)


def test_the_echo_is_learned_from_reads_alone(rig: Rig) -> None:
    states = [rig.bus.echo]
    for _ in range(3):
        rig.carry_out(replace(READ, request=WriteRegister(1, 4, 1)), RTU.encode(WriteRegister(1, 4, 1)) * 2)
    states.append(rig.bus.echo)
    for _ in range(3):
        rig.carry_out(READ, REQUEST + ANSWER)
    assert [*states, rig.bus.echo] == [Echo.UNKNOWN, Echo.UNKNOWN, Echo.ON]


def test_another_rate_is_drained_flushed_and_begun_after_the_slower_gap(rig: Rig) -> None:
    rig.carry_out(READ)
    rig.port.calls.clear()
    rig.bus.ask(replace(READ, baudrate=19200), {})
    heard = rig.clock.now
    assert rig.step(0.001) == Wait(heard + RATE_SETTLE, listen=True)
    assert rig.waits(0.004) == pytest.approx(RATE_SETTLE + T9600.gap)
    assert rig.port.calls == ["drain", "reconfigure 19200", "flush"]
    rig.step(RATE_SETTLE + T9600.gap)
    assert rig.port.written == [REQUEST]
    assert isinstance(rig.step(0.02, ANSWER), Outcome)
    rig.bus.ask(replace(READ, baudrate=19200), {})
    assert rig.waits() == pytest.approx(T19200.gap)
    assert rig.bus.line_timing == T9600


def test_its_own_rate_by_number_is_its_own_rate(rig: Rig) -> None:
    rig.carry_out(replace(READ, baudrate=9600))
    assert "drain" not in rig.port.calls


@pytest.mark.parametrize("trouble", [PortLostError("/dev/line", "gone"), PortBusyError("/dev/line", "taken")])
def test_the_loss_of_the_port_is_told_once_per_reason_and_it_is_opened_again(rig: Rig, trouble: Exception) -> None:
    rig.bus.ask(READ, {})
    rig.step()
    rig.port.trouble = trouble
    changed = rig.step(0.5)
    assert isinstance(changed, PortChanged)
    assert changed.fault is not None
    assert changed.fault.code is (FaultCode.PORT_LOST if isinstance(trouble, PortLostError) else FaultCode.PORT_BUSY)
    assert (rig.bus.open, rig.bus.asked) == (False, None)
    lost = rig.clock.now
    assert rig.bus.reopen(lost) == Wait(lost + REOPEN_FIRST, listen=False)
    rig.clock.now += REOPEN_FIRST
    assert rig.bus.reopen(rig.clock.now) == Wait(rig.clock.now + 0.2, listen=False)
    rig.clock.now += 0.2
    assert rig.bus.reopen(rig.clock.now) == Wait(rig.clock.now + 0.4, listen=False)
    rig.port.trouble = PortLostError("/dev/line", "another reason")
    rig.clock.now += 0.4
    assert isinstance(rig.bus.reopen(rig.clock.now), PortChanged)
    rig.port.trouble = None
    rig.clock.now += 0.8
    rig.opened()
    assert rig.bus.open


def test_an_adapter_that_is_unplugged_is_one_loss_each_time_until_the_reason_is_another(rig: Rig) -> None:
    absent = PortGoneError("tty", "absent")
    told = []
    for later in ([absent, absent], [absent, PortLostError("tty", "denied"), absent, PortGoneError("tty", "silent")]):
        rig.port.trouble = PortGoneError("tty", "hung up")
        told.append(rig.step(0.5, b"\x00"))
        for rig.port.trouble in later:
            rig.clock.now += 1.0
            told.append(rig.bus.reopen(rig.clock.now))
        rig.port.trouble = None
        rig.clock.now += 1.0
        rig.opened()
    words = [step.fault.message[5:] for step in told if isinstance(step, PortChanged) and step.fault]
    assert words == ["hung up", "hung up", "denied", "absent", "silent"]


def test_a_port_that_is_lost_at_another_rate_comes_back_at_its_own(rig: Rig) -> None:
    rig.bus.ask(replace(READ, baudrate=19200), {})
    rig.step(0.01)
    assert rig.port.settings.baudrate == 19200
    rig.port.trouble = PortLostError("/dev/line", "gone")
    rig.step(0.01, b"\xff")
    rig.port.trouble = None
    rig.clock.now += 1.0
    rig.opened()
    assert rig.port.calls[-1] == "open /dev/line 9600"
    rig.bus.ask(READ, {})
    assert rig.waits() == pytest.approx(T9600.gap)


@pytest.mark.parametrize(
    ("settings", "reopens"),
    [
        (replace(SETTINGS, path="/dev/other"), True),
        (replace(SETTINGS, low_latency=False), True),
        (replace(SETTINGS, baudrate=19200), False),
    ],
)
def test_new_settings_reopen_the_port_only_where_they_must(rig: Rig, settings: PortSettings, *, reopens: bool) -> None:
    rig.bus.reconfigure(settings, LineRules(extra_gap=0.01), rig.clock.now)
    assert rig.bus.open is not reopens
    if reopens:
        rig.opened()
        assert rig.port.settings == settings
    assert rig.bus.line_timing == LineTiming.of(settings.baudrate, extra_gap=0.01)
    assert rig.carry_out(READ).gap == pytest.approx(rig.bus.line_timing.gap, abs=0.008)
    assert rig.port.settings == settings


def test_settings_may_change_while_the_port_is_lost(rig: Rig) -> None:
    rig.port.trouble = PortLostError("/dev/line", "gone")
    rig.step(0.0, b"\xff")
    rig.port.trouble = None
    rig.bus.reconfigure(replace(SETTINGS, path="/dev/other"), LineRules(echo="on"), rig.clock.now)
    rig.opened()
    assert rig.port.settings.path == "/dev/other"
    assert rig.bus.echo is Echo.ON


def test_counters_are_none_where_there_is_no_port(rig: Rig) -> None:
    assert rig.bus.counters() == UartCounters(1, 2, 3, 4)
    rig.port.trouble = PortLostError("/dev/line", "gone")
    assert rig.bus.counters() is None
    rig.bus.close()
    assert rig.bus.counters() is None


def test_a_babbling_line_ends_the_order_unsent(rig: Rig) -> None:
    rig.bus.ask(READ, {})
    told = [rig.step(0.002, b"\xff") for _ in range(120)]
    (collision,) = [each for each in told if isinstance(each, Outcome)]
    assert collision.fault is not None
    assert collision.fault.code is FaultCode.COLLISION
    assert rig.port.written == []
