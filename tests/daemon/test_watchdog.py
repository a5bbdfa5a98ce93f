"""Whether the line thread makes progress, and where it stands."""

from __future__ import annotations

import threading

import pytest

from lfs10d.daemon.watchdog import GRACE, progressing, stacks


@pytest.mark.parametrize(("late", "well"), [(-5.0, True), (0.0, True), (GRACE, True), (GRACE + 0.001, False)])
def test_it_progresses_while_it_is_not_later_than_declared_and_the_grace(late: float, *, well: bool) -> None:
    assert progressing(1000.0, 1000.0 + late) is well


def test_each_thread_is_one_line_with_where_it_stands() -> None:
    go_on, stands = threading.Event(), threading.Event()

    def stand_here() -> None:
        stands.set()
        go_on.wait()

    thread = threading.Thread(target=stand_here, name="line")
    thread.start()
    stands.wait()
    lines = stacks([thread, threading.current_thread()])
    go_on.set()
    thread.join()

    assert len(lines) == 2
    assert lines[0].startswith("thread line: ")
    assert "stand_here" in lines[0]
    assert "\n" not in lines[0]


def test_a_thread_that_is_over_or_was_never_begun_has_no_line() -> None:
    over = threading.Thread(target=lambda: None)
    over.start()
    over.join()

    assert stacks([over, threading.Thread()]) == []
