"""The journal: an intent is on the disk when `intend` returns, whatever fails; a damaged file is put aside."""

from __future__ import annotations

from pathlib import Path

import pytest

from lfs10d.disk import Disk
from lfs10d.errors import StateError
from lfs10d.forgetful import ForgetfulFiles, PowerCutError
from lfs10d.journal import ASIDE, REMEMBERED, REMEMBERED_FOR_MS, Asked, Journal, Move, Spot, Told

STATE = Path("/state")
FILE = STATE / "journal.json"


def move(device: str = "mast-top", old: int = 3, new: int = 9) -> Move:
    return Move(device=device, old=Spot(slave=old, baudrate=9600), new=Spot(slave=new, baudrate=9600))


def told(key: str | None, at: int = 0) -> Told:
    return Told(asked=Asked(name="device/readdress", id=key), status="ok", at=at)


def read(files: ForgetfulFiles) -> Journal:
    journal = Journal(STATE, Disk(files))
    assert journal.take() is None
    return journal


def test_an_intent_outlives_a_power_cut_once_it_is_told() -> None:
    files = ForgetfulFiles()
    change = read(files).intend("readdress", (move(),), 5, None, label="x")
    files.power_cut()
    journal = read(files)
    assert journal.open == (change,)
    assert journal.reserved() == {3, 9}
    assert change.devices == {"mast-top"}


@pytest.mark.parametrize("steps", range(8))
def test_a_cut_at_any_step_leaves_what_was_or_what_is_to_be(steps: int) -> None:
    files = ForgetfulFiles()
    journal = read(files)
    first = journal.intend("readdress", (move(),), 5, Asked(name="r", id=1))
    files.steps_left = files.steps + steps
    try:
        journal.close(frozenset({first.number}), told("a"))
    except PowerCutError:
        pass
    else:
        assert steps >= 4
    files.power_cut()
    after = read(files)
    assert (after.open, after.answers) in [((first,), ()), ((), (told("a"),))]


@pytest.mark.parametrize("content", [b"", b"{", b"[]", b'{"version": 2}', b'{"version": 1, "more": 1}', b"\xff"])
def test_what_cannot_be_understood_is_put_aside_and_told(content: bytes) -> None:
    files = ForgetfulFiles()
    Disk(files).replace(FILE, content)
    journal = Journal(STATE, Disk(files))
    trouble = journal.take()
    assert trouble is not None
    assert ASIDE in trouble
    assert files.read(STATE / ASIDE) == content
    assert journal.intend("readdress", (move(),), 5, None).number == 1


def test_a_full_disk_refuses_and_leaves_what_was() -> None:
    files = ForgetfulFiles()
    journal = read(files)
    first = journal.intend("readdress", (move(),), 5, None)
    files.full = 10
    with pytest.raises(StateError, match=r"journal\.json cannot be written: No space left"):
        journal.intend("readdress", (move("other", 4, 5),), 6, None)
    assert journal.open == (first,)
    assert read(files).open == (first,)


def test_a_change_that_is_kept_is_answered_and_one_that_is_amended_has_other_sensors() -> None:
    files = ForgetfulFiles()
    journal = read(files)
    first = journal.intend("baudrate", (move(), move("b", 4, 4)), 5, None)
    other = journal.intend("readdress", (move("c", 5, 6),), 5, None)
    journal.keep(first.number, told("k"))
    journal.amend(first.number, (move(),), pending=["b"])
    (kept, untouched) = read(files).open
    assert (kept.answered, kept.moves, kept.facts) == (True, (move(),), {"pending": ["b"]})
    assert untouched == other


def test_answers_are_kept_for_a_day_and_only_the_newest() -> None:
    journal = read(ForgetfulFiles())
    journal.close(frozenset(), told(None))
    assert not len(journal.answers)
    for number in range(REMEMBERED + 5):
        journal.close(frozenset(), told(f"id-{number}", at=number))
    assert [each.asked.key for each in journal.answers] == [f"id-{number}" for number in range(5, REMEMBERED + 5)]
    journal.close(frozenset(), told("late", at=REMEMBERED_FOR_MS + 1000))
    assert [each.asked.key for each in journal.answers] == ["late"]
