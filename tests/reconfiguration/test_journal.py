"""The journal: an intent is on the disk when `intend` returns, whatever fails; a damaged file is put aside."""

from __future__ import annotations

import errno
import json
from pathlib import Path

import pytest

from lfs10d.errors import StateError
from lfs10d.reconfiguration.journal import (
    ASIDE,
    REMEMBERED,
    REMEMBERED_FOR_MS,
    AdoptFacts,
    BaudrateFacts,
    CommandRecord,
    Endpoint,
    Journal,
    Move,
    OpenAdopt,
    OpenBaudrate,
    OpenReaddress,
    ResultRecord,
)
from lfs10d.system.disk import Disk
from tests.support.volatile_disk import ForgetfulFiles, PowerCutError

STATE = Path("/state")
FILE = STATE / "journal.json"


def move(device: str = "mast-top", old: int = 3, new: int = 9) -> Move:
    return Move(device=device, old=Endpoint(slave=old, baudrate=9600), new=Endpoint(slave=new, baudrate=9600))


RATES = BaudrateFacts(old=9600, to=19200)


def readdress(moved: Move, asked: CommandRecord | None = None) -> OpenReaddress:
    return OpenReaddress(moves=(moved,), begun=5, asked=asked)


def told(key: str | None, at: int = 0) -> ResultRecord:
    return ResultRecord(asked=CommandRecord(name="device/readdress", id=key), status="ok", at=at)


def read(files: ForgetfulFiles) -> Journal:
    journal = Journal(STATE, Disk(files))
    assert journal.take() is None
    return journal


def test_an_intent_outlives_a_power_cut_once_it_is_told() -> None:
    files = ForgetfulFiles()
    change = read(files).intend(readdress(move()))
    files.power_cut()
    journal = read(files)
    assert journal.open == (change,)
    assert change.slaves == {3, 9}
    assert change.devices == {"mast-top"}


@pytest.mark.parametrize("steps", range(8))
def test_a_cut_at_any_step_leaves_what_was_or_what_is_to_be(steps: int) -> None:
    files = ForgetfulFiles()
    journal = read(files)
    first = journal.intend(readdress(move(), CommandRecord(name="r", id=1)))
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
    assert journal.intend(readdress(move())).number == 1


def test_a_full_disk_refuses_and_leaves_what_was() -> None:
    files = ForgetfulFiles()
    journal = read(files)
    first = journal.intend(readdress(move()))
    files.full = 10
    with pytest.raises(StateError, match=r"journal\.json cannot be written: No space left"):
        journal.intend(readdress(move("other", 4, 5)))
    assert journal.open == (first,)
    assert read(files).open == (first,)


def test_a_change_that_is_kept_is_answered_and_one_that_is_amended_has_other_sensors() -> None:
    files = ForgetfulFiles()
    journal = read(files)
    first = journal.intend(OpenBaudrate(moves=(move(), move("b", 4, 4)), begun=5, facts=RATES))
    other = journal.intend(readdress(move("c", 5, 6)))
    journal.keep(first.number, told("k"))
    journal.amend(first.number, (move(),))
    journal.set_pending(first.number, ("b",))
    (kept, untouched) = read(files).open
    assert (kept.answered, kept.moves, kept.facts) == (
        True,
        (move(),),
        RATES.model_copy(update={"pending": ("b",)}),
    )
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


def test_changes_that_end_together_are_closed_with_all_their_answers_in_one_step() -> None:
    files = ForgetfulFiles()
    journal = read(files)
    numbers = [journal.intend(readdress(move())).number for _ in range(2)]
    journal.close(frozenset(numbers), told("first"), None, told("second"))
    assert not read(files).open
    assert [each.asked.key for each in read(files).answers] == ["first", "second"]


def test_a_file_that_cannot_be_read_is_told_and_nothing_is_written_over_it(tmp_path: Path) -> None:
    (tmp_path / "journal.json").mkdir()
    journal = Journal(tmp_path, Disk())
    trouble = journal.take()
    assert trouble is not None
    assert trouble.endswith("cannot be read: Is a directory; it is not known whether a sensor was being changed")
    with pytest.raises(StateError, match=r"cannot be read: Is a directory$"):
        journal.intend(readdress(move()))
    assert journal.open == ()


class Stuck(ForgetfulFiles):
    """A disk on which no file can be renamed while it is `stuck`, nor a folder synced while it is `unsynced`."""

    stuck = unsynced = False

    def rename(self, source: Path, target: Path) -> None:
        if self.stuck:
            raise OSError(errno.EROFS, "Read-only file system")
        super().rename(source, target)

    def sync_folder(self, folder: Path) -> None:
        if self.unsynced:
            self.unsynced = False
            raise OSError(errno.EIO, "Input/output error")
        super().sync_folder(folder)


def test_a_damaged_file_that_cannot_be_put_aside_is_not_written_over() -> None:
    files = Stuck()
    Disk(files).replace(FILE, b"{")
    files.stuck = True
    journal = Journal(STATE, Disk(files))
    assert journal.take() == f"{FILE} is damaged, or a newer lfs10d wrote it"
    files.stuck = False
    with pytest.raises(StateError, match="is damaged"):
        journal.intend(readdress(move()))
    assert files.read(FILE) == b"{"


def test_an_intent_that_was_written_but_not_synced_is_taken_back_with_its_refusal() -> None:
    files = Stuck()
    journal = read(files)
    first = journal.intend(readdress(move()))
    files.unsynced = True
    with pytest.raises(StateError, match=r"journal\.json cannot be written: Input/output error"):
        journal.intend(readdress(move("other", 4, 5)))
    assert journal.open == (first,)
    assert read(files).open == (first,)


@pytest.mark.parametrize(("id_", "transaction", "key"), [("a", 7, "a"), (None, 7, 7), (None, None, None)])
def test_a_request_is_told_from_its_repeat_by_its_id_or_else_its_transaction(
    id_: str | None, transaction: int | None, key: str | int | None
) -> None:
    assert CommandRecord(name="r", id=id_, transaction=transaction).key == key


ASKED = CommandRecord(name="device/readdress", id="a", topic="response/mine", correlation="00" * 1024)


def test_an_answer_that_was_given_keeps_neither_topic_nor_correlation_a_repeat_brings_its_own() -> None:
    files = ForgetfulFiles()
    journal = read(files)
    kept = journal.intend(readdress(move(), ASKED))
    journal.keep(kept.number, ResultRecord(asked=ASKED, status="failed", at=1))
    closed = journal.intend(readdress(move("b"), ASKED))
    assert read(files).open[1].asked == ASKED, "an answer that is still owed goes where it was asked for"
    journal.close(frozenset({closed.number}), ResultRecord(asked=ASKED, status="ok", at=2))
    for each in (journal, read(files)):
        assert {(one.asked.topic, one.asked.correlation) for one in each.answers} == {(None, None)}
        assert [one.asked.key for one in each.answers] == ["a", "a"]
        assert each.open[0].asked == ASKED.finished
    assert len(files.read(FILE)) < 2000


def test_a_journal_of_before_that_kept_them_is_read_without_them() -> None:
    files = ForgetfulFiles()
    entry = {"asked": ASKED.model_dump(), "status": "rejected", "data": None, "error": None, "at": 5, "took_ms": 0.0}
    Disk(files).replace(FILE, json.dumps({"version": 1, "last_number": 3, "changes": [], "answers": [entry]}).encode())
    (answer,) = read(files).answers
    assert answer.asked == ASKED.finished


def test_what_is_noted_is_remembered_at_once_and_on_the_disk_with_the_next_step_or_save() -> None:
    files = ForgetfulFiles()
    journal = read(files)
    before = files.steps
    for number in range(300):
        journal.note(told(f"id-{number}", at=number))
    journal.note(None)
    journal.note(told(None))
    assert files.steps == before
    assert len(journal.answers) == REMEMBERED
    assert read(files).answers == ()
    journal.save()
    steps = files.steps
    files.power_cut()
    assert read(files).answers == journal.answers
    journal.save()
    assert files.steps == steps, "there is nothing new"
    journal.note(told("late", at=400))
    journal.intend(readdress(move()))
    assert read(files).answers[-1].asked.key == "late"


def test_what_is_noted_stays_noted_where_the_disk_refuses_it() -> None:
    files = ForgetfulFiles()
    journal = read(files)
    journal.note(told("a"))
    files.full = 10
    with pytest.raises(StateError):
        journal.save()
    assert [each.asked.key for each in journal.answers] == ["a"]
    files.full = None
    journal.save()
    assert [each.asked.key for each in read(files).answers] == ["a"]


MOVES = [
    {
        "device": "mast-top",
        "old": {"slave": 3, "baudrate": 9600},
        "new": {"slave": 9, "baudrate": 9600},
        "register_before": None,
    }
]
FORMS: list[tuple[dict[str, object], OpenReaddress | OpenBaudrate | OpenAdopt]] = [
    ({"kind": "readdress", "facts": {}}, readdress(move())),
    (
        {"kind": "baudrate", "facts": {"from": 9600, "to": 19200, "power_cycle": False}},
        OpenBaudrate(moves=(move(),), begun=5, facts=RATES),
    ),
    (
        {"kind": "baudrate", "facts": {"from": 9600, "to": 19200, "power_cycle": True, "pending": ["b"]}},
        OpenBaudrate(
            moves=(move(),), begun=5, facts=BaudrateFacts(old=9600, to=19200, power_cycle=True, pending=("b",))
        ),
    ),
    (
        {"kind": "adopt", "facts": {"label": "Mast", "profile": "eh600"}},
        OpenAdopt(moves=(move(),), begun=5, facts=AdoptFacts(label="Mast", profile="eh600")),
    ),
]


def content(form: dict[str, object]) -> dict[str, object]:
    facts = {"moves": MOVES, "begun": 5, "asked": None, "answered": False}
    change = {"number": 1, "kind": form["kind"], **facts, "facts": form["facts"]}
    return {"version": 1, "last_number": 1, "changes": [change], "answers": []}


@pytest.mark.parametrize(("form", "change"), FORMS)
def test_the_form_of_a_change_in_the_file_is_that_of_lfs10d_1(
    form: dict[str, object], change: OpenReaddress | OpenBaudrate | OpenAdopt
) -> None:
    files = ForgetfulFiles()
    numbered = read(files).intend(change)
    assert json.dumps(json.loads(files.read(FILE))) == json.dumps(content(form)), "keys in this order, too"
    assert read(files).open == (numbered,)


@pytest.mark.parametrize(
    ("form", "facts"),
    [
        ({"kind": "adopt", "facts": {"label": None}}, AdoptFacts()),
        ({"kind": "adopt", "facts": {"label": None, "colour": "red"}}, AdoptFacts()),
        ({"kind": "baudrate", "facts": {"from": 9600, "to": 19200}}, RATES),
    ],
)
def test_facts_of_another_version_are_read(form: dict[str, object], facts: object) -> None:
    files = ForgetfulFiles()
    Disk(files).replace(FILE, json.dumps(content(form)).encode())
    (change,) = read(files).open
    assert change.facts == facts
