"""Sensors adopted one after the other, response by response."""

from __future__ import annotations

from typing import Any

import pytest

from lfs10d.cli.adopt_loop import RECHECK_AFTER, RETRY_AFTER, RETRY_FAILED_AFTER, AdoptedSensor, AdoptLoop, AdoptTurn


def ok(device: str, slave: object) -> dict[str, Any]:
    return {"status": "ok", "data": {"device": device, "slave": slave, "from": 1}, "error": None}


def no(code: str, status: str = "rejected", data: object = None, **facts: object) -> dict[str, Any]:
    return {"status": status, "data": data, "error": {"code": code, "message": f"it is {code}", **facts}}


def pending(code: str, device: str = "slave-3") -> dict[str, Any]:
    return no(code, "failed", {"device": device, "from": 1, "to": 3})


def health(*devices: tuple[str, object], baudrate: object = 19200) -> dict[str, Any]:
    return {"line": {"baudrate": baudrate}, "devices": [{"name": name, "slave": slave} for name, slave in devices]}


def begun(*names: str, **parameters: object) -> AdoptLoop:
    """Return a loop on a line with one sensor, which is looked at already."""
    loop = AdoptLoop(names, parameters)
    steps = [loop.uncertain, list(loop.on_health(health(("slave-2", 2)))), loop.uncertain]
    assert steps == [True, [], False]
    return loop


ABSENT = no("timeout")
NAMED = AdoptedSensor("slave-3", 3, 19200)


def test_each_sensor_gets_its_default_name_and_it_never_ends_by_itself() -> None:
    loop = begun(label="Roof")
    assert loop.content == {"label": "Roof"}
    assert loop.on_response(ok("slave-3", 3)) == AdoptTurn(NAMED, pause=0.0)
    assert loop.on_response(ok("slave-4", 4)).adopted == AdoptedSensor("slave-4", 4, 19200)
    assert [each.device for each in loop.adopted] == ["slave-3", "slave-4"]
    assert not loop.complete
    assert not loop.unfinished


def test_names_are_given_in_turn_and_the_last_completes_it() -> None:
    loop = begun("north", "south", label="Roof")
    assert loop.content == {"label": "Roof", "name": "north"}
    loop.on_response(ABSENT)
    assert loop.content["name"] == "north"
    loop.on_response(ok("north", 3))
    assert loop.content["name"] == "south"
    assert (loop.complete, loop.unfinished) == (False, True)
    loop.on_response(ok("south", 4))
    assert (loop.complete, loop.unfinished) == (True, False)
    assert loop.content == {"label": "Roof"}


def test_while_nobody_is_there_nothing_is_told() -> None:
    loop = begun()
    assert [loop.on_response(ABSENT) for _ in range(3)] == [AdoptTurn()] * 3
    assert AdoptTurn().pause == RETRY_AFTER


def test_a_trouble_is_told_once_until_another_comes_or_a_sensor_is_adopted() -> None:
    loop = begun()
    busy, lost = no("busy"), no("line_error")
    told = [loop.on_response(each).problem for each in (busy, busy, lost, lost, busy, ok("slave-3", 3), busy)]
    words = "busy: it is busy"
    assert told == [words, None, "line_error: it is line_error", None, words, None, words]


def test_two_sensors_are_told_when_they_are_heard_twice_in_a_row() -> None:
    loop = begun()
    crowd = no("duplicate_id")
    told = [loop.on_response(each).problem for each in (crowd, ABSENT, crowd, crowd)]
    assert told == [None, None, None, "duplicate_id: it is duplicate_id"]


@pytest.mark.parametrize("code", ["busy", "line_error", "rate_limited", "cancelled"])
def test_what_passes_does_not_end_it(code: str) -> None:
    assert not begun().on_response(no(code)).ends


@pytest.mark.parametrize("code", ["not_allowed", "invalid_param", "storage_full", "address_in_use", "internal"])
def test_what_no_plugging_mends_ends_it_and_is_told(code: str) -> None:
    assert begun().on_response(no(code, param="from")) == AdoptTurn(problem=f"{code}: it is {code}", ends=True)


@pytest.mark.parametrize("code", ["dip_switch", "refused", "duplicate_id"])
def test_a_sensor_that_does_not_obey_is_left_alone_for_a_while(code: str) -> None:
    loop = begun()
    assert loop.on_response(pending(code)) == AdoptTurn(problem=f"{code}: it is {code}", pause=RETRY_FAILED_AFTER)
    assert loop.on_response(pending(code)) == AdoptTurn(pause=RETRY_FAILED_AFTER)
    assert not loop.uncertain


def test_a_sensor_whose_place_cannot_be_kept_ends_it() -> None:
    assert begun().on_response(no("storage_full", "failed")).ends


@pytest.mark.parametrize("code", ["power_cycle_needed", "not_verified"])
def test_a_sensor_that_is_looked_for_counts_once_it_is_polled(code: str) -> None:
    loop = begun("north", "south")
    loop.on_response(pending(code, "north"))
    assert list(loop.on_health(health(("slave-2", 2)))) == []
    assert loop.on_response(no("address_in_use", param="from")) == AdoptTurn(pause=RECHECK_AFTER)
    assert loop.content["name"] == "north"
    found = list(loop.on_health(health(("slave-2", 2), ("north", 3), ("other", 9))))
    assert found == [AdoptedSensor("north", 3, 19200)]
    assert not loop.uncertain
    assert loop.content["name"] == "south"


def test_where_an_answer_was_lost_a_device_that_came_up_is_the_one() -> None:
    loop = begun()
    loop.answer_lost()
    assert list(loop.on_health(health(("slave-2", 2), ("slave-3", 3)))) == [NAMED]
    assert list(loop.on_health(health(("slave-2", 2), ("slave-3", 3)))) == []


def test_a_device_that_somebody_else_adds_does_not_count() -> None:
    loop = begun()
    assert list(loop.on_health(health(("slave-2", 2), ("slave-9", 9)))) == []
    loop.answer_lost()
    assert list(loop.on_health(health(("slave-2", 2), ("slave-9", 9)))) == []


@pytest.mark.parametrize("settling", [ABSENT, ok("slave-3", 3)])
def test_the_next_clear_answer_settles_that_nothing_was_lost(settling: dict[str, Any]) -> None:
    loop = begun()
    loop.answer_lost()
    loop.on_response(settling)
    assert not loop.uncertain


def test_a_daemon_that_ends_in_the_middle_may_have_adopted() -> None:
    loop = begun()
    assert not loop.on_response(no("cancelled", "failed")).ends
    assert loop.uncertain


def test_an_adopted_sensor_is_told_in_words_and_as_data() -> None:
    assert NAMED.words == "slave-3: slave id 3, 19200 baud"
    assert AdoptedSensor("\x1b[2J", None, None).words == r"\x1b[2J: slave id ?"
    assert NAMED.data == {"device": "slave-3", "slave": 3, "baudrate": 19200}


@pytest.mark.parametrize(
    "answer", [{}, {"line": [], "devices": {}}, {"line": {"baudrate": "x"}, "devices": [1, {}]}, 5]
)
def test_a_health_of_another_form_tells_nothing(answer: object) -> None:
    loop = AdoptLoop()
    assert list(loop.on_health(answer)) == []
    assert loop.on_response(ok("slave-3", "three")).adopted == AdoptedSensor("slave-3", None, None)


def test_an_answer_of_another_form_ends_it() -> None:
    assert begun().on_response({"status": "rejected", "error": 5}).ends
    assert begun().on_response({"status": "ok", "data": None, "error": None}).problem == "None: None"


def test_an_internal_error_ends_it_for_it_would_come_again() -> None:
    # It asked every 10 s for ever before.
    turn = begun().on_response(no("internal", "failed"))
    assert (turn.problem, turn.ends) == ("internal: it is internal", True)


def test_a_device_that_is_not_recognised_is_told_once_and_waited_for_to_be_unplugged() -> None:
    loop = begun()
    assert loop.on_response(no("not_recognised")) == AdoptTurn(
        problem="not_recognised: it is not_recognised", pause=RETRY_AFTER
    )
    assert loop.on_response(no("not_recognised")) == AdoptTurn()
    assert loop.on_response(ok("slave-3", 3)).adopted == NAMED
