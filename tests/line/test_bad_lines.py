"""One scenario, a family of bad lines: no wrong value, a code for each fault, silence kept, one reading per poll."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from lfs10d.line.device import PollRules
from lfs10d.modbus.bus import LineRules
from lfs10d.reading import ALIVE_CODES, FaultCode
from lfs10d.simulator.line_faults import babble, second_master, stray
from lfs10d.simulator.sensor import Sensor
from tests.support.faulty_sensors import add_fault, power_cycle
from tests.support.lines import Rig, Rigs

LASTS = 40.0
"""Virtual seconds of one scenario."""
ILL = 2
"""The sensor that has the fault; 1, 3 and 4 are well."""
GOOD: frozenset[FaultCode] = frozenset()


@dataclass(frozen=True)
class Bad:
    """A fault of one sensor and what its polls may end with; with no codes they are all good."""

    kind: str
    codes: frozenset[FaultCode]
    rate: float = 1.0
    particulars: Mapping[str, float] = field(default_factory=dict)
    online: bool = False


def codes(*names: str) -> frozenset[FaultCode]:
    return frozenset(FaultCode(name) for name in names)


LATENESS = codes("timeout", "late", "malformed", "crc")
"""A late answer may run into the next request or its answer, and so be broken."""
FAMILY = {
    "silent": Bad("silent", codes("timeout")),
    "late by a little": Bad("late", LATENESS, particulars={"delay": 0.25}),
    "late by more than any time-out": Bad("late", LATENESS, particulars={"delay": 1.3}),
    "byte by byte": Bad("slow_bytes", GOOD, particulars={"delay": 0.004}, online=True),
    "a flipped bit": Bad("noisy", codes("crc")),
    "garbage": Bad("garbage", codes("crc")),
    "garbage that is too short": Bad("garbage", codes("malformed"), particulars={"length": 4}),
    "garbage that is too long": Bad("garbage", codes("crc"), particulars={"length": 60}),
    "cut short": Bad("truncated", codes("malformed"), particulars={"length": 5}),
    "another slave's id": Bad("wrong_id", codes("wrong_slave"), particulars={"value": 9}),
    "another function": Bad("wrong_function", codes("wrong_function")),
    "another count": Bad("wrong_count", codes("malformed", "late")),
    "noise before the answer": Bad("leading_noise", GOOD, online=True),
    "noise behind the answer": Bad("trailing_noise", GOOD, online=True),
    "not a number": Bad("nan", codes("not_finite"), online=True),
    "infinity": Bad("infinite", codes("not_finite"), online=True),
    "out of range": Bad("out_of_range", codes("out_of_range"), online=True),
    "subnormal": Bad("subnormal", codes("out_of_range"), online=True),
    "refuses": Bad("exception", codes("exception"), online=True),
    "busy": Bad("exception", codes("exception"), particulars={"code": 6}, online=True),
}


def told_once_per_poll(rig: Rig, slave: int, interval: float) -> None:
    """Hold readings and missed points together against the grid, while the device was online all the time."""
    readings = rig.of(slave)
    told = len(readings) + sum(reading.overruns for reading in readings)
    last = readings[-1].at  # what is missed behind it is told with the next one
    assert rig.clock.now - last < 2.0
    assert told == pytest.approx(last / interval, abs=2)


@pytest.mark.parametrize("name", FAMILY)
@pytest.mark.parametrize("fixed", [None, 0.2], ids=["learned", "fixed"])
def test_each_fault_of_a_sensor_has_its_code_and_spares_the_others(rigs: Rigs, name: str, fixed: float | None) -> None:
    bad = FAMILY[name]
    rig = rigs(4, interval=0.25, response_timeout=fixed)
    rig.run(2.0)
    add_fault(rig.line.sensor(ILL), bad.kind, bad.rate, **bad.particulars)
    rig.run(LASTS).prove()
    assert rig.codes(ILL, since=3.0).keys() <= bad.codes
    if bad.codes != LATENESS:  # that is learned
        assert bool(rig.good(ILL, since=3.0)) is not bool(bad.codes)
        assert rig.of(ILL)[-1].online is bad.online
    if bad.online:
        told_once_per_poll(rig, ILL, 0.25)
    for well in (1, 3, 4):
        assert rig.codes(well).total() <= (2 if bad.kind == "late" else 0)
        told_once_per_poll(rig, well, 0.25)


@pytest.mark.parametrize("name", FAMILY)
def test_a_fault_in_a_third_of_the_answers_never_yields_a_wrong_value(rigs: Rigs, name: str) -> None:
    bad = FAMILY[name]
    rig = rigs(3, interval=0.0, rules=PollRules(retries=0), in_turn=True)
    for sensor in rig.line.sensors:
        add_fault(sensor, bad.kind, 0.33, **bad.particulars)
    rig.run(15.0).prove()
    assert all(rig.good(slave) for slave in (1, 2, 3))
    seen = {code for slave in (1, 2, 3) for code in rig.codes(slave)}
    assert seen <= bad.codes | {FaultCode.TIMEOUT, FaultCode.LATE}


def test_a_busy_sensor_stays_online_and_is_no_error_of_the_line(rigs: Rigs) -> None:
    rig = rigs(1, interval=0.25)
    add_fault(rig.line.sensor(1), "exception", code=6)
    rig.run(10.0).prove()
    assert all(reading.fault and reading.fault.busy and reading.online for reading in rig.of(1))


def test_a_sensor_that_hangs_is_offline_until_its_power_is_cycled(rigs: Rigs) -> None:
    rig = rigs(2, interval=0.25)
    rig.run(5.0)
    add_fault(rig.line.sensor(1), "exception")
    add_fault(rig.line.sensor(1), "hangs")
    rig.run(20.0)
    assert not rig.of(1)[-1].online
    rig.line.sensor(1).faults.clear()
    power_cycle(rig.line.sensor(1))
    rig.run(40.0).prove()
    assert rig.good(1, since=37.0)
    assert not rig.codes(2)


@pytest.mark.parametrize("echo", ["auto", "on", "off"])
@pytest.mark.parametrize("has_echo", [True, False])
def test_an_adapter_with_or_without_echo(rigs: Rigs, echo: str, *, has_echo: bool) -> None:
    rules = LineRules(echo="on" if echo == "on" else "off" if echo == "off" else "auto")
    rig = rigs(2, interval=0.25, echo=has_echo, line_rules=rules).run(20.0).prove()
    if echo == "on" and not has_echo:
        return  # what the configuration says wrongly need not work, but yields no wrong value
    assert len(rig.good(1)) >= 79
    if echo == "auto":
        assert rig.poller.bus.echo.value == ("on" if has_echo else "off")


@pytest.mark.parametrize("latency", [0.001, 0.004, 0.016])
@pytest.mark.parametrize("echo", [True, False])
def test_an_adapter_that_delivers_in_pieces(rigs: Rigs, latency: float, *, echo: bool) -> None:
    rig = rigs(4, interval=0.25, latency=latency, echo=echo).run(30.0).prove()
    assert not any(rig.codes(slave) for slave in (1, 2, 3, 4))
    assert rig.line.judge.counts["gap"] == 0
    told_once_per_poll(rig, 1, 0.25)


def test_while_the_line_babbles_nothing_is_sent_and_every_poll_is_a_collision(rigs: Rigs) -> None:
    rig = rigs(2, interval=0.25)
    babble(rig.line, 5.0, 15.0)
    rig.run(14.9)
    sent = rig.sent
    assert rig.codes(1, since=5.5).keys() <= codes("collision")
    assert sent == sum(request.begun < 5.01e9 for request in rig.line.log if request.speaker == "master")
    rig.run(40.0).prove()
    assert rig.good(1, since=20.0)
    assert rig.good(2, since=20.0)


def test_stray_bytes_after_requests_cost_no_value(rigs: Rigs) -> None:
    rig = rigs(3, interval=0.25)
    stray(rig.line, 0.3, length=2, delay=0.002)
    rig.run(LASTS).prove()
    assert not any(rig.codes(slave) for slave in (1, 2, 3))
    assert sum(exchange.unsolicited for exchange in rig.exchanges) > 50


def test_a_second_master_never_makes_a_wrong_value(rigs: Rigs) -> None:
    rig = rigs(4, interval=0.25)
    second_master(rig.line, bytes((3, 3, 0, 1, 0, 2)), 1.0, 0.37)
    rig.run(LASTS).prove()
    for slave in (1, 2, 3, 4):
        assert len(rig.good(slave)) > 100


def test_two_sensors_with_one_id_yield_no_value_but_where_they_do_not_collide(rigs: Rigs) -> None:
    rig = rigs(2, interval=0.25)
    rig.line.add(Sensor(1, turnaround=0.006))
    rig.run(LASTS).prove()
    assert rig.codes(1)[FaultCode.CRC] > 0
    assert not rig.good(1, since=1.0)
    assert not rig.codes(2)


def test_an_adapter_that_is_pulled_out_in_the_middle_of_a_request(rigs: Rigs) -> None:
    rig = rigs(3, interval=0.25)
    for n in range(12):
        rig.run(2.0 + 2 * n + 0.0021 * n)
        rig.port.unplug()
        rig.run(2.6 + 2 * n)
        rig.port.replug()
    rig.run(LASTS).prove()
    assert rig.codes(1)[FaultCode.PORT_LOST] == 12
    assert rig.good(1, since=28.0)


KINDS = sorted({bad.kind for bad in FAMILY.values()} - {"wrong_id"})
"""All but one: another slave's id in a late answer makes a frame that nobody can tell from that slave's own."""


@given(
    st.lists(
        st.lists(st.tuples(st.sampled_from(KINDS), st.sampled_from([0.02, 0.2, 0.7]), st.floats(0.0, 0.9)), max_size=4),
        min_size=1,
        max_size=4,
    ),
    st.sampled_from([None, 0.05, 0.2, 0.5]),
    st.sampled_from([0.0, 0.25, 1.0]),
    st.booleans(),
    st.sampled_from([0.0, 0.0, 0.016]),
    st.integers(0, 2),
    st.integers(0, 1000),
)
@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_any_mix_of_faults_yields_no_wrong_value_and_always_a_code(
    rigs: Rigs,
    faults: list[list[tuple[str, float, float]]],
    fixed: float | None,
    interval: float,
    echo: bool,  # noqa: FBT001  # drawn
    latency: float,
    retries: int,
    seed: int,
) -> None:
    rig = rigs(
        len(faults),
        interval=interval,
        response_timeout=fixed,
        echo=echo,
        latency=latency,
        seed=seed,
        jitter=0.01,
        rules=PollRules(retries=retries),
        in_turn=True,
    )
    for sensor, kinds in zip(rig.line.sensors, faults, strict=True):
        for kind, rate, delay in kinds:
            add_fault(sensor, kind, rate, delay=delay if kind == "late" else 0.003)
    rig.run(12.0).prove()
    expected = codes("timeout", "late", "crc", "malformed", "wrong_slave", "wrong_function", "collision") | ALIVE_CODES
    for reading in rig.readings:
        assert reading.fault is None or reading.fault.code in expected
    assert all(rig.of(sensor.slave) for sensor in rig.line.sensors)
