"""Requests of viewers: each is carried out once, kept, and answered in words, whatever becomes of it."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator
from typing import Any

import pytest

from lfs10d.errors import BrokerError, FailedError
from lfs10d.web.actions import ENDED, MOST_AT_ONCE, RECORDS_KEPT, Answer, LineActions
from tests.web.daemons import OK, FakeDaemon, login

READ = "device/read"
MAST = {"device": "mast-top"}


@pytest.fixture
def daemon() -> Iterator[FakeDaemon]:
    made = FakeDaemon()
    yield made
    made.close()


@pytest.fixture
def actions(daemon: FakeDaemon) -> LineActions:
    return LineActions(login(), client=daemon.client)


def sent(
    daemon: FakeDaemon, actions: LineActions, name: str = READ, parameters: dict[str, Any] | None = None
) -> asyncio.Task[Answer]:
    return daemon.task(actions.request(name, MAST if parameters is None else parameters))


def test_a_request_is_shown_as_running_and_then_with_its_answer(daemon: FakeDaemon, actions: LineActions) -> None:
    task = sent(daemon, actions)
    (record,) = actions.shown()["requests"]
    assert (record["number"], record["name"], record["parameters"]) == (1, READ, MAST)
    assert (record["status"], record["words"], record["ended"]) == ("running", "", None)
    daemon.answer({"status": "ok", "data": {"wind_speed": 3.5, "odd": float("inf")}})
    assert task.result() == Answer(
        200, {"status": "ok", "data": {"wind_speed": 3.5, "odd": float("inf")}, "words": "Done."}
    )
    (record,) = actions.shown()["requests"]
    assert (record["status"], record["words"]) == ("ok", "Done.")
    assert record["data"] == {"wind_speed": 3.5, "odd": None}, "a browser could not read it"
    assert record["ended"] >= record["began"]
    assert daemon.connected == 0


def test_each_has_a_client_id_and_an_id_of_its_own_and_a_given_id_is_kept(
    daemon: FakeDaemon, actions: LineActions
) -> None:
    for parameters in (MAST, MAST, {"id": "mine"}):
        sent(daemon, actions, parameters=parameters)
    assert len(set(daemon.client_ids)) == 3
    assert all(each.startswith("lfs10d-web-") for each in daemon.client_ids)
    first, second, third = (content["id"] for _, content, _ in daemon.asked)
    assert first != second
    assert third == "mine"


def test_what_takes_long_is_waited_for_without_an_end(daemon: FakeDaemon, actions: LineActions) -> None:
    for name in (READ, "line/scan", "device/readdress"):
        sent(daemon, actions, name)
    assert [within for _, _, within in daemon.asked] == [10.0, None, None]


@pytest.mark.parametrize("error", [BrokerError("connection refused"), FailedError("not authorized")])
def test_without_a_broker_the_request_is_lost_and_says_why(
    daemon: FakeDaemon, actions: LineActions, error: Exception
) -> None:
    daemon.refuses = error
    answer = sent(daemon, actions).result()
    assert (answer.code, answer.body["status"], answer.body["words"]) == (503, "lost", str(error))
    assert answer.body["error"] == {"code": "unavailable", "message": str(error)}
    assert actions.shown()["requests"][0]["status"] == "lost"


def test_no_answer_may_still_mean_that_it_was_carried_out(daemon: FakeDaemon, actions: LineActions) -> None:
    task = sent(daemon, actions)
    daemon.answer(None)
    assert task.result().code == 504
    assert task.result().body["words"] == "No answer within 10 s; it may or may not have been carried out."


def test_a_viewer_that_goes_away_ends_no_request(daemon: FakeDaemon, actions: LineActions) -> None:
    task = sent(daemon, actions)
    daemon.run(task.cancel)
    assert task.cancelled()
    daemon.answer(OK)
    assert actions.shown()["requests"][0]["status"] == "ok"


def test_the_end_of_the_server_is_an_answer_too(daemon: FakeDaemon, actions: LineActions) -> None:
    task = sent(daemon, actions)
    daemon.task(actions.close()).result()
    assert (task.result().code, task.result().body["words"]) == (503, ENDED)
    assert actions.shown()["requests"][0]["words"] == ENDED
    assert daemon.connected == 0


def test_at_most_so_many_requests_are_under_way(daemon: FakeDaemon, actions: LineActions) -> None:
    running = [sent(daemon, actions) for _ in range(MOST_AT_ONCE)]
    refused = sent(daemon, actions).result()
    assert (refused.code, refused.body["error"]["code"]) == (429, "busy")
    assert len(daemon.asked) == MOST_AT_ONCE
    daemon.answer(OK)
    assert running[0].result().code == 200
    assert not sent(daemon, actions).done(), "there is room again"


def test_the_last_requests_are_kept(daemon: FakeDaemon, actions: LineActions) -> None:
    for _ in range(RECORDS_KEPT + 3):
        sent(daemon, actions)
        daemon.answer(OK)
    numbers = [each["number"] for each in actions.shown()["requests"]]
    assert numbers == list(range(4, RECORDS_KEPT + 4))


def test_sensors_are_mounted_by_one_person_at_a_time(daemon: FakeDaemon, actions: LineActions) -> None:
    assert daemon.task(actions.stop_mounting()).result().code == 200, "there is nothing to end"
    assert daemon.run(lambda: actions.mount(["top"])).code == 200
    daemon.loop.drain()
    assert actions.shown()["mounting"]["running"] is True
    assert daemon.run(lambda: actions.mount(["low"])).code == 409
    assert daemon.task(actions.stop_mounting()).result().code == 200
    assert actions.shown()["mounting"]["words"] == "Ended."
    assert daemon.run(lambda: actions.mount(["low"])).code == 200, "and anew"
    daemon.task(actions.close()).result()
    assert actions.shown()["mounting"]["running"] is False
