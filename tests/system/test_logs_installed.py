"""Logging as it is installed in a process."""

from __future__ import annotations

import gc
import logging
import os
import sys
import threading
import warnings
from collections.abc import Iterator

import pytest

from lfs10d.system.logs import (
    install,
)
from tests.support.log_records import fail, raised


@pytest.fixture
def logging_restored(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Put the logging of the process back as it was."""
    monkeypatch.setattr(threading, "excepthook", threading.excepthook)
    monkeypatch.setattr(sys, "unraisablehook", sys.unraisablehook)
    monkeypatch.setattr(warnings, "showwarning", warnings.showwarning)
    monkeypatch.delenv("JOURNAL_STREAM", raising=False)
    root, ours = logging.getLogger(), logging.getLogger("lfs10d")
    before = root.handlers[:], root.level, ours.level
    yield
    logging.captureWarnings(capture=False)
    root.handlers[:], root_level, our_level = before
    root.setLevel(root_level)
    ours.setLevel(our_level)


@pytest.mark.usefixtures("logging_restored")
def test_installed_logging_tells_us_by_level_and_others_from_warning_on(pipe: tuple[int, int]) -> None:
    install("info", "text", descriptor=pipe[1])

    logging.getLogger("lfs10d.modbus").debug("frame")
    logging.getLogger("lfs10d.modbus").info("port open")
    logging.getLogger("paho").info("chatter")
    logging.getLogger("paho").warning("trouble")

    lines = os.read(pipe[0], 4096).decode().splitlines()
    assert [line.partition("Z ")[2] for line in lines] == ["info port open", "warning paho: trouble"]


@pytest.mark.usefixtures("logging_restored")
def test_installed_again_it_takes_the_place_of_the_first(pipe: tuple[int, int]) -> None:
    install("error", "text", descriptor=pipe[1])
    install("debug", "journal", descriptor=pipe[1])

    logging.getLogger("lfs10d").debug("frame", exc_info=raised())

    line = os.read(pipe[0], 4096)
    assert line.startswith(b"<7>frame: ValueError: no such\\nregister | Traceback")
    assert line.count(b"\n") == 1


@pytest.mark.usefixtures("logging_restored")
def test_under_the_journal_lines_have_a_priority_by_themselves(
    pipe: tuple[int, int], monkeypatch: pytest.MonkeyPatch
) -> None:
    status = os.fstat(pipe[1])
    monkeypatch.setenv("JOURNAL_STREAM", f"{status.st_dev}:{status.st_ino}")
    install("info", descriptor=pipe[1])

    logging.getLogger("lfs10d").error("broken")

    assert os.read(pipe[0], 4096) == b"<3>broken\n"


@pytest.mark.usefixtures("logging_restored")
def test_what_nobody_caught_is_one_line_too(pipe: tuple[int, int]) -> None:
    install("info", "journal", descriptor=pipe[1])

    class Spiteful:
        def __del__(self) -> None:
            raise ValueError("in a destructor")

    thread = threading.Thread(target=fail, args=(ValueError("in a thread"),), name="line")
    thread.start()
    thread.join()
    Spiteful()
    gc.collect()

    first, second = os.read(pipe[0], 4096).decode().splitlines()
    assert first == "<3>the thread line ended: ValueError: in a thread"
    assert second.startswith("<3>")
    assert second.endswith("ValueError: in a destructor")


@pytest.mark.usefixtures("logging_restored")
def test_a_thread_that_is_gone_already_is_told_without_its_name(pipe: tuple[int, int]) -> None:
    install("info", "journal", descriptor=pipe[1])

    threading.excepthook(threading.ExceptHookArgs((ValueError, ValueError("late"), None, None)))

    assert os.read(pipe[0], 4096) == b"<3>the thread unknown ended: ValueError: late\n"
