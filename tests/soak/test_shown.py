"""What looks live, and what does not."""

from __future__ import annotations

from soak.shown import STALE_AFTER, Shown

NOW = 1_000.0


def shown(*, daemon: str = "online", device: str = "online", quality: str = "good", age: float = 60.0) -> Shown:
    state = {"wind_speed": 3.5, "quality": quality, "ts": (NOW - age) * 1000}
    return Shown(daemon, {"slave-1": device}, {"slave-1": state})


def test_an_old_value_that_looks_live_is_told() -> None:
    assert shown().stale(NOW) == ["slave-1: 3.5 of 60.0 s ago is shown as live"]


def test_a_fresh_value_is_live() -> None:
    assert shown(age=STALE_AFTER - 0.1).stale(NOW) == []


def test_what_is_marked_as_offline_or_bad_is_not_live() -> None:
    assert shown(daemon="offline").stale(NOW) == []
    assert shown(device="offline").stale(NOW) == []
    assert shown(quality="bad").stale(NOW) == []


def test_what_the_broker_forgot_is_not_shown() -> None:
    seen = shown()
    seen.clear()
    assert seen == Shown()
    assert seen.stale(NOW) == []


def test_topics_are_taken_for_what_they_are() -> None:
    seen = Shown()
    seen.note("availability", b"online")
    seen.note("device/slave-1/availability", b"online")
    seen.note("device/slave-1/state", b'{"wind_speed": 3.5, "quality": "good", "ts": 940000}')
    seen.note("device/slave-1/telemetry", b"{}")
    assert seen.stale(NOW) == ["slave-1: 3.5 of 60.0 s ago is shown as live"]
    seen.note("", b"")
    assert seen.stale(NOW) == []
