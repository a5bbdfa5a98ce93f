"""Whether the wall clock is synchronised: timesyncd's mark, else timedate1's answer, else nobody knows."""

from __future__ import annotations

from pathlib import Path

import pytest

from lfs10d.system.clock import LOOK_AGAIN, SOON_AFTER_START, _together, judge, look, look_again


@pytest.mark.parametrize(
    ("answer", "state"),
    [("yes", "synced"), ("no", "unsynced"), ("", "unknown"), ("n/a", "unknown"), (None, "unknown")],
)
def test_the_answer_of_timedate1_is_taken_literally(answer: str | None, state: str) -> None:
    assert judge(answer) == state


def test_the_mark_of_timesyncd_is_enough_and_nothing_is_started(tmp_path: Path) -> None:
    mark = tmp_path / "synchronized"
    mark.touch()
    started = tmp_path / "started"

    assert look(mark=mark, question=("touch", str(started))) == "synced"
    assert not started.exists()


@pytest.mark.parametrize(
    ("question", "state"),
    [
        (("echo", "yes"), "synced"),
        (("echo", "no"), "unsynced"),
        (("echo", "\u00ff"), "unknown"),
        (("sh", "-c", "echo yes; exit 1"), "unknown"),
        (("lfs10d-no-such-program",), "unknown"),
        (("cat",), "unknown"),  # reads nothing: standard input is closed to it
    ],
)
def test_without_the_mark_timedate1_is_asked(tmp_path: Path, question: tuple[str, ...], state: str) -> None:
    assert look(mark=tmp_path / "synchronized", question=question) == state


def test_a_timedate1_that_does_not_answer_is_given_up(tmp_path: Path) -> None:
    assert look(mark=tmp_path / "synchronized", question=("sleep", "60"), patience=0.05) == "unknown"


def test_on_this_machine_there_is_an_answer() -> None:
    assert look() in LOOK_AGAIN


def test_an_unsynchronised_clock_is_looked_at_most_often() -> None:
    assert LOOK_AGAIN["unsynced"] < LOOK_AGAIN["synced"]
    assert LOOK_AGAIN["unsynced"] < LOOK_AGAIN["unknown"]


def test_soon_after_the_start_what_nobody_knows_is_looked_at_as_often() -> None:
    assert look_again("unknown", 0.0) == look_again("unknown", SOON_AFTER_START - 1) == LOOK_AGAIN["unsynced"]
    assert look_again("unknown", SOON_AFTER_START) == LOOK_AGAIN["unknown"]
    assert look_again("synced", 0.0) == LOOK_AGAIN["synced"]


def test_both_clocks_are_read_again_where_another_program_ran_between(monkeypatch: pytest.MonkeyPatch) -> None:
    monos = iter([10.0, 10.004, 10.010, 10.0101])
    walls = iter([1010.003, 1010.010])
    monkeypatch.setattr("lfs10d.system.clock.time.monotonic", lambda: next(monos))
    monkeypatch.setattr("lfs10d.system.clock.time.time", lambda: next(walls))
    assert _together() == (10.010, 1010.010)
