"""The journal of physical changes: what is about to be written to a sensor is on the disk before its first byte is.

One small file, replaced as a whole at each step. A change stays in it until every sensor it touched was found again
and the configuration says where. With it lie the answers to physical changes, so that a request which is repeated
after a restart is answered and not carried out once more.

A file that cannot be understood (damaged, of a newer lfs10d) is put aside and reported.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from pathlib import Path
from typing import Any, Literal, TypeAlias

from pydantic import BaseModel, ConfigDict, ValidationError

from lfs10d.command import Command, Result
from lfs10d.errors import StateError
from lfs10d.system.disk import Disk

FILE_NAME = "journal.json"
ASIDE = "journal.json.unreadable"
"""Where a file that cannot be understood is put; the last one is kept."""
VERSION: Literal[1] = 1
REMEMBERED = 256
"""Answers that are kept, the newest."""
REMEMBERED_FOR_MS = 24 * 3600 * 1000
"""How long an answer is kept."""

Kind: TypeAlias = Literal["readdress", "baudrate", "adopt"]


class _Record(BaseModel):
    model_config = ConfigDict(strict=True, extra="forbid", frozen=True)


class Endpoint(_Record):
    """Where a sensor answers: by this slave id, at this rate in baud."""

    slave: int
    baudrate: int


class Move(_Record):
    """One sensor that is to answer elsewhere; `register` is what its id register said before (None: not asked)."""

    device: str
    old: Endpoint
    new: Endpoint
    register_before: int | None = None


class CommandRecord(_Record):
    """The request a change was asked by: its name, id and content, and where its answer goes (correlation in hex)."""

    name: str
    id: str | int | None = None
    transaction: str | int | None = None
    fingerprint: str = ""
    topic: str | None = None
    correlation: str | None = None

    @property
    def key(self) -> str | int | None:
        """What tells a repeat."""
        return self.transaction if self.id is None else self.id

    @property
    def finished(self) -> CommandRecord:
        """The same once it has its answer: a repeat says itself where the answer goes."""
        return self.model_copy(update={"topic": None, "correlation": None})


class OpenChange(_Record):
    """A change that may have been written. `begun` is in epoch milliseconds.

    `answered`: its request has its answer, and the sensors are followed until they are found. `facts` is what the
    kind of change needs besides to be finished.
    """

    number: int
    kind: Kind
    moves: tuple[Move, ...]
    begun: int
    asked: CommandRecord | None = None
    answered: bool = False
    facts: dict[str, Any] = {}

    @property
    def slaves(self) -> frozenset[int]:
        """Every slave id that one of its sensors may have."""
        return frozenset(spot.slave for move in self.moves for spot in (move.old, move.new))

    @property
    def devices(self) -> frozenset[str]:
        """The names of its sensors."""
        return frozenset(move.device for move in self.moves)


class ResultRecord(_Record):
    """An answer that was given: `status`, `data` and `error` as in the response, at `at` in epoch milliseconds."""

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
    """The journal in one state directory. Used by one caller at a time; every step is on the disk when it returns.

    Only `note` is not. A step that cannot be put on the disk raises StateError, and nothing has happened then.
    """

    def __init__(self, directory: Path, disk: Disk) -> None:
        self.path = directory / FILE_NAME
        self._disk = disk
        self._content = _JournalContent()
        self._unsaved = False
        self._unread: str | None = None

    def take(self) -> str | None:
        """Read it, once, at the start; return what is wrong with it, in words. Never fails."""
        try:
            content = self._disk.read(self.path)
        except FileNotFoundError:
            return None
        except OSError as error:
            self._unread = f"{self.path} cannot be read: {error.strerror}"
            return f"{self._unread}; whether a sensor was being moved is not known"
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
        """The changes that are neither finished nor undone, the oldest first."""
        return self._content.changes

    @property
    def answers(self) -> tuple[ResultRecord, ...]:
        """The answers that were given, the oldest first."""
        return self._content.answers

    def reserved(self) -> frozenset[int]:
        """Return every slave id at which a sensor of an open change may appear."""
        return frozenset().union(*(change.slaves for change in self.open))

    def intend(
        self, kind: Kind, moves: tuple[Move, ...], begun: int, asked: CommandRecord | None, **facts: object
    ) -> OpenChange:
        """Note that these sensors are about to be moved; when this returns the first byte may be sent."""
        number = self._content.last_number + 1
        change = OpenChange(number=number, kind=kind, moves=moves, begun=begun, asked=asked, facts=facts)
        self._save(last_number=number, changes=(*self.open, change))
        return change

    def amend(self, number: int, moves: tuple[Move, ...], **facts: object) -> None:
        """Note which sensors of a change are still to be found, and what else there is to know."""

        def amended(change: OpenChange) -> OpenChange:
            return change.model_copy(update={"moves": moves, "facts": {**change.facts, **facts}})

        self._save(changes=self._with(number, amended))

    def keep(self, number: int, told: ResultRecord | None) -> None:
        """Note that a change stays open, and the answer its request was given."""

        def answered(change: OpenChange) -> OpenChange:
            asked = None if change.asked is None else change.asked.finished
            return change.model_copy(update={"answered": True, "asked": asked})

        self._save(changes=self._with(number, answered), answers=self._answers(told))

    def close(self, numbers: frozenset[int], *told: ResultRecord | None) -> None:
        """Note that these changes are finished or undone, and the answers that are given with that."""
        changes = tuple(change for change in self.open if change.number not in numbers)
        answers = self._answers(*told)
        if (changes, answers) != (self.open, self.answers):
            self._save(changes=changes, answers=answers)

    def note(self, told: ResultRecord | None) -> None:
        """Remember an answer to a request of which nothing was written; it comes on the disk with the next `save`.

        Lost before that, a repeat of the request is judged anew.
        """
        answers = self._answers(told)
        if answers != self.answers:
            self._content = self._content.model_copy(update={"answers": answers})
            self._unsaved = True

    def save(self) -> None:
        """Put on the disk what was noted since the last step."""
        if self._unsaved:
            self._save()

    def _with(self, number: int, amended: Callable[[OpenChange], OpenChange]) -> tuple[OpenChange, ...]:
        return tuple(amended(change) if change.number == number else change for change in self.open)

    def _answers(self, *told: ResultRecord | None) -> tuple[ResultRecord, ...]:
        answers = self.answers
        for each in told:
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
        """Take back what was written but, for all we know, not synced: an intent must not outlive its refusal."""
        with contextlib.suppress(OSError):
            if self._disk.read(self.path) == refused.model_dump_json(indent=1).encode():
                self._disk.replace(self.path, self._content.model_dump_json(indent=1).encode())


def asked_by(name: str, call: Command) -> CommandRecord:
    """Return a request as the journal keeps it."""
    return CommandRecord(
        name=name,
        id=call.id,
        transaction=call.transaction,
        fingerprint=call.fingerprint,
        topic=call.topic,
        correlation=None if call.correlation is None else call.correlation.hex(),
    )


def call_of(asked: CommandRecord) -> Command:
    """Return a request as the service knows it."""
    correlation = None if asked.correlation is None else bytes.fromhex(asked.correlation)
    return Command(
        asked.id, asked.transaction, fingerprint=asked.fingerprint, topic=asked.topic, correlation=correlation
    )


def told(asked: CommandRecord | None, answer: Result, ts: int) -> ResultRecord | None:
    """Return an answer given at `ts` (epoch ms) as the journal keeps it; None if nobody asked."""
    if asked is None:
        return None
    return ResultRecord(asked=asked, status=answer.status, data=answer.data, error=answer.error(), at=ts)


def answer_of(told: ResultRecord) -> Result:
    """Return an answer as the service gives it."""
    error = dict(told.error or {})
    code, message = error.pop("code", None), error.pop("message", "")
    return Result(told.status, told.data, code, message, error)
