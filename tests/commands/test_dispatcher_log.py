"""What the log says of requests."""

from __future__ import annotations

import asyncio
import logging

import pytest

from lfs10d.commands.admission import BURST
from lfs10d.commands.message import LARGEST
from tests.support.dispatchers import Bench, run


@pytest.mark.parametrize(("content", "retained"), [({}, True), (b" " * (LARGEST + 1), False)])
def test_of_a_flood_that_is_retained_or_too_large_the_log_has_the_burst_and_one_line(
    content: object, retained: bool, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch  # noqa: FBT001 - a column of the table
) -> None:  # fmt: skip
    async def scene() -> None:
        bench = Bench()
        monkeypatch.setattr(asyncio.get_running_loop(), "time", lambda: 0.0)  # all of it at one moment
        for _ in range(5 * BURST):
            bench.ask("echo", content, retained=retained)
        assert len(bench.answered) == 5 * BURST

    with caplog.at_level(logging.INFO, "lfs10d"):
        run(scene())
    assert len(caplog.records) == BURST + 1
    assert caplog.records[-1].levelname == "WARNING"


HOSTILE = "\x1b[31m\r\n\u2028\u202e"


def test_nothing_of_a_topic_or_a_payload_reaches_the_log_unescaped(caplog: pytest.LogCaptureFixture) -> None:
    async def scene() -> None:
        bench = Bench()
        bench.ask(f"no/{HOSTILE}", {"id": HOSTILE})
        bench.ask("echo", {"id": HOSTILE, HOSTILE: HOSTILE})
        bench.ask("echo", b"\x1b[31m")
        bench.ask("echo", b"\x1b" * (LARGEST + 1), retained=True)
        bench.ask("device/wait", {"id": HOSTILE, "text": HOSTILE}, response_topic=f"response/{HOSTILE}")
        await bench.settle()
        bench.ask("device/wait", {"id": HOSTILE, "text": HOSTILE})
        bench.gate.set()
        await bench.settle()
        assert len(bench.answered) == 6

    with caplog.at_level(logging.DEBUG, "lfs10d"):
        run(scene())
    messages = [record.getMessage() for record in caplog.records]
    assert len(messages) >= 5
    assert all(message.isprintable() for message in messages)


def test_what_is_always_allowed_and_goes_well_is_no_news(caplog: pytest.LogCaptureFixture) -> None:
    async def scene() -> None:
        bench = Bench()
        bench.gate.set()
        bench.ask("echo")
        bench.ask("device/wait")
        await bench.settle()

    with caplog.at_level(logging.INFO, "lfs10d"):
        run(scene())
    assert [record.getMessage() for record in caplog.records] == ["request device/wait: ok"]
