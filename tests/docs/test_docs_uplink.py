"""The table of bytes a day is what the daemon's station and encoder make of it."""

from __future__ import annotations

from docs.generate.uplink import PUBACK, bytes_a_day

MINUTES = 1440


def test_a_sensor_alone_sends_its_samples_states_and_statistics() -> None:
    there, back = bytes_a_day(1, telemetry=True, state_every=1.0)
    assert back == 2 * 86_400 * PUBACK
    assert 30e6 < there < 60e6


def test_without_telemetry_a_state_a_minute_is_what_costs_beside_statistics() -> None:
    there, back = bytes_a_day(1, telemetry=False, state_every=60.0)
    assert back == MINUTES * PUBACK
    assert there < 4e6


def test_bytes_grow_with_the_sensors() -> None:
    one, eight = (bytes_a_day(each, telemetry=False, state_every=60.0)[0] for each in (1, 8))
    assert 4 * one < eight < 8 * one


def test_wind_statistics_cost_a_message_each_time_they_are_published() -> None:
    without = bytes_a_day(1, telemetry=False, state_every=60.0)
    there, back = bytes_a_day(1, telemetry=False, state_every=60.0, wind_every=60.0)
    assert back - without[1] == MINUTES * PUBACK
    assert 0.5e6 < there - without[0] < 1.2e6
