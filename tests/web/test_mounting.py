"""Mounting from the page: what the person reads, from the first sensor to the last."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

from lfs10d.errors import BrokerError, FailedError
from lfs10d.web.mounting import FIRST, LONGEST, LONGEST_SEARCH, NEXT, SETTING_UP, Mounting
from tests.web.daemons import FakeDaemon, login

NOBODY: dict[str, Any] = {"status": "rejected", "error": {"code": "timeout", "message": "no sensor answers at id 1"}}
TWO: dict[str, Any] = {"status": "rejected", "error": {"code": "duplicate_id", "message": "two devices answer"}}
SWITCH: dict[str, Any] = {
    "status": "failed", "error": {"code": "dip_switch", "message": "the sensor stays at slave id 1"},
    "data": {"device": "top"},
}  # fmt: skip
SWITCH_WORDS = (
    "It failed: its DIP switch sets the id. The sensor stays at slave id 1. "
    "Set the id with the switch inside the sensor."
)


def health(**devices: int) -> dict[str, Any]:
    rows = [{"name": name, "slave": slave} for name, slave in devices.items()]
    return {"status": "ok", "data": {"line": {"baudrate": 19200}, "devices": rows}}


def adopted(device: str, slave: int) -> dict[str, Any]:
    return {"status": "ok", "data": {"device": device, "slave": slave}}


@pytest.fixture
def daemon() -> Iterator[FakeDaemon]:
    made = FakeDaemon()
    yield made
    made.close()


def begun(daemon: FakeDaemon, *names: str) -> Mounting:
    """Return mounting that waits for its first sensor."""
    mounting = Mounting(login(), list(names), client=daemon.client, now=daemon.loop.time)
    assert not mounting.running
    daemon.run(mounting.start)
    daemon.answer(health(old=9))
    return mounting


def said(mounting: Mounting) -> tuple[str, str]:
    shown = mounting.shown()
    return shown["words"], shown["problem"]


def test_one_after_the_other_gets_its_name_until_all_are_adopted(daemon: FakeDaemon) -> None:
    mounting = begun(daemon, "top", "low")
    assert said(mounting) == (FIRST, "")
    daemon.answer(NOBODY)
    daemon.wait(1.0)
    daemon.answer(adopted("top", 2))
    assert said(mounting) == (NEXT, "")
    daemon.answer(adopted("low", 3))
    assert said(mounting) == ("All are adopted.", "")
    assert not mounting.running
    assert daemon.connected == 0
    assert [content for name, content, _ in daemon.asked if name == "line/adopt"] == [
        {"name": "top"}, {"name": "top"}, {"name": "low"},
    ]  # fmt: skip
    shown = mounting.shown()
    assert shown["names"] == ["top", "low"]
    assert shown["adopted"] == [
        {"device": "top", "slave": 2, "baudrate": 19200, "words": "top: slave id 2, 19200 baud"},
        {"device": "low", "slave": 3, "baudrate": 19200, "words": "low: slave id 3, 19200 baud"},
    ]


def test_by_3_1_1_each_request_has_an_id_of_its_own() -> None:
    daemon = FakeDaemon(by_response_topic=False)
    begun(daemon)
    daemon.answer(NOBODY)
    daemon.wait(1.0)
    ids = {content["id"] for _, content, _ in daemon.asked}
    assert len(ids) == len(daemon.asked) == 3
    daemon.close()


def test_a_request_that_takes_longer_than_a_vain_one_has_found_a_sensor(daemon: FakeDaemon) -> None:
    mounting = begun(daemon)
    daemon.wait(LONGEST_SEARCH)
    assert said(mounting)[0] == FIRST, "not known better yet"
    daemon.wait(0.1)
    assert said(mounting)[0] == SETTING_UP
    daemon.answer(NOBODY)
    assert said(mounting)[0] == FIRST
    daemon.wait(1.0)
    daemon.wait(12.0)
    assert said(mounting)[0] == FIRST, "on this line a vain request takes 8.1 s"
    daemon.wait(0.2)
    assert said(mounting)[0] == SETTING_UP
    daemon.answer(adopted("slave-2", 2))
    assert said(mounting)[0] == NEXT


def test_a_problem_is_shown_for_as_long_as_it_lasts_and_what_to_do(daemon: FakeDaemon) -> None:
    mounting = begun(daemon, "top")
    daemon.answer(SWITCH)
    assert said(mounting) == (FIRST, SWITCH_WORDS)
    daemon.wait(10.0)
    daemon.answer(NOBODY)
    assert said(mounting) == (FIRST, ""), "it was unplugged"
    daemon.wait(1.0)
    daemon.answer(SWITCH)
    assert said(mounting) == (FIRST, SWITCH_WORDS), "it is there again"
    daemon.wait(10.0)
    daemon.answer(TWO)
    assert said(mounting)[1] == SWITCH_WORDS, "noise of plugging in is no problem yet"
    daemon.wait(1.0)
    daemon.answer(TWO)
    assert said(mounting)[1].startswith("Nothing was changed: two devices answer under this id.")
    daemon.wait(1.0)
    daemon.answer(adopted("top", 2))
    assert said(mounting) == ("All are adopted.", "")


def test_a_sensor_that_needs_power_off_and_on_counts_once_the_daemon_polls_it(daemon: FakeDaemon) -> None:
    mounting = begun(daemon)
    failed = {"status": "failed", "error": {"code": "power_cycle_needed", "message": "m"}, "data": {"device": "top"}}
    daemon.answer(failed)
    assert "Disconnect the sensor from power" in said(mounting)[1]
    daemon.wait(10.0)
    daemon.answer(health(old=9, top=2))
    assert said(mounting) == (NEXT, "")
    assert mounting.shown()["adopted"][0]["words"] == "top: slave id 2, 19200 baud"


def test_a_daemon_that_goes_away_is_waited_for(daemon: FakeDaemon) -> None:
    mounting = begun(daemon, "top")
    daemon.answer(BrokerError("broker localhost:1883: connection refused"))
    assert said(mounting)[1] == "broker localhost:1883: connection refused; waiting until it is there again"
    daemon.run(daemon.there.set)
    assert said(mounting)[1] == ""
    daemon.answer(health(old=9, top=2))
    assert said(mounting)[0] == "All are adopted.", "it was adopted before the answer was lost"


def test_what_no_plugging_in_will_mend_ends_it(daemon: FakeDaemon) -> None:
    mounting = begun(daemon, "old")
    taken = {"status": "rejected", "error": {"code": "invalid_param", "message": "name: old is taken"}}
    daemon.answer(taken)
    assert said(mounting) == (
        "It ended.",
        "Nothing was changed: a value is wrong. Name: old is taken. Correct what the message names.",
    )
    assert not mounting.running


@pytest.mark.parametrize("response", [{"status": "rejected"}, None, {}])
def test_a_response_that_says_nothing_ends_it_too(daemon: FakeDaemon, response: dict[str, Any] | None) -> None:
    mounting = begun(daemon)
    daemon.answer(response)
    assert said(mounting)[0] == "It ended."


@pytest.mark.parametrize("error", [BrokerError("connection refused"), FailedError("not authorized")])
def test_without_a_broker_it_says_so_and_ends(daemon: FakeDaemon, error: Exception) -> None:
    daemon.refuses = error
    mounting = Mounting(login(), [], client=daemon.client)
    daemon.run(mounting.start)
    assert said(mounting) == ("It ended.", str(error))
    assert daemon.connected == 0


def test_a_daemon_that_does_not_tell_its_health_ends_it(daemon: FakeDaemon) -> None:
    mounting = Mounting(login(), [], client=daemon.client)
    daemon.run(mounting.start)
    daemon.answer(None)
    assert said(mounting) == ("It ended.", "no response to health within 10 s")


def test_who_went_home_need_not_end_it(daemon: FakeDaemon) -> None:
    mounting = begun(daemon)
    daemon.wait(LONGEST)
    assert said(mounting) == ("It ended by itself after two hours.", "")
    assert not mounting.running
    assert daemon.connected == 0


def test_it_is_stopped_by_the_person(daemon: FakeDaemon) -> None:
    mounting = Mounting(login(), [], client=daemon.client)
    assert daemon.task(mounting.stop()).done(), "before it has begun there is nothing to end"
    daemon.run(mounting.start)
    daemon.task(mounting.stop()).result()
    assert said(mounting)[0] == "Ended."
    assert daemon.connected == 0
