"""What is said about one device."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import cast

import pytest

from lfs10d.reading import NOTHING, AnsweredTwice, Fault, FaultCode, Reading, Value
from lfs10d.system.clock import Instant
from lfs10d.telemetry.device_state import STATE_EARLY, DeviceState
from lfs10d.telemetry.info import DeviceInfo
from lfs10d.telemetry.publication import STATE, Publication, PublicationKind
from tests.support.stations import ONE_VALUE

FACTS = replace(ONE_VALUE, slave=3, label="Mast", interval=0.25)
TIMEOUT = Fault(FaultCode.TIMEOUT, "no answer in 200 ms")
CRC = Fault(FaultCode.CRC, "check wrong")
BUSY = Fault(FaultCode.EXCEPTION, "busy", exception_code=6, busy=True)
REFUSED = Fault(FaultCode.EXCEPTION, "illegal data", exception_code=3)
LOST = Fault(FaultCode.PORT_LOST, "absent")


def instant(mono: float) -> Instant:
    return Instant(mono, 1_795_298_000 + mono, "synced")


class Watched:
    """A device and its clock: `poll` hands it a reading at a time in s and returns the leaves published."""

    def __init__(self, *, seq: int = 0) -> None:
        self.device = DeviceState(FACTS, line="line0", boot="k3f9a2c7", seq=seq, now=instant(0))

    def publish(
        self, at: float, outcome: float | Fault, *, online: bool | None = None, masked: bool = False
    ) -> list[Publication]:
        fault = outcome if isinstance(outcome, Fault) else None
        reading = Reading(
            device="a",
            at=at,
            values=None if isinstance(outcome, Fault) else {"wind_speed": outcome},
            fault=fault,
            rtt=0.01823 if fault is None else None,
            online=fault is None if online is None else online,
            response_timeout=0.2,
        )
        return self.device.on_reading(reading, instant(at), masked=masked)[0]

    def poll(self, at: float, outcome: float | Fault, *, online: bool | None = None, masked: bool = False) -> list[str]:
        return leaves(self.publish(at, outcome, online=online, masked=masked))

    @property
    def shown(self) -> dict[str, object]:
        """Every retained payload now, by leaf."""
        return {each.topic.split("/")[-1]: each.payload for each in self.device.burst(instant(1e6))}


def leaves(published: Iterable[Publication]) -> list[str]:
    return [each.topic.removeprefix("device/a/") for each in published]


def fields(payload: object, *keys: str) -> tuple[object, ...]:
    return tuple(cast("Mapping[str, object]", payload)[key] for key in keys)


def test_a_device_is_offline_and_without_a_value_until_its_first_answer() -> None:
    shown = Watched().shown
    assert shown["availability"] == "offline"
    # The contract's new word: `starting` in the state, and in no error topic.
    assert fields(shown["state"], "wind_speed", "quality", "error", "seq") == (None, "bad", "starting", 0)
    assert fields(shown["error"], "active", "code", "last_code") == (False, None, None)


def test_a_device_disabled_from_the_start_says_so_and_has_no_sample() -> None:
    device = DeviceState(replace(FACTS, enabled=False), line="line0", boot="k3f9a2c7", seq=0, now=instant(0))
    state, _, availability, error, _ = device.burst(instant(1.0))
    assert fields(state.payload, "wind_speed", "quality", "error", "seq") == (None, "bad", "disabled", 0)
    assert availability.payload == "offline"
    assert fields(error.payload, "active", "last_code") == (False, None)


def test_the_first_answer_is_available_first_and_shown_at_once() -> None:
    watched = Watched()
    published = watched.publish(0.5, 12.34)
    assert leaves(published) == ["telemetry", "availability", "state"]
    sample, available, state = published
    assert sample.sample is not None
    assert (sample.kind, sample.retain, sample.qos) == (PublicationKind.SAMPLE, False, 1)
    assert sample.sample.payload("line0") == sample.payload
    assert available.payload == "online"
    assert state.payload == sample.payload
    assert fields(state.payload, "seq", "ts", "wind_speed", "rtt_ms") == (1, 1_795_298_000_500, 12.34, 18.2)


def test_a_device_that_goes_shows_no_value_before_it_is_unavailable() -> None:
    watched = Watched()
    watched.poll(0, 1.0)
    assert watched.poll(0.25, TIMEOUT, online=False) == ["telemetry", "state", "availability"]
    assert fields(watched.shown["state"], "wind_speed", "rtt_ms") == (None, None)


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


def test_an_error_rises_after_as_many_failures_as_make_it_offline_and_clears_with_one_value() -> None:
    watched = Watched()
    watched.poll(0, 1.0)
    assert watched.poll(1, TIMEOUT, online=True) == ["telemetry", "state"]
    assert watched.poll(2, TIMEOUT) == ["telemetry", "state", "availability", "error"]
    assert fields(watched.shown["error"], "active", "code", "count") == (True, "timeout", 2)
    assert watched.poll(3, 1.0) == ["telemetry", "availability", "state", "error"]
    assert fields(watched.shown["error"], "active", "last_code") == (False, "timeout")


def test_a_refusal_proves_the_device_alive() -> None:
    watched = Watched()
    assert watched.poll(0, REFUSED, online=True) == ["telemetry", "availability", "state"]
    assert watched.shown["availability"] == "online"
    assert fields(watched.shown["state"], "error", "wind_speed") == ("exception", None)


def test_a_busy_device_is_a_bad_sample_but_no_error() -> None:
    watched = Watched()
    for second in range(5):
        assert "error" not in watched.poll(second, BUSY, online=True)
    assert fields(watched.shown["state"], "error", "quality") == ("exception", "bad")
    assert fields(watched.shown["error"], "active") == (False,)


def test_a_busy_answer_neither_ends_nor_lengthens_a_run_of_failures() -> None:
    watched = Watched()
    watched.poll(0, TIMEOUT)
    watched.poll(1, BUSY, online=True)
    assert "error" in watched.poll(2, TIMEOUT)


def test_a_lost_port_takes_the_device_s_own_error_back() -> None:
    watched = Watched()
    watched.poll(0, TIMEOUT)
    watched.poll(1, TIMEOUT)
    assert watched.poll(2, LOST) == ["telemetry", "state", "error"]
    assert fields(watched.shown["state"], "error") == ("port_lost",)
    assert fields(watched.shown["error"], "active", "last_code") == (False, "timeout")
    assert "error" not in watched.poll(3, TIMEOUT)
    assert "error" in watched.poll(4, TIMEOUT)


def test_while_masked_failures_are_not_held_against_the_device() -> None:
    watched = Watched()
    assert all("error" not in watched.poll(second, TIMEOUT, masked=True) for second in range(5))


def test_a_mask_is_published_only_where_there_was_an_error() -> None:
    watched = Watched()
    assert watched.device.mask(instant(0)) == []
    watched.poll(0, TIMEOUT)
    watched.poll(1, TIMEOUT)
    assert leaves(watched.device.mask(instant(2))) == ["error"]


def test_disabling_is_one_sample_without_an_error() -> None:
    watched = Watched()
    watched.poll(0, 1.0)
    published = watched.device.reconfigure(replace(FACTS, enabled=False), instant(0.1))
    assert leaves(published) == ["config", "telemetry", "state", "availability"]
    assert fields(published[1].payload, "seq", "error", "quality", "wind_speed", "rtt_ms") == (
        2,
        "disabled",
        "bad",
        None,
        None,
    )
    assert fields(watched.shown["error"], "active") == (False,)
    assert watched.shown["availability"] == "offline"


def test_disabling_an_ailing_device_clears_its_error() -> None:
    watched = Watched()
    watched.poll(0, TIMEOUT)
    watched.poll(1, TIMEOUT)
    published = watched.device.reconfigure(replace(FACTS, enabled=False), instant(2))
    assert leaves(published) == ["config", "telemetry", "state", "error"]


def test_enabling_publishes_the_configuration_alone() -> None:
    watched = Watched()
    watched.device.reconfigure(replace(FACTS, enabled=False), instant(1))
    assert leaves(watched.device.reconfigure(FACTS, instant(2))) == ["config"]


def test_what_is_not_shown_is_not_published() -> None:
    watched = Watched()
    assert watched.device.reconfigure(replace(FACTS, offline_after=1), instant(1)) == []
    assert "error" in watched.poll(2, TIMEOUT)


def test_numbers_go_on_after_a_removal() -> None:
    watched = Watched(seq=41)
    assert fields(watched.shown["state"], "seq") == (0,)
    assert fields(watched.publish(0, 1.0)[0].payload, "seq") == (42,)


def test_each_reading_is_counted_in_the_statistics() -> None:
    watched = Watched()
    watched.publish(1.0, 1.0)
    stats = watched.device.stats(instant(2))
    assert (stats.topic, stats.qos, stats.retain) == ("device/a/stats", 0, True)
    assert fields(stats.payload, "polls", "last_good_ts") == (1, instant(1.0).ts())


def test_the_time_since_the_poll_before_is_returned_with_a_reading() -> None:
    device = Watched().device
    reading = Reading("a", 1.0, {"wind_speed": 1.0}, None, 0.02, online=True, response_timeout=0.2)
    assert device.on_reading(reading, instant(1.0), masked=False)[1] is None
    assert device.on_reading(replace(reading, at=1.5), instant(1.5), masked=False)[1] == 0.5


def test_a_snapshot_tells_how_old_the_last_good_value_is() -> None:
    watched = Watched()
    assert watched.device.snapshot(instant(1))["age_s"] is None
    watched.poll(1, 12.34)
    watched.poll(2, TIMEOUT, online=True)
    snapshot = watched.device.snapshot(instant(4.04))
    assert fields(snapshot, "name", "slave", "label", "online") == ("a", 3, "Mast", True)
    assert fields(snapshot, "values", "quality", "error", "age_s") == (
        {"wind_speed": None},
        "bad",
        "timeout",
        3.0,
    )
    watched.poll(5, 9.5)
    assert fields(watched.device.snapshot(instant(5)), "values", "rtt_ms", "age_s") == (
        {"wind_speed": 9.5},
        18.2,
        0.0,
    )


def test_a_value_is_never_shown_as_unavailable_even_if_the_line_says_so() -> None:
    watched = Watched()
    assert watched.poll(0, 1.0, online=False) == ["telemetry", "availability", "state"]
    assert watched.shown["availability"] == "online"


def test_a_state_may_come_a_little_early_and_no_earlier() -> None:
    watched = Watched()
    watched.poll(10, 1.0)
    assert "state" not in watched.poll(11 - 2 * STATE_EARLY, 1.0)
    assert "state" in watched.poll(11 - STATE_EARLY / 2, 1.0)


def test_a_poll_that_a_request_wants_of_a_disabled_device_is_a_numbered_sample_and_nothing_else() -> None:
    watched = Watched()
    watched.device.reconfigure(replace(FACTS, enabled=False), instant(1))
    shown = watched.shown
    stats = shown.pop("stats")
    (sample,) = watched.publish(2, 7.5)
    assert (sample.topic, sample.sample is not None) == ("device/a/telemetry", True)
    assert cast("Mapping[str, object]", sample.payload)["wind_speed"] == 7.5
    assert cast("Mapping[str, object]", sample.payload)["seq"] == 2
    assert watched.poll(3, TIMEOUT) == ["telemetry"]
    now = watched.shown
    assert (fields(stats, "polls"), fields(now.pop("stats"), "polls")) == ((0,), (2,))
    assert now == shown


def test_a_sample_says_whose_it_is_of_which_life_and_by_which_clock() -> None:
    watched = Watched()
    (telemetry, *_) = watched.publish(0.5, 12.34)
    assert telemetry.payload == {
        "v": 1,
        "line": "line0",
        "device": "a",
        "boot": "k3f9a2c7",
        "seq": 1,
        "ts": 1_795_298_000_500,
        "time": "2026-11-21T21:53:20.500Z",
        "clock": "synced",
        "wind_speed": 12.34,
        "unit": "m/s",
        "quality": "good",
        "error": None,
        "rtt_ms": 18.2,
    }


def test_before_the_first_poll_the_state_is_of_the_line_too_and_none_waits() -> None:
    watched = Watched()
    assert fields(watched.shown["state"], "line", "device", "boot") == ("line0", "a", "k3f9a2c7")
    assert (Watched().device.online, Watched().device.state_due) == (False, None)


def test_what_is_told_late_has_the_time_at_which_it_happened() -> None:
    device = Watched().device
    reading = Reading("a", 10.0, {"wind_speed": 1.0}, None, 0.5, online=True, response_timeout=0.2)
    (telemetry, *_) = device.on_reading(reading, instant(12.0), masked=False)[0]
    assert fields(telemetry.payload, "ts", "rtt_ms") == (1_795_298_010_000, 500.0)
    fault = replace(reading, values=None, fault=TIMEOUT, rtt=None, online=False)
    device.on_reading(replace(fault, at=13.0), instant(15.0), masked=False)[0]
    risen = device.on_reading(replace(fault, at=14.0), instant(16.0), masked=False)[0][-1]
    assert fields(risen.payload, "since", "last") == (1_795_298_013_000, 1_795_298_014_000)
    cleared = device.on_reading(replace(reading, at=17.0), instant(19.0), masked=False)[0][-1]
    assert fields(cleared.payload, "active", "cleared") == (False, 1_795_298_017_000)


@pytest.mark.parametrize("masked", [False, True])
def test_an_error_taken_back_was_cleared_when_that_was_found(masked: bool) -> None:  # noqa: FBT001  # a case
    watched = Watched()
    watched.poll(1.0, TIMEOUT)
    watched.poll(2.0, TIMEOUT)
    published = watched.publish(3.0, LOST, masked=True) if masked else watched.device.mask(instant(3.0))
    assert fields(published[-1].payload, "cleared") == (1_795_298_003_000,)


def test_a_good_reading_without_a_time_of_answer_has_none() -> None:
    device = Watched().device
    reading = Reading("a", 1.0, {"wind_speed": 1.0}, None, None, online=True, response_timeout=0.2)
    assert fields(device.on_reading(reading, instant(1.0), masked=False)[0][0].payload, "rtt_ms") == (None,)


def test_a_disabled_devices_requested_sample_is_of_the_line_too() -> None:
    device = DeviceState(replace(FACTS, enabled=False), line="line0", boot="k3f9a2c7", seq=0, now=instant(0))
    reading = Reading("a", 1.0, {"wind_speed": 1.0}, None, 0.02, online=False, response_timeout=0.2)
    assert fields(device.on_reading(reading, instant(1.0), masked=False)[0][0].payload, "line") == ("line0",)


def test_statistics_have_a_time_and_know_a_fixed_time_out_from_the_start() -> None:
    device = DeviceState(replace(FACTS, response_timeout=0.3), line="line0", boot="b", seq=0, now=instant(0))
    assert fields(device.stats(instant(5.0)).payload, "ts", "response_timeout_ms") == (1_795_298_005_000, 300.0)


def test_the_configuration_is_that_of_the_facts() -> None:
    assert Watched().shown["config"] == FACTS.payload()


def test_a_rest_that_was_learned_is_published_with_the_configuration_once() -> None:
    device = DeviceState(replace(FACTS, request_gap=0.1), line="line0", boot="b", seq=0, now=instant(0))
    rested = Reading("a", 1.0, {"wind_speed": 1.0}, None, 0.02, online=True, response_timeout=0.2, request_gap=0.4)
    told = [leaves(device.on_reading(replace(rested, at=at), instant(at), masked=False)[0]) for at in (1.0, 2.0)]
    assert [("config" in each) for each in told] == [True, False]
    shown = {each.topic: each.payload for each in device.burst(instant(3.0))}
    assert fields(shown["device/a/config"], "request_gap") == (0.4,)
    changed = device.reconfigure(replace(FACTS, request_gap=0.5), instant(4.0))
    assert [fields(each.payload, "request_gap") for each in changed] == [(0.5,)]
    kept = device.reconfigure(replace(FACTS, request_gap=0.5, interval=9.0), instant(5.0))
    assert [fields(each.payload, "request_gap", "interval") for each in kept] == [(0.5, 9.0)]


def test_a_state_just_at_its_early_time_is_shown() -> None:
    watched = Watched()
    watched.poll(0.0, 1.0)
    assert "state" in watched.poll(1.0 - STATE_EARLY, 2.0)


def test_a_snapshot_tells_everything_a_live_view_shows() -> None:
    watched = Watched()
    watched.publish(0.5, 12.34)
    assert watched.device.snapshot(instant(1.06)) == {
        "name": "a",
        "slave": 3,
        "label": "Mast",
        "profile": "lfs10",
        "enabled": True,
        "interval": 0.25,
        "online": True,
        "seq": 1,
        "ts": 1_795_298_000_500,
        "values": {"wind_speed": 12.34},
        "units": {"wind_speed": "m/s"},
        "quality": "good",
        "error": None,
        "errors": {},
        "ages": {},
        "rtt_ms": 18.2,
        "age_s": 0.6,
        "alarm": {"v": 1, "active": False, "code": None, "last_code": None, "cleared": None},
    }


def test_an_id_answered_twice_is_an_event_and_an_error_beside_good_samples() -> None:
    watched = Watched()
    watched.poll(1.0, 12.3)
    twice = AnsweredTwice(1.5, "a", 3, Fault(FaultCode.DUPLICATE_ID, "slave 3 is answered for twice"))
    error, told = watched.device.on_answered_twice(twice, instant(1.5))
    assert error.topic == "device/a/error"
    assert fields(error.payload, "active", "code") == (True, "duplicate_id")
    assert fields(told.payload, "type", "device", "slave") == ("duplicate_id", "a", 3)
    assert watched.device.on_answered_twice(twice, instant(1.6)) == []
    watched.poll(3.0, 12.4)
    assert fields(watched.shown["state"], "quality", "error") == ("good", None)
    assert fields(watched.shown["error"], "code") == ("duplicate_id",)
    over = AnsweredTwice(9.0, "a", 3, None)
    (cleared,) = watched.device.on_answered_twice(over, instant(9.0))
    assert fields(cleared.payload, "active", "last_code") == (False, "duplicate_id")
    watched.device.on_answered_twice(twice, instant(10.0))
    assert leaves(watched.device.mask(instant(11.0))) == ["error"]
    assert fields(watched.shown["error"], "active") == (False,)


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


STATION = replace(
    ONE_VALUE, value_names=("wind_speed", "rain", "weather"), units=dict.fromkeys(("wind_speed", "rain"), "1")
)


class Station(Watched):
    """A device of three values."""

    def __init__(self) -> None:
        self.device = DeviceState(STATION, line="line0", boot="k3f9a2c7", seq=0, now=instant(0))

    def partly(self, at: float, ages: Mapping[str, float] = NOTHING, **errors: str) -> list[Publication]:
        values: dict[str, Value | None] = {"weather": "dry", "wind_speed": 1.5, "rain": 0.2}
        values |= dict.fromkeys(errors)
        codes = {name: FaultCode(code) for name, code in errors.items()}
        reading = Reading("a", at, values, None, 0.01, True, 0.2, value_errors=codes, ages=ages)  # noqa: FBT003 - online
        return self.device.on_reading(reading, instant(at), masked=False)[0]


def test_of_several_values_one_may_be_missing_and_the_others_stay() -> None:
    station = Station()
    payload = station.partly(1, rain="exception")[0].payload
    assert isinstance(payload, dict)
    assert [*payload][8:] == ["wind_speed", "rain", "weather", "units", "quality", "error", "rtt_ms", "errors"]
    assert fields(payload, "wind_speed", "rain", "weather", "rtt_ms") == (1.5, None, "dry", 10.0)
    assert fields(payload, "quality", "error", "errors") == ("partial", None, {"rain": "exception"})
    assert station.shown["availability"] == "online"
    assert fields(station.shown["stats"], "polls", "good", "partial", "errors") == (1, 1, 1, {})
    snapshot = station.device.snapshot(instant(1))
    assert list(cast("Mapping[str, object]", snapshot["values"]).items()) == [
        ("wind_speed", 1.5), ("rain", None), ("weather", "dry"),
    ]  # fmt: skip
    assert fields(snapshot, "quality", "error", "errors", "age_s") == ("partial", None, {"rain": "exception"}, 0.0)


def test_another_missing_value_or_reason_is_shown_at_once() -> None:
    station = Station()
    station.partly(1.0)
    assert "state" in leaves(station.partly(1.1, rain="exception"))
    assert "state" not in leaves(station.partly(1.2, rain="exception"))
    assert "state" in leaves(station.partly(1.3, rain="unavailable"))
    assert "state" in leaves(station.partly(1.4, weather="unavailable"))
    assert "state" in leaves(station.partly(1.5))


def test_a_partial_sample_ends_an_error_and_no_value_at_all_is_bad() -> None:
    station = Station()
    none = Fault(FaultCode.UNAVAILABLE, "wind_speed is unavailable")
    for at in (1, 2, 3):
        told = station.publish(at, none, online=True)
        assert fields(told[0].payload, "quality", "error", "rain", "rtt_ms") == ("bad", "unavailable", None, None)
        assert "errors" not in cast("Mapping[str, object]", told[0].payload)
    assert fields(station.shown["error"], "active", "code") == (True, "unavailable")
    assert station.shown["availability"] == "online"
    station.partly(4, weather="unavailable")
    assert fields(station.shown["error"], "active", "last_code") == (False, "unavailable")


def test_the_age_of_a_value_asked_more_rarely_stands_in_its_sample() -> None:
    station = Station()
    assert "ages" not in cast("Mapping[str, object]", station.partly(1)[0].payload)
    payload = station.partly(2, {"rain": 34.21749})[0].payload
    assert fields(payload, "quality", "rain", "ages") == ("good", 0.2, {"rain": 34.217})
    assert station.device.snapshot(instant(2))["ages"] == {"rain": 34.217}
