"""What an earlier life published is read until all of it is there, or nothing more comes."""

from __future__ import annotations

from lfs10d.mqtt.lookback import LONGEST, QUIET_LEAST, QUIET_MOST, Lookback
from lfs10d.mqtt.topics import Topics

WANTED = frozenset({"line/state", "device/a/config"})


def begun(at: float = 10.0) -> Lookback:
    return Lookback(Topics("b/line0"), WANTED, at)


def test_two_filters_hold_all_that_is_wanted() -> None:
    assert begun().filters == ("b/line0/line/state", "b/line0/device/+/config")


def test_it_is_over_at_once_when_all_is_found() -> None:
    lookback = begun()
    lookback.on_message("b/line0/line/state", b"{}", 10.1)
    assert lookback.due(10.1) > 10.1
    lookback.on_message("b/line0/device/a/config", b"1", 10.2)
    assert lookback.due(10.2) == 10.2
    assert lookback.found == {"line/state": b"{}", "device/a/config": b"1"}


def test_what_is_not_wanted_is_passed_over_and_delays_nothing() -> None:
    lookback = begun()
    lookback.subscribed(10.2, refused=False)
    lookback.on_message("b/line0/device/stranger/config", b"{}", 10.4)
    lookback.on_message("elsewhere/line/state", b"{}", 10.4)
    assert lookback.found == {}
    assert lookback.due(10.4) == 10.2 + QUIET_MOST


def test_it_is_over_when_the_broker_has_answered_and_fallen_silent() -> None:
    lookback = begun()
    lookback.subscribed(10.2, refused=False)
    assert lookback.due(10.2) == 10.2 + QUIET_MOST
    lookback.on_message("b/line0/line/state", b"{}", 10.3)
    assert lookback.due(10.3) == 10.3 + QUIET_MOST


def test_a_broker_that_never_answers_is_waited_for_five_seconds() -> None:
    lookback = begun()
    assert lookback.due(12.0) == 10.0 + LONGEST == 15.0
    lookback.on_message("b/line0/line/state", b"{}", 14.9)
    assert lookback.due(14.9) == 15.0


def test_a_refused_subscription_is_not_waited_for() -> None:
    lookback = begun()
    lookback.subscribed(10.1, refused=True)
    assert lookback.due(10.1) == 10.1


def test_a_broker_that_answers_at_once_is_given_less_time_to_go_on() -> None:
    near = begun()
    near.subscribed(10.0, refused=False)
    assert near.due(10.0) == 10.0 + QUIET_LEAST
    farther = begun()
    farther.subscribed(10.0625, refused=False)
    assert farther.due(10.0625) == 10.0625 + QUIET_LEAST + 0.25
