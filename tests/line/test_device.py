"""Health and time-outs of a device follow the rules at the top of `lfs10d.line.device`."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from lfs10d.line.device import BAD_ANSWER_PATIENCE, Device, DeviceSpec, Health, PollRules, ResponseTimes
from lfs10d.modbus.frames import Codec, Framing
from lfs10d.profiles.library import load_profile
from lfs10d.reading import START_POLLS, Fault, FaultCode

SILENCE = Fault(FaultCode.TIMEOUT, "no answer in 200 ms")
REFUSAL = Fault(FaultCode.EXCEPTION, "exception 02", exception_code=2)


def a_device(response_timeout: float | None = None, rules: PollRules | None = None) -> Device:
    profile = load_profile("lfs10", relative_to=Path())
    spec = DeviceSpec("mast", 3, profile, Codec(Framing.RTU), 1.0, response_timeout=response_timeout)
    return Device(spec, rules or PollRules(), spec.slave)


def test_a_device_never_heard_gets_200_then_400_then_1000_ms() -> None:
    device = a_device(rules=PollRules(offline_after=9))
    timeouts = []
    for _ in range(5):
        timeouts.append(device.timeout)
        device.failed(SILENCE, 0.0)
    assert timeouts == [0.2, 0.4, 1.0, 1.0, 1.0]
    assert device.health is Health.UNHEARD


@pytest.mark.parametrize(
    ("turnaround", "answers", "timeout"),
    [
        pytest.param(0.030, 100, 0.080, id="twice the p99 and 20 ms"),
        pytest.param(0.005, 100, 0.050, id="never below 50 ms"),
        pytest.param(0.700, 100, 1.000, id="never above 1 s"),
        pytest.param(0.005, 9, 0.200, id="with few answers no less than the first time-out"),
        pytest.param(0.150, 9, 0.320, id="with few answers more where they take longer"),
    ],
)
def test_the_learned_time_out(turnaround: float, answers: int, timeout: float) -> None:
    device = a_device()
    for _ in range(answers):
        device.response_times.learn(turnaround)
    assert device.timeout == pytest.approx(timeout)


def test_the_p99_of_100_answers_leaves_one_out() -> None:
    response_times = ResponseTimes()
    for _ in range(99):
        response_times.learn(0.01)
    response_times.learn(0.5)
    assert response_times.p99 == 0.01
    response_times.learn(0.4)
    assert response_times.p99 == 0.4
    for _ in range(100):
        response_times.learn(0.02)
    assert response_times.p99 == 0.02
    assert response_times.count_near(0.025, 0.0051) == len(response_times) == 100
    assert response_times.count_near(0.03, 0.009) == 0
    response_times.forget()
    assert response_times.count_near(0.02, 0.001) == 0


def test_after_a_change_of_rate_learning_begins_anew() -> None:
    device = a_device()
    device.response_times.learn(0.01)
    device.response_times.forget()
    assert device.response_times.p99 is None
    assert device.timeout == 0.2


def test_a_fixed_time_out_holds_for_polls_and_probes() -> None:
    device = a_device(response_timeout=0.5)
    device.response_times.learn(0.01)
    assert device.timeout == 0.5
    assert device.probe_timeout == 0.5


def test_every_fourth_probe_waits_a_second() -> None:
    device = a_device()
    for _ in range(3):
        device.failed(SILENCE, 0.0)
    waits = []
    for _ in range(8):
        waits.append(device.probe_timeout)
        device.failed(SILENCE, 0.0)
    assert waits == [0.2, 0.2, 0.2, 1.0] * 2


def test_probes_come_after_1_2_4_s_up_to_the_longest_interval() -> None:
    device = a_device(rules=PollRules(offline_after=1, probe_interval_max=5.0))
    device.answered()
    now = 100.0
    waits = []
    for _ in range(5):
        device.failed(SILENCE, now)
        waits.append(device.next_probe - now)
        now = device.next_probe
    assert waits == [1.0, 2.0, 4.0, 5.0, 5.0]


def test_offline_comes_with_the_nth_failure_in_a_row_only() -> None:
    device = a_device()
    device.answered()
    for _ in range(2):
        device.failed(SILENCE, 0.0)
    assert device.online
    device.answered()
    for _ in range(3):
        assert device.online
        device.failed(SILENCE, 0.0)
    assert not device.online


@pytest.mark.parametrize("code", [FaultCode.EXCEPTION, FaultCode.OUT_OF_RANGE, FaultCode.NOT_FINITE])
def test_a_refusal_or_a_bad_value_proves_it_alive(code: FaultCode) -> None:
    device = a_device(rules=PollRules(offline_after=1))
    device.failed(SILENCE, 0.0)
    before = device.online
    device.failed(Fault(code, "alive"), 1.0)
    assert (before, device.online, device.failures) == (False, True, 0)


def test_only_one_that_answers_is_tried_again() -> None:
    device = a_device(rules=PollRules(retries=2, offline_after=1))
    assert device.retries == 0
    device.answered()
    assert device.retries == 2
    device.failed(SILENCE, 0.0)
    assert device.retries == 0


def test_when_the_port_comes_back_nothing_is_known_of_it() -> None:
    device = a_device()
    device.answered()
    device.polling = True
    device.cut_off()
    lost, polling = device.health, device.polling
    device.reconnected()
    assert (lost, polling, device.health) == (Health.OFFLINE, False, Health.UNHEARD)
    assert device.name == "mast"


def test_one_that_is_silent_is_in_doubt_after_three_polls_at_once_until_it_is_heard() -> None:
    device = a_device(rules=PollRules(offline_after=9))
    stages = []
    for now in (1.0, 2.0, 3.0):
        stages.append((device.starting, device.doubtful))
        device.failed(SILENCE, now)
        assert device.again_at == now
    assert stages == [(False, False), (True, False), (True, False)]
    assert (device.starting, device.doubtful, device.probe_timeout) == (False, True, 1.0)
    device.answered()
    for _ in range(9):
        assert (device.doubtful, device.starting) == (False, False)
        device.failed(SILENCE, 4.0)
    assert (device.starting, device.doubtful) == (False, True)


@pytest.mark.parametrize("offline_after", [1, 3])
def test_the_polls_of_the_start_are_three_whenever_it_counts_as_offline(offline_after: int) -> None:
    device = a_device(rules=PollRules(offline_after=offline_after))
    for _ in range(2):
        device.failed(SILENCE, 5.0)
        assert (device.starting, device.doubtful) == (True, False)
    device.failed(SILENCE, 5.0)
    assert (device.starting, device.doubtful, device.health) == (False, True, Health.OFFLINE)
    assert device.next_probe == 6.0
    device.reconnected()
    assert (device.starting, device.doubtful, device.start_polls) == (False, False, START_POLLS)


def test_one_that_answers_badly_is_never_in_doubt_and_not_waited_for_long() -> None:
    device = a_device()
    garbage = Fault(FaultCode.CRC, "the check is wrong")
    patiences = [device.patience]
    for _ in range(4):
        device.failed(garbage, 0.0)
        assert (device.doubtful, device.starting) == (False, False)
        assert device.timeout == 0.2
        patiences.append(device.patience)
    assert patiences == [None, *[BAD_ANSWER_PATIENCE] * 4]
    assert device.health is Health.OFFLINE
    device.failed(SILENCE, 0.0)
    assert device.doubtful
    device.response_times.learn(0.03)
    assert device.patience == 0.03


def test_where_many_are_silent_at_the_start_none_is_waited_for_long() -> None:
    device = a_device()
    device.failed(SILENCE, 0.0)
    assert device.timeout == 0.4
    device.hurried = True
    assert device.timeout == 0.2
    device.answered()
    assert not device.hurried


def test_one_that_goes_offline_may_come_back_as_another_sensor() -> None:
    device = a_device(rules=PollRules(offline_after=1))
    device.answered()
    device.gap.exchanged(0.0, 0.1, spoke=True, silent=False)
    device.gap.exchanged(0.11, 0.2, spoke=True, silent=False)  # needs no rest
    device.failed(SILENCE, 1.0)
    for now in (2.0, 3.0):
        device.gap.exchanged(now, now + 0.1, spoke=True, silent=False)
        device.gap.exchanged(now + 0.11, now + 0.2, spoke=False, silent=True)
    assert device.gap.learned == 0.1


def test_a_probe_of_one_that_answers_slowly_waits_as_long_as_was_learned() -> None:
    device = a_device(rules=PollRules(offline_after=1))
    for _ in range(20):
        device.response_times.learn(0.25)
    device.answered()
    device.failed(SILENCE, 0.0)
    assert device.probe_timeout == pytest.approx(0.52)


@pytest.mark.parametrize(
    ("changed", "anew"),
    [
        ({"slave": 4}, True),
        ({"codec": Codec(Framing.ASCII)}, True),
        ({"interval": 2.0, "response_timeout": 0.3}, False),
        ({"enabled": False}, False),
    ],
)
def test_what_was_learned_holds_until_another_slave_is_meant(changed: dict[str, object], *, anew: bool) -> None:
    spec = a_device().spec
    assert replace(spec, **changed).begins_anew(spec) is anew  # type: ignore[arg-type]  # names and values go together


def test_a_calibration_changes_nothing_that_was_learned() -> None:
    spec = a_device().spec
    calibrated = replace(spec, profile=spec.profile.calibrated({"wind_speed": (1.013, 0.06)}))
    assert calibrated.profile != spec.profile
    assert not calibrated.begins_anew(spec)
    assert not spec.begins_anew(calibrated)


def test_one_that_is_enabled_again_begins_anew() -> None:
    spec = a_device().spec
    assert spec.begins_anew(replace(spec, enabled=False))
