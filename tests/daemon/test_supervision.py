"""The look from inside, once a second."""

from __future__ import annotations

import asyncio
import json
import logging
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from lfs10d.daemon.status_file import StatusFile
from lfs10d.daemon.supervision import Supervision
from lfs10d.daemon.watchdog import GRACE
from lfs10d.system.systemd import Notifier


class Told(Notifier):
    """A service manager that notes what it is told."""

    def __init__(self) -> None:
        super().__init__({"WATCHDOG_USEC": "30000"})
        self.fed = 0
        self.said: list[str] = []

    def feed(self) -> bool:
        self.fed += 1
        return True

    def status(self, text: str) -> bool:
        self.said.append(text)
        return True


def look(notifier: Notifier, file: StatusFile | None, declared: Callable[[], float], *, looks: int = 3) -> None:
    """Let it look so many times."""
    summaries = iter(["8 of 8 slaves online"] * looks)

    def summary() -> str:
        try:
            return next(summaries)
        except StopIteration:
            raise asyncio.CancelledError from None

    watching = Supervision(notifier, file, declared=declared, snapshot=lambda: {"v": 1}, summary=summary)
    with pytest.raises(asyncio.CancelledError):
        asyncio.run(watching.run())


def test_while_the_line_progresses_the_watchdog_is_fed_and_the_status_told_once() -> None:
    told = Told()

    look(told, None, time.monotonic)

    assert told.fed == 4
    assert told.said == ["8 of 8 slaves online"]


def test_a_line_that_stands_still_starves_the_watchdog_and_is_reported_once(caplog: pytest.LogCaptureFixture) -> None:
    told = Told()

    with caplog.at_level(logging.ERROR):
        look(told, None, lambda: time.monotonic() - GRACE - 1)

    assert told.fed == 0
    assert [record.message for record in caplog.records if "no progress" in record.message] == [
        "the line's thread makes no progress; the watchdog is no longer fed"
    ]
    assert any(record.message.startswith("thread MainThread: ") for record in caplog.records)


def test_the_status_file_is_written_and_taken_away(tmp_path: Path) -> None:
    shown: list[object] = []

    class Seen(StatusFile):
        def remove(self) -> None:
            shown.append(json.loads(self.path.read_text()))
            super().remove()

    look(Told(), Seen(tmp_path / "status.json"), time.monotonic)

    assert shown == [{"v": 1}]
    assert not list(tmp_path.iterdir())


def test_a_status_file_that_cannot_be_written_is_told_once(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    (tmp_path / "file").write_text("")

    with caplog.at_level(logging.WARNING):
        look(Told(), StatusFile(tmp_path / "file" / "status.json"), time.monotonic)

    assert [record.message for record in caplog.records] == [
        f"{tmp_path}/file/status.json cannot be written: `lfs10d watch` needs the broker"
    ]
