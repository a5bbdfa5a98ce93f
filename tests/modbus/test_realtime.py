"""Waking up on time; every change is made to a thread that ends with its test."""

from __future__ import annotations

import errno
import os
import resource
import threading
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

import pytest

from lfs10d.modbus.realtime import PRIORITY, sharpen_timers, take_precedence, yield_precedence

T = TypeVar("T")


def in_a_thread(call: Callable[[], T]) -> T:
    """Return what `call` returns in a thread of its own."""
    found: list[T] = []
    thread = threading.Thread(target=lambda: found.append(call()))
    thread.start()
    thread.join()
    return found[0]


def slack() -> str:
    """Return the timer slack of the calling thread, ns, as the kernel says it."""
    return Path(f"/proc/{threading.get_native_id()}/timerslack_ns").read_text().strip()


def test_the_timer_slack_of_the_calling_thread_alone_becomes_1_ns() -> None:
    before = slack()

    taken, inside = in_a_thread(lambda: (sharpen_timers(), slack()))

    assert taken
    assert inside == "1"
    assert slack() == before


def test_without_the_file_of_the_kernel_the_slack_stays_and_is_told(tmp_path: Path) -> None:
    assert not sharpen_timers(proc=tmp_path)


def test_a_slack_that_did_not_take_is_told(tmp_path: Path) -> None:
    folder = tmp_path / str(threading.get_native_id())
    folder.mkdir()
    (folder / "timerslack_ns").symlink_to("/dev/null")

    assert not sharpen_timers(proc=tmp_path)


@pytest.mark.parametrize(("limit", "asked"), [(0, PRIORITY), (3, 3), (99, PRIORITY), (-1, PRIORITY)])
def test_the_thread_asks_for_the_priority_that_its_limit_allows(
    monkeypatch: pytest.MonkeyPatch, limit: int, asked: int
) -> None:
    calls: list[tuple[int, int, int]] = []
    monkeypatch.setattr(resource, "getrlimit", lambda _which: (limit, limit))
    monkeypatch.setattr(
        os,
        "sched_setscheduler",
        lambda pid, policy, parameters: calls.append((pid, policy, parameters.sched_priority)),
    )

    assert take_precedence() is None
    assert calls == [(0, os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, asked)]


def test_where_it_is_not_permitted_the_reason_says_what_to_do(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        raise PermissionError(errno.EPERM, os.strerror(errno.EPERM))

    monkeypatch.setattr(os, "sched_setscheduler", refuse)

    assert take_precedence() == (
        "line.realtime is set, but the system does not permit SCHED_FIFO (Operation not permitted): "
        "in a service add systemd/realtime.conf.example as a drop-in, elsewhere raise the limit (ulimit -r 10), "
        "or set line.realtime to false"
    )


def test_the_kernel_agrees_whether_it_was_permitted() -> None:
    """The other threads of the process stay as they were."""
    before = os.sched_getscheduler(0)

    refused, policy = in_a_thread(lambda: (take_precedence(), os.sched_getscheduler(0)))

    assert (refused is None) == (policy & os.SCHED_FIFO != 0)
    assert os.sched_getscheduler(0) == before


def test_a_thread_that_yields_is_an_ordinary_one_again() -> None:
    def give_and_take() -> int:
        take_precedence()
        yield_precedence()
        return os.sched_getscheduler(0)

    assert in_a_thread(give_and_take) & ~os.SCHED_RESET_ON_FORK == os.SCHED_OTHER


def test_a_system_that_lets_nobody_yield_is_no_error(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        raise PermissionError(errno.EPERM, os.strerror(errno.EPERM))

    monkeypatch.setattr(os, "sched_setscheduler", refuse)
    before = os.sched_getscheduler(0)

    yield_precedence()

    assert os.sched_getscheduler(0) == before
