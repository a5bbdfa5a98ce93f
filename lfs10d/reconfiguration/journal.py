"""The journal of changes of sensors: each write is recorded on the disk before its first byte is sent.

One small file, replaced as a whole at each step. A change stays in it until every sensor it touched was found again
and the configuration says where. The results of such changes are kept there too, so that a command that is repeated
after a restart is answered and not carried out once more.

A file that cannot be read (damaged, or of a newer lfs10d) is put aside and reported.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any, Literal, TypeAlias, TypeVar

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_serializer

from lfs10d.errors import StateError
from lfs10d.system.disk import Disk

FILE_NAME = "journal.json"
ASIDE = "journal.json.unreadable"
"""New name of a file that cannot be read; only the last one is kept."""
VERSION: Literal[1] = 1
REMEMBERED = 256
"""Number of results that are kept."""
REMEMBERED_FOR_MS = 24 * 3600 * 1000
"""Milliseconds for which a result is kept."""


class _Record(BaseModel):
    model_config = ConfigDict(strict=True, extra="forbid", frozen=True)


class Endpoint(_Record):
    """Where a sensor answers: its slave id, and its rate in baud."""

    slave: int
    baudrate: int


class Move(_Record):
    """One sensor that is to have another place; `register_before` is the content of its id register (None: unread)."""

    device: str
    old: Endpoint
    new: Endpoint
    register_before: int | None = None


class CommandRecord(_Record):
    """The command of a change: its name, id, content, and the address of its result (correlation in hex)."""

    name: str
    id: str | int | None = None
    transaction: str | int | None = None
    fingerprint: str = ""
    topic: str | None = None
    correlation: str | None = None

    @property
    def key(self) -> str | int | None:
        """What identifies a repeat."""
        return self.transaction if self.id is None else self.id

    @property
    def finished(self) -> CommandRecord:
        """Return it without the address of its result, as kept after the response: a repeat has its own."""
        return self.model_copy(update={"topic": None, "correlation": None})


class _Facts(_Record):
    """Further facts of a kind of change; keys of other versions are ignored."""

    model_config = ConfigDict(extra="ignore", populate_by_name=True)


class ReaddressFacts(_Facts):
    """Further facts of a re-address: none."""


class BaudrateFacts(_Facts):
    """The rates, in baud. `pending` are the sensors that have stored the new one and wait for their power cycle."""

    old: int = Field(alias="from")
    to: int
    power_cycle: bool = False
    pending: tuple[str, ...] | None = None

    @model_serializer
    def _form(self) -> dict[str, object]:
        form: dict[str, object] = {"from": self.old, "to": self.to, "power_cycle": self.power_cycle}
        return form if self.pending is None else {**form, "pending": self.pending}


class AdoptFacts(_Facts):
    """The label of the new sensor, and its profile's name or path (None: an older lfs10d wrote no such key)."""

    label: str | None = None
    profile: str | None = None


class _OpenChange(_Record):
    """A change that may have been written. `begun` is in epoch milliseconds; the journal assigns the number.

    `answered`: its command has its result, and the sensors are followed until they are found.
    """

    number: int = 0
    kind: Literal["readdress", "baudrate", "adopt"]
    moves: tuple[Move, ...]
    begun: int
    asked: CommandRecord | None = None
    answered: bool = False

    @property
    def slaves(self) -> frozenset[int]:
        """Every slave id that one of its sensors may have."""
        return frozenset(endpoint.slave for move in self.moves for endpoint in (move.old, move.new))

    @property
    def devices(self) -> frozenset[str]:
        """The names of its sensors."""
        return frozenset(move.device for move in self.moves)


class OpenReaddress(_OpenChange):
    """A configured sensor gets another slave id."""

    kind: Literal["readdress"] = "readdress"
    facts: ReaddressFacts = ReaddressFacts()


class OpenBaudrate(_OpenChange):
    """Every sensor and the line get another rate."""

    kind: Literal["baudrate"] = "baudrate"
    facts: BaudrateFacts


class OpenAdopt(_OpenChange):
    """A new sensor gets an id and the line's rate."""

    kind: Literal["adopt"] = "adopt"
    facts: AdoptFacts = AdoptFacts()


OpenChange: TypeAlias = Annotated[OpenReaddress | OpenBaudrate | OpenAdopt, Field(discriminator="kind")]
C = TypeVar("C", bound=_OpenChange)


class ResultRecord(_Record):
    """A result that was given: `status`, `data` and `error` as in the response, at `at` in epoch milliseconds."""

    asked: CommandRecord
    status: Literal["ok", "rejected", "failed"]
    data: Any = None
    error: dict[str, Any] | None = None
    at: int
    took_ms: float = 0.0


class _JournalContent(_Record):
    version: Literal[1] = VERSION
    last_number: int = 0
    changes: tuple[OpenChange, ...] = ()
    answers: tuple[ResultRecord, ...] = ()


class Journal:
    """The journal in one state directory. Used by one caller at a time; every step but `note` is on the disk at return.

    A step that cannot be put on the disk raises StateError, and nothing has happened then.
    """

    def __init__(self, directory: Path, disk: Disk) -> None:
        self.path = directory / FILE_NAME
        self._disk = disk
        self._content = _JournalContent()
        self._unsaved = False
        self._unread: str | None = None

    def take(self) -> str | None:
        """Read the file once, at the start; return its problem as a message to a person. Never fails."""
        try:
            content = self._disk.read(self.path)
        except FileNotFoundError:
            return None
        except OSError as error:
            self._unread = f"{self.path} cannot be read: {error.strerror}"
            return f"{self._unread}; it is not known whether a sensor was being changed"
        try:
            kept = _JournalContent.model_validate_json(content)
        except ValidationError:
            aside = self.path.with_name(ASIDE)
            trouble = f"{self.path} is damaged, or a newer lfs10d wrote it"
            with contextlib.suppress(OSError):
                self._disk.put_aside(self.path, aside)
                return f"{trouble}; it is now {aside}. If a sensor is missing, look for it: lfs10d scan PORT"
            self._unread = trouble
            return trouble
        answers = tuple(each.model_copy(update={"asked": each.asked.finished}) for each in kept.answers)
        self._content = kept.model_copy(update={"answers": answers})
        return None

    @property
    def open(self) -> tuple[OpenChange, ...]:
        """The open changes, the oldest first."""
        return self._content.changes

    @property
    def answers(self) -> tuple[ResultRecord, ...]:
        """The kept results, the oldest first."""
        return self._content.answers

    def intend(self, change: C) -> C:
        """Record that sensors are about to be changed; return the change with its number.

        When this returns the first byte may be sent.
        """
        numbered = change.model_copy(update={"number": self._content.last_number + 1})
        self._save(last_number=numbered.number, changes=(*self.open, numbered))
        return numbered

    def amend(self, number: int, moves: tuple[Move, ...]) -> None:
        """Record the places at which the sensors of a change are searched for from now on."""
        self._save(changes=self._with(number, lambda _: {"moves": moves}))

    def set_pending(self, number: int, pending: tuple[str, ...]) -> None:
        """Record which sensors of a change of the rate need a power cycle."""
        self._save(
            changes=self._with(number, lambda change: {"facts": change.facts.model_copy(update={"pending": pending})})
        )

    def keep(self, number: int, record: ResultRecord | None) -> None:
        """Record that a change stays open, and the result its command was given."""
        changes = self._with(number, lambda change: {"answered": True, "asked": change.asked and change.asked.finished})
        self._save(changes=changes, answers=self._answers(record))

    def close(self, numbers: frozenset[int], *records: ResultRecord | None) -> None:
        """Record that these changes are finished or undone, and the results that are given with that."""
        changes = tuple(change for change in self.open if change.number not in numbers)
        answers = self._answers(*records)
        if (changes, answers) != (self.open, self.answers):
            self._save(changes=changes, answers=answers)

    def note(self, record: ResultRecord | None) -> None:
        """Remember the result of a command that wrote nothing; the next `save` puts it on the disk.

        Lost before that, a repeat of the command is judged anew.
        """
        answers = self._answers(record)
        if answers != self.answers:
            self._content = self._content.model_copy(update={"answers": answers})
            self._unsaved = True

    def save(self) -> None:
        """Put on the disk what was noted since the last step."""
        if self._unsaved:
            self._save()

    def _with(self, number: int, update: Callable[[OpenChange], dict[str, object]]) -> tuple[OpenChange, ...]:
        """Return the open changes, one of them with what `update` returns for it."""
        return tuple(
            change.model_copy(update=update(change)) if change.number == number else change for change in self.open
        )

    def _answers(self, *records: ResultRecord | None) -> tuple[ResultRecord, ...]:
        answers = self.answers
        for each in records:
            if each is not None and each.asked.key is not None:
                kept = [older for older in answers if older.at > each.at - REMEMBERED_FOR_MS]
                answers = (*kept[-REMEMBERED + 1 :], each.model_copy(update={"asked": each.asked.finished}))
        return answers

    def _save(self, **changed: object) -> None:
        if self._unread is not None:
            raise StateError(self._unread)
        content = self._content.model_copy(update=changed)
        try:
            self._disk.replace(self.path, content.model_dump_json(indent=1).encode())
        except OSError as error:
            self._restore(content)
            raise StateError(f"{self.path} cannot be written: {error.strerror}") from None
        self._content, self._unsaved = content, False

    def _restore(self, refused: _JournalContent) -> None:
        """Take back a write that may not have been synced: an intent must not outlive its refusal."""
        with contextlib.suppress(OSError):
            if self._disk.read(self.path) == refused.model_dump_json(indent=1).encode():
                self._disk.replace(self.path, self._content.model_dump_json(indent=1).encode())
