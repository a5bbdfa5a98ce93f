"""A scan on a simulated line in virtual time: who is found, who is suspected, what it costs, and what others notice."""

from __future__ import annotations

import pytest

from lfs10d.line.jobs.identification import FoundDevice
from lfs10d.profiles.library import builtin_names
from lfs10d.simulator.blueprint import blueprint_of
from lfs10d.simulator.sensor import Sensor
from lfs10d.simulator.wire import Format
from tests.support.faulty_sensors import add_fault
from tests.support.scans import ALL, BUILTIN, PROFILES, by_id, found_ids, ill, line_of, scanned

# -- who is found


def test_every_sensor_is_found_with_id_rate_time_profile_and_value() -> None:
    done = scanned(line_of(1, 3, 200))
    assert found_ids(done.scan) == [1, 3, 200]
    for finding in done.scan.found:
        assert (finding.baudrate, finding.answers, finding.id_register) == (9600, True, finding.slave)
        assert finding.profile is PROFILES[0]
        assert set(finding.values) == {"wind_speed"}
        assert finding.rtt == pytest.approx(0.0206, abs=0.001)
        assert not finding.suspect
        assert not finding.duplicate


def test_nobody_is_found_on_an_empty_line() -> None:
    done = scanned(line_of())
    assert done.scan.found == ()
    assert done.scan.noise.last is None


def test_an_empty_line_takes_as_long_as_was_said_before() -> None:
    done = scanned(line_of())
    assert len(done.exchanges) == 255
    assert done.exchanges[-1].at == pytest.approx(done.scan.plan.expected, rel=0.02)


def test_sensors_are_found_at_each_rate() -> None:
    fast = Sensor(9, format=Format(19200))
    done = scanned(line_of(2, fast), range(1, 20), (9600, 19200))
    assert [(finding.slave, finding.baudrate) for finding in done.scan.found] == [(2, 9600), (9, 19200)]


def test_the_rate_is_changed_once_per_round_when_nobody_else_speaks() -> None:
    done = scanned(line_of(2), [1, 3, 250], (9600, 19200))
    rates = [round(8 * 10 / ((request.ended - request.begun) / 1e9)) for request in done.line.log if request.frame]
    assert rates == pytest.approx([9600, 9600, 19200, 19200, 9600, 19200], rel=0.01)


@pytest.mark.parametrize("turnaround", [0.09, 0.3, 0.62, 0.9])
def test_a_slow_sensor_is_found_though_it_is_not_waited_for(turnaround: float) -> None:
    done = scanned(line_of(Sensor(40, turnaround=turnaround), 41), range(30, 60))
    assert found_ids(done.scan) == [40, 41]
    assert by_id(done.scan)[40].rtt == pytest.approx(turnaround + 0.0156, abs=0.002)
    assert done.scan.noise.ids == 0


def test_a_slow_sensor_whose_answer_ran_into_the_next_request_is_found() -> None:
    done = scanned(line_of(Sensor(40, turnaround=0.108)), range(30, 60))
    assert found_ids(done.scan) == [40]


def test_a_sensor_that_refuses_everything_is_found() -> None:
    finding = by_id(scanned(line_of(ill(5, "exception")), range(1, 9)).scan)[5]
    assert (finding.answers, finding.profile, finding.exception) == (True, None, 2)


def test_a_sensor_whose_value_is_no_number_is_found_as_an_unknown_device() -> None:
    # Named an LFS10 before: by its id register alone.
    finding = by_id(scanned(line_of(ill(5, "nan")), range(1, 9)).scan)[5]
    assert (finding.answers, finding.profile, dict(finding.values)) == (True, None, {})


@pytest.mark.parametrize("rates", [(9600,), (4800, 9600)], ids=["one rate", "after another rate"])
def test_every_built_in_device_is_recognised_or_told_with_what_cannot_be_told_from_it(rates: tuple[int, ...]) -> None:
    """Small numbers are directions and wind speeds alike; devices 40 and 41 lack a register that is optional."""
    names = builtin_names()
    line = line_of(
        *(Sensor(10 + place, blueprint=blueprint_of(BUILTIN[name])) for place, name in enumerate(names)),
        Sensor(40, blueprint=blueprint_of(BUILTIN["pr-3000-fsjt"])),
        Sensor(41, blueprint=blueprint_of(BUILTIN["ecowitt-wn90lp"])),
    )
    sensors = {sensor.slave: sensor for sensor in line.sensors}
    add_fault(sensors[40], "absent", values=("wind_force",))
    add_fault(sensors[41], "absent", values=("rain_counter",))
    found = by_id(scanned(line, range(1, 50), rates).scan)
    told = {str(names[slave - 10] if slave < 30 else slave): _names(finding) for slave, finding in found.items()}
    sure = {name: [name] for name in ("lfs10", "ld-e", "fuling-dzb", "eh600", "ecowitt-wn90lp", "dfrobot-sen0483")}
    assert told == {
        **sure,
        "renke-rs-fxjt": ["renke-rs-fxjt", "renke-rs-fsjt", "pr-3000-fsjt"],
        "renke-rs-fsjt": ["renke-rs-fsjt", "pr-3000-fsjt"],
        "pr-3000-fsjt": ["pr-3000-fsjt", "renke-rs-fsjt"],
        "dfrobot-sen0482": ["dfrobot-sen0482", "dfrobot-sen0483"],
        "40": ["renke-rs-fsjt", "pr-3000-fsjt"],
        "41": ["ecowitt-wn90lp"],
    }


@pytest.mark.parametrize("name", [name for name, profile in BUILTIN.items() if profile.slave_id is not None])
def test_a_single_device_is_recognised_at_whichever_rate(name: str) -> None:
    """It was unknown at the second: what it was asked at the first could have been answered too."""
    for slave, rates in ((1, (4800, 9600, 19200)), (144, (19200, 9600))):
        sensor = Sensor(slave, blueprint=blueprint_of(BUILTIN[name]))
        (found,) = scanned(line_of(sensor), [slave], rates).scan.found
        assert name in _names(found)


def _names(finding: FoundDevice) -> list[str]:
    """Return the profile of a finding and its alternatives by name."""
    assert finding.profile is not None
    return [finding.profile.name, *(profile.name for profile in finding.alternatives)]


def test_an_echoing_adapter_hides_nobody_and_invents_nobody() -> None:
    done = scanned(line_of(4, 5), range(1, 12), echo=True)
    assert found_ids(done.scan) == [4, 5]
    assert done.scan.noise.echoed
    assert done.scan.noise.ids == 0


def test_an_adapter_that_delivers_in_pieces_hides_nobody() -> None:
    assert found_ids(scanned(line_of(4, 5), range(1, 12), latency=0.016).scan) == [4, 5]


def test_nothing_is_ever_written() -> None:
    done = scanned(line_of(3, ill(4, "garbage"), 255), ALL, (9600, 19200))
    assert {event.sent[1] for event in done.exchanges} == {3}


def test_a_single_id_is_waited_for_patiently() -> None:
    assert found_ids(scanned(line_of(Sensor(7, turnaround=0.8)), [7]).scan) == [7]
