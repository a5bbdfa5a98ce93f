"""The simulated port, and a master driven through virtual time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import pytest

from lfs10d.errors import PortBusyError, PortLostError
from lfs10d.modbus.port import Port
from lfs10d.modbus.port_settings import PortSettings
from lfs10d.reading import UartCounters
from lfs10d.simulator.line import SimulatedLine
from lfs10d.simulator.sensor import Sensor
from lfs10d.simulator.wire import Format, seal, unseal
from tests.support.simulated import Bench
from tests.support.virtual_port import SimulatedPort, VirtualClock, format_of, run

Maker = Callable[..., Bench]

REQUEST = seal(bytes.fromhex("010300050001"))
SENT = 8 / 960
ANSWERED = 8 / 960 + 0.005 + 7 / 960


@dataclass(frozen=True)
class Until:
    """What a turn returns."""

    until: float
    listen: bool = True


@dataclass(frozen=True)
class UntilNotBefore(Until):
    """The same, but bytes alone do not make it due before some time."""

    not_before: float = 0.0


def test_it_is_a_port() -> None:
    port: Port = SimulatedPort(SimulatedLine(), VirtualClock(), PortSettings("sim"))
    assert port.fileno() == -1
    port.open()
    assert port.fileno() > 1023


@pytest.mark.parametrize(
    ("settings", "shape"),
    [
        (PortSettings("sim"), Format()),
        (PortSettings("sim", baudrate=19200, parity="even"), Format(19200, 8, "even")),
        (PortSettings("sim", parity="odd", databits=7, stopbits=2), Format(9600, 7, "odd", 2)),
    ],
)
def test_the_settings_tell_how_characters_look(settings: PortSettings, shape: Format) -> None:
    assert format_of(settings) == shape


def test_low_latency_is_reported_where_it_was_asked_for_and_confirmed() -> None:
    for asked, confirmed, latency in ((True, True, 0.004), (True, False, 0.020), (False, True, 0.020)):
        settings = PortSettings("sim", low_latency=asked)
        port = SimulatedPort(SimulatedLine(), VirtualClock(), settings, confirmed=confirmed)
        port.open()
        assert port.adapter_latency == latency


def test_every_call_on_a_closed_port_is_port_lost(bench: Maker) -> None:
    port = bench(Sensor(1)).port
    port.close()
    calls: list[Callable[[], object]] = [
        port.read, port.waiting, port.drain, port.flush, lambda: port.write(b"x"),
        lambda: port.reconfigure(port.settings),
    ]  # fmt: skip
    for call in calls:
        with pytest.raises(PortLostError):
            call()


def test_an_unplugged_port_cannot_be_opened_until_it_is_plugged_in(bench: Maker) -> None:
    line = bench(Sensor(1))
    line.port.unplug()
    with pytest.raises(PortLostError):
        line.port.read()
    line.port.close()
    with pytest.raises(PortLostError):
        line.port.open()
    line.port.replug()
    line.port.open()
    assert line.id_of(1) == 1
    assert line.port.openings == 2


def test_a_hung_up_port_can_be_opened_at_once(bench: Maker) -> None:
    line = bench(Sensor(1))
    line.port.hang_up()
    with pytest.raises(PortLostError):
        line.port.waiting()
    line.port.close()
    line.port.open()
    assert line.id_of(1) == 1


def test_a_locked_port_is_busy(bench: Maker) -> None:
    port = bench().port
    port.close()
    port.locked = True
    with pytest.raises(PortBusyError):
        port.open()


def test_what_arrives_while_closed_is_lost(bench: Maker) -> None:
    line = bench(Sensor(1))
    line.port.write(REQUEST)
    line.port.close()
    line.clock.now += 1
    line.port.open()
    assert line.port.read() == b""


def test_waiting_counts_and_flush_discards(bench: Maker) -> None:
    line = bench(Sensor(1))
    line.port.write(REQUEST)
    line.clock.now += 0.1
    assert line.port.waiting() == 7
    assert line.port.next_event() == line.clock.now
    line.port.flush()
    assert line.port.read() == b""


def test_drain_lasts_until_the_last_bit_is_out(bench: Maker) -> None:
    line = bench(Sensor(1))
    line.port.write(REQUEST)
    line.port.drain()
    assert line.clock() == pytest.approx(1.0 + SENT)


def test_with_echo_the_own_bytes_come_first(bench: Maker) -> None:
    line = bench(Sensor(1), echo=True)
    line.port.write(REQUEST)
    heard = line.listen(0.1)
    assert heard[:8] == REQUEST
    assert unseal(heard[8:]) == bytes.fromhex("0103020001")


def test_at_another_rate_a_sensor_is_found_where_it_is(bench: Maker) -> None:
    line = bench(Sensor(1, format=Format(19200)))
    assert line.id_of(1) is None
    line.port.reconfigure(replace(line.port.settings, baudrate=19200))
    assert line.port.settings.baudrate == 19200
    assert line.id_of(1) == 1


def test_a_change_of_rate_under_the_own_bytes_spoils_them(bench: Maker) -> None:
    line = bench(Sensor(1))
    line.port.write(REQUEST)
    line.clock.now += 0.002
    line.port.reconfigure(replace(line.port.settings, baudrate=19200))
    line.listen(0.1)
    assert line.line.judge.counts["struck"] == 1


def test_settings_without_another_format_spoil_nothing(bench: Maker) -> None:
    line = bench(Sensor(1))
    line.port.write(REQUEST)
    line.port.reconfigure(replace(line.port.settings, low_latency=False))
    assert line.listen(0.1) != b""


def test_the_driver_counts_bytes_at_another_rate_or_nothing(bench: Maker) -> None:
    line = bench()
    line.line.speak("noise", b"abc", 1_000_000_000, Format(19200))
    line.listen(1.0)
    assert line.port.counters() == UartCounters(3, 0, 0, 0)
    line.port.counts = False
    assert line.port.counters() is None


def test_the_next_event_is_never_in_the_past(bench: Maker) -> None:
    line = bench(Sensor(1))
    assert line.port.next_event() is None
    line.port.write(REQUEST)
    assert line.port.next_event() == pytest.approx(1.0 + SENT)
    line.clock.now += 5.0
    assert line.port.next_event() == line.clock.now


def test_a_turn_that_listens_is_due_at_each_byte(bench: Maker) -> None:
    line = bench(Sensor(1))
    line.port.write(REQUEST)
    turns: list[tuple[float, int]] = []

    def turn(now: float) -> Until:
        turns.append((now, len(line.port.read())))
        return Until(1.5)

    run(turn, line.port, line.clock, 1.5)
    assert [count for _, count in turns] == [0] + [1] * 7
    assert turns[-1][0] == pytest.approx(1.0 + ANSWERED)
    assert line.clock.now == 1.5


def test_a_turn_may_sleep_through_the_rest_of_an_answer(bench: Maker) -> None:
    line = bench(Sensor(1))
    line.port.write(REQUEST)
    turns: list[int] = []

    def turn(now: float) -> Until:
        del now
        turns.append(len(line.port.read()))
        return UntilNotBefore(1.5, not_before=1.03)

    run(turn, line.port, line.clock, 1.4)
    assert turns == [0, 7]


def test_a_turn_that_does_not_listen_sleeps(bench: Maker) -> None:
    line = bench(Sensor(1))
    line.port.write(REQUEST)
    times: list[float] = []

    def turn(now: float) -> Until:
        times.append(now)
        return Until(now + 0.25, listen=False)

    run(turn, line.port, line.clock, 2.0)
    assert times == [1.0, 1.25, 1.5, 1.75]


def test_a_listening_turn_is_due_when_the_port_hangs_up(bench: Maker) -> None:
    line = bench(Sensor(1))
    line.line.at(1.2, lambda _: line.port.hang_up())
    lost: list[float] = []

    def turn(now: float) -> Until:
        try:
            line.port.read()
        except PortLostError:
            lost.append(now)
            line.port.close()
        return Until(3.0)

    run(turn, line.port, line.clock, 3.0)
    assert lost == [1.2]


def test_while_closed_no_byte_makes_a_turn_due(bench: Maker) -> None:
    line = bench(Sensor(1))
    line.port.write(REQUEST)
    line.port.close()
    times: list[float] = []

    def turn(now: float) -> Until:
        times.append(now)
        return Until(2.0)

    run(turn, line.port, line.clock, 2.0)
    assert times == [1.0]


def test_a_turn_always_due_is_reported(bench: Maker) -> None:
    line = bench()
    with pytest.raises(RuntimeError, match="stands still"):
        run(Until, line.port, line.clock, 2.0)


def test_a_hung_up_port_makes_every_turn_due(bench: Maker) -> None:
    line = bench()
    line.port.hang_up()
    assert line.port.arrival(5.0) == line.clock.now
