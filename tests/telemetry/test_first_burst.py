"""The first burst of a boot."""

from __future__ import annotations

from lfs10d.telemetry.first_burst import FirstBurst
from lfs10d.telemetry.publication import Publication, PublicationKind, Sample, retained

UNKNOWN = [
    retained("line/state", {"open": False}),
    retained("device/mast/state", {"seq": 0}),
    retained("device/mast/availability", "offline"),
    retained("device/mast/error", {"active": False}),
    retained("device/mast/config", {"slave": 3}),
]
KNOWN = [
    retained("line/state", {"open": True}),
    retained("device/mast/state", {"seq": 7}),
    retained("device/mast/availability", "online"),
    retained("device/mast/error", {"active": False}),
    retained("device/mast/config", {"slave": 3}),
]


STARTING = retained("device/mast/state", {"seq": 0, "error": "starting"})


def test_it_says_of_the_devices_what_was_known_before_the_first_reading() -> None:
    first = FirstBurst(UNKNOWN)

    assert first.burst(KNOWN) == [KNOWN[0], STARTING, *UNKNOWN[2:]]


def test_a_disabled_device_is_starting_in_it_and_disabled_right_after() -> None:
    disabled = retained("device/mast/state", {"seq": 0, "error": "disabled"})
    first = FirstBurst([disabled, *UNKNOWN[2:]])

    assert first.burst([disabled]) == [STARTING]
    assert first.settle([disabled]) == [disabled]


def test_what_is_known_by_then_follows_once_it_is_settled() -> None:
    first = FirstBurst(UNKNOWN)

    assert first.settle(KNOWN) == [KNOWN[2], KNOWN[1]]  # a value is shown of a device that is online
    assert first.burst(KNOWN) == KNOWN
    assert first.passing(KNOWN) == KNOWN
    assert first.settle(KNOWN) == []


def test_states_are_held_back_until_then_samples_clearings_and_the_line_are_not() -> None:
    first = FirstBurst(UNKNOWN)
    sample = Sample("mast", "0", 1, 0, "synced", None, {}, ("wind_speed",), "bad", "timeout", None)
    passing = [
        Publication("device/mast/telemetry", {}, PublicationKind.SAMPLE, retain=False, qos=1, sample=sample),
        retained("device/mast/state", None),
        KNOWN[0],
        KNOWN[4],
    ]

    assert first.passing([*passing, *KNOWN[1:4]]) == passing


def test_a_device_added_meanwhile_is_told_as_it_is() -> None:
    first = FirstBurst(UNKNOWN)
    added = retained("device/roof/state", {"seq": 1})

    assert first.burst([added]) == [added]
    assert first.settle([added]) == [added]
