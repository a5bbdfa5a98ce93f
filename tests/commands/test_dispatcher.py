"""The service: every request is performed at most once and answered exactly once, to where it came from."""

from __future__ import annotations

import asyncio
import json
import logging

import pytest

from lfs10d.commands.admission import BURST
from lfs10d.commands.message import LARGEST_CORRELATION
from tests.support.dispatchers import Bench, run


def test_a_request_is_answered_on_the_topic_of_its_name_with_its_id() -> None:
    async def scene() -> None:
        bench = Bench()
        bench.ask("echo", {"id": "a1", "text": "hello"})
        await bench.settle()
        ((topic, payload, correlation),) = bench.answered
        took = payload.pop("took_ms")
        assert (topic, correlation) == ("response/echo", None)
        assert payload == {
            "v": 1,
            "id": "a1",
            "request": "echo",
            "status": "ok",
            "data": {"text": "hello"},
            "error": None,
        }
        assert 0 <= took < 1000

    run(scene())


def test_correlation_data_that_is_too_large_is_refused_and_neither_kept_nor_returned() -> None:
    async def scene() -> None:
        bench = Bench()
        large = bytes(LARGEST_CORRELATION + 1)
        for content, retained in (({"id": "a"}, False), ({"id": "b"}, True), (b"[", False), (b"x" * 5000, False)):
            bench.ask("echo", content, retained=retained, correlation=large)
        bench.ask("echo", {"id": "c"}, correlation=large[:-1])
        await bench.settle()
        assert bench.codes == ["too_large", "retained", "too_large", "too_large", None]
        assert [correlation for _, _, correlation in bench.answered] == [None] * 4 + [large[:-1]]
        assert bench.performed == ["echo"]

    run(scene())


def test_a_response_topic_and_correlation_data_are_obeyed_by_every_kind_of_answer() -> None:
    async def scene() -> None:
        bench = Bench()
        for name, content, retained in (
            ("echo", {}, False),
            ("echo", b"{", False),
            ("device/break", {}, False),
            ("no/such", {}, False),
            ("echo", {}, True),
        ):
            bench.ask(name, content, retained=retained, response_topic="response/mine", correlation=b"\x00c")
            await bench.settle()
        assert [(topic, correlation) for topic, _, correlation in bench.answered] == [("response/mine", b"\x00c")] * 5

    run(scene())


@pytest.mark.parametrize("name", ["", "no/such", "echo/more", "device", "a/b/c/d", "response/unknown", "\x1b[2J/\n"])
def test_an_unknown_request_is_answered_on_response_unknown(name: str) -> None:
    async def scene() -> None:
        bench = Bench()
        bench.ask(name, {"id": 4})
        ((topic, payload, _),) = bench.answered
        assert (topic, payload["request"], payload["id"]) == ("response/unknown", name, 4)
        assert payload["error"]["code"] == "unknown_request"

    run(scene())


def test_of_a_long_name_64_characters_are_told_back() -> None:
    async def scene() -> None:
        bench = Bench()
        bench.ask("x" * 5000)
        assert bench.answered[0][1]["request"] == "x" * 64

    run(scene())


def test_a_retained_request_is_rejected_and_cleared_where_it_stands() -> None:
    async def scene() -> None:
        bench = Bench()
        bench.ask("echo", {"id": 1}, retained=True)
        bench.ask("no/such", {"id": 2}, retained=True)
        await bench.settle()
        assert (bench.codes, bench.topics) == (["retained"] * 2, ["response/echo", "response/unknown"])
        assert bench.cleared == ["request/echo", "request/no/such"]
        assert bench.performed == []

    run(scene())


def test_an_empty_payload_is_neither_answered_nor_performed_nor_cleared() -> None:
    async def scene() -> None:
        bench = Bench()
        bench.ask("echo", b"")
        bench.ask("echo", b"", retained=True)
        await bench.settle()
        assert (bench.answered, bench.performed, bench.cleared) == ([], [], [])

    run(scene())


def test_a_repeat_waits_for_the_first_and_both_get_the_same_answer_each_to_its_own_place() -> None:
    async def scene() -> None:
        bench = Bench()
        bench.ask("device/wait", {"id": "a", "text": "x"}, response_topic="response/one", correlation=b"1")
        await bench.settle()
        bench.ask("device/wait", {"id": "a", "text": "x"}, response_topic="response/two", correlation=b"2")
        bench.ask("device/wait", {"transaction": "a", "text": "x"})
        await bench.settle()
        assert bench.answered == []
        bench.gate.set()
        await bench.settle()
        bench.ask("device/wait", {"id": "a", "text": "x"}, response_topic="response/later", correlation=b"4")
        assert bench.performed == ["wait x"]
        assert [(topic, correlation) for topic, _, correlation in bench.answered] == [
            ("response/one", b"1"),
            ("response/two", b"2"),
            ("response/device/wait", None),
            ("response/later", b"4"),
        ]
        first, second, third, later = (payload for _, payload, _ in bench.answered)
        assert first == second == later
        assert third == {**first, "id": None, "transaction": "a"}

    run(scene())


def test_a_mistake_of_ours_is_answered_internal_and_its_words_stay_in_the_log(
    caplog: pytest.LogCaptureFixture,
) -> None:
    async def scene() -> None:
        bench = Bench()
        bench.ask("device/break", {"id": 1})
        await bench.settle()
        ((_, payload, _),) = bench.answered
        assert (payload["status"], payload["error"]["code"]) == ("failed", "internal")
        assert "mistake with" not in json.dumps(payload)

    run(scene())
    assert any("mistake with" in str(record.exc_info) for record in caplog.records)


def test_a_class_not_allowed_is_answered_not_allowed_until_it_is() -> None:
    async def scene() -> None:
        bench = Bench()
        bench.ask("register/read")
        bench.service.allow(frozenset({"registers"}))
        bench.ask("register/read")
        await bench.settle()
        assert bench.codes == ["not_allowed", "internal"]

    run(scene())


def test_when_the_daemon_ends_what_runs_and_what_comes_is_answered_cancelled() -> None:
    async def scene() -> None:
        bench = Bench()
        bench.ask("device/wait", {"id": "running"})
        await bench.settle()
        bench.ask("device/wait", {"id": "running"}, response_topic="response/repeat")
        bench.ask("device/wait", {"id": "not begun"})
        await bench.service.stop()
        bench.ask("echo", {"id": "too late"})
        await bench.settle()
        told = [(payload["id"], payload["status"], payload["error"]["code"]) for _, payload, _ in bench.answered]
        assert sorted(told) == [
            ("not begun", "failed", "cancelled"),
            ("running", "failed", "cancelled"),
            ("running", "failed", "cancelled"),
            ("too late", "rejected", "cancelled"),
        ]
        assert bench.performed == ["wait "]

    run(scene())


def test_every_request_of_a_flood_is_answered_and_the_log_has_one_line_of_it(
    caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    async def scene() -> None:
        bench = Bench()
        with monkeypatch.context() as patch:
            patch.setattr(asyncio.get_running_loop(), "time", lambda: 0.0)  # all of it at one moment
            for _ in range(5 * BURST):
                bench.ask("echo")
        await bench.settle()
        assert len(bench.answered) == 5 * BURST
        assert len(bench.performed) == BURST
        assert bench.codes.count("rate_limited") == 4 * BURST

    with caplog.at_level(logging.INFO, "lfs10d"):
        run(scene())
    assert [record.levelname for record in caplog.records] == ["WARNING"]
