"""How often the state of a device is published: once a second, and at once where it changed."""

from __future__ import annotations

from dataclasses import replace

import pytest

from lfs10d.reading import Fault, FaultCode
from lfs10d.telemetry.device_state import SAMPLE_LATE, STATE_EARLY
from lfs10d.telemetry.info import DeviceInfo
from lfs10d.telemetry.publication import STATE
from tests.support.device_states import FACTS, REFUSED, TIMEOUT, Watched, fields, instant

CRC = Fault(FaultCode.CRC, "check wrong")


def test_the_state_shows_the_newest_sample_once_a_second() -> None:
    watched = Watched()
    watched.poll(0, 1.0)
    assert watched.poll(0.25, 2.0) == ["telemetry"]
    assert watched.poll(0.5, 3.0) == ["telemetry"]
    due = watched.device.state_due
    assert due is not None
    assert watched.device.due_state(instant(due - 0.001)) is None
    state = watched.device.due_state(instant(due))
    assert state is not None
    assert fields(state.payload, "wind_speed", "seq") == (3.0, 3)
    assert watched.device.state_due is None
    assert watched.device.due_state(instant(10)) is None


@pytest.mark.parametrize("jitter", [0.005, -0.005])
def test_a_device_polled_every_second_is_shown_at_every_poll(jitter: float) -> None:
    watched = Watched()
    polls = [watched.poll(second + (second % 2) * jitter, 1.0) for second in range(60)]
    assert all("state" in published for published in polls)


def test_states_do_not_exceed_one_a_second_in_the_long_run() -> None:
    watched = Watched()
    shown = sum("state" in watched.poll(number * 0.9975, 1.0) for number in range(1000))
    assert shown <= 998


def test_a_change_of_quality_or_error_is_shown_at_once() -> None:
    watched = Watched()
    outcomes: list[float | Fault] = [1.0, TIMEOUT, TIMEOUT, CRC, REFUSED, 2.0, 3.0]
    shown = ["state" in watched.poll(number / 100, outcome) for number, outcome in enumerate(outcomes)]
    assert shown == [True, True, False, True, True, True, False]


def test_many_changes_do_not_silence_the_state_afterwards() -> None:
    watched = Watched()
    for number in range(100):
        watched.poll(number / 100, 1.0 if number % 2 else TIMEOUT)
    watched.poll(1.0, 1.0)
    assert watched.poll(2.1, 1.0) == ["telemetry", "state"]


def test_a_state_shown_because_of_a_change_waits_no_longer() -> None:
    watched = Watched()
    watched.poll(0, 1.0)
    watched.poll(0.2, 2.0)
    watched.poll(0.4, TIMEOUT)
    assert watched.device.state_due is None


def test_a_state_may_come_a_little_early_and_no_earlier() -> None:
    watched = Watched()
    watched.poll(10, 1.0)
    assert "state" not in watched.poll(11 - 2 * STATE_EARLY, 1.0)
    assert "state" in watched.poll(11 - STATE_EARLY / 2, 1.0)


def test_a_state_just_at_its_early_time_is_shown() -> None:
    watched = Watched()
    watched.poll(0.0, 1.0)
    assert "state" in watched.poll(1.0 - STATE_EARLY, 2.0)


def polled_every(period: float) -> Watched:
    """Return a device polled at 0, with a burst of all topics shortly before its next poll."""
    watched = Watched()
    watched.poll(0, 1.0)
    watched.device.burst(instant(0.9 * period))
    return watched


def test_a_state_goes_with_the_first_sample_whose_time_it_is() -> None:
    watched = polled_every(1.0)
    assert watched.poll(1.0, 2.0) == ["telemetry"]
    assert watched.device.due_state(instant(1.9)) is None  # the next sample shows more
    assert [watched.poll(1.0 + second, 3.0) for second in range(1, 20)] == [["telemetry", "state"]] * 19


def test_flat_out_a_state_goes_with_a_sample_too() -> None:
    watched = Watched()
    watched.poll(0, 1.0)
    shown = []
    for number in range(1, 21):
        at = number * 0.85
        assert watched.device.due_state(instant(at)) is None
        shown.append(STATE in watched.poll(at, 1.0 + number))
    assert shown == [False, True] * 10


def test_a_state_that_waits_for_a_sample_in_vain_shows_the_one_before() -> None:
    watched = polled_every(1.0)
    watched.poll(1.0, 2.0)
    due = 2.0 + SAMPLE_LATE
    assert watched.device.state_due == due
    assert watched.device.due_state(instant(due - 0.001)) is None
    state = watched.device.due_state(instant(due))
    assert state is not None
    assert fields(state.payload, "wind_speed", "seq") == (2.0, 2)


def test_a_state_does_not_wait_for_a_sample_that_is_far_off() -> None:
    watched = polled_every(10.0)
    assert watched.poll(9.5, 2.0) == ["telemetry"]
    assert watched.device.state_due == 10.0


@pytest.mark.parametrize(("at", "due"), [(9.92, 10.0), (9.85, 9.85 + 0.85 + SAMPLE_LATE)])
def test_a_sample_that_is_merely_early_is_shown_when_its_time_has_come(at: float, due: float) -> None:
    watched = Watched()
    for second in range(10):
        watched.poll(float(second), 1.0)
    assert watched.poll(at, 2.0) == ["telemetry"]
    assert watched.device.state_due == pytest.approx(due)


def test_of_samples_taken_at_one_moment_the_state_shows_the_last() -> None:
    watched = Watched()
    watched.poll(0, 1.0)
    states = []
    for moment in (1.0, 2.0, 3.0):
        said = [each for number in range(3) for each in watched.publish(moment, moment + number)]
        states.append([each for each in said if each.topic.endswith(STATE)][-1])
        assert watched.device.state_due is None
    assert [fields(state.payload, "wind_speed", "seq") for state in states] == [(3.0, 4), (4.0, 7), (5.0, 10)]
    assert all(state.refresh for state in states)
    assert watched.poll(3.2, 9.0) == ["telemetry"]  # the pace is as with one sample


def test_a_fault_is_shown_at_once_while_a_state_waits_for_a_sample() -> None:
    watched = polled_every(1.0)
    watched.poll(1.0, 2.0)
    assert STATE in watched.poll(1.1, TIMEOUT)
    assert watched.device.state_due is None


def every(state_every: float) -> DeviceInfo:
    return replace(FACTS, state_every=state_every)


def test_the_state_comes_as_often_as_it_is_wanted_and_a_change_at_once() -> None:
    watched = Watched()
    watched.device.reconfigure(every(10.0), instant(0))
    watched.poll(1.0, 5.0)
    seconds = [second for second in range(2, 32) if STATE in watched.poll(float(second), 5.0 + second)]
    assert seconds == [11, 21, 31]
    assert STATE in watched.poll(32.0, TIMEOUT)
    assert STATE in watched.poll(33.0, 4.0)
    assert STATE not in watched.poll(34.0, 4.0)
    assert watched.device.state_due == 43.0


def test_a_shorter_pace_of_states_takes_effect_at_once() -> None:
    watched = Watched()
    watched.device.reconfigure(every(3600.0), instant(0))
    watched.poll(1.0, 5.0)
    watched.poll(2.0, 6.0)
    assert watched.device.state_due == 3601.0
    watched.device.reconfigure(every(2.0), instant(3.0))
    assert watched.device.state_due == 5.0
    state = watched.device.due_state(instant(5.0))
    assert state is not None
    assert state.refresh


def test_only_newer_figures_are_a_refresh() -> None:
    watched = Watched()
    said = [each for at, outcome in ((1.0, 5.0), (2.0, 5.1), (3.0, TIMEOUT)) for each in watched.publish(at, outcome)]
    states = [each.refresh for each in said if each.topic.endswith(STATE)]
    assert states == [False, True, False]
    assert watched.device.stats(instant(4.0)).refresh
    assert not any(each.refresh for each in watched.device.burst(instant(5.0))[:-1])
