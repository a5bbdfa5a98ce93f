"""Converts commands and results to records of the journal and back. Pure."""

from __future__ import annotations

from lfs10d.command import Command, Result
from lfs10d.reconfiguration.journal import CommandRecord, ResultRecord


def command_record(name: str, command: Command) -> CommandRecord:
    """Return a command as a record of the journal."""
    return CommandRecord(
        name=name,
        id=command.id,
        transaction=command.transaction,
        fingerprint=command.fingerprint,
        topic=command.topic,
        correlation=None if command.correlation is None else command.correlation.hex(),
    )


def command_of(record: CommandRecord) -> Command:
    """Return a command from its record."""
    correlation = None if record.correlation is None else bytes.fromhex(record.correlation)
    return Command(
        record.id, record.transaction, fingerprint=record.fingerprint, topic=record.topic, correlation=correlation
    )


def result_record(command: CommandRecord | None, result: Result, ts: int) -> ResultRecord | None:
    """Return a result given at `ts` (epoch ms) as a record; None if there is no command to answer."""
    if command is None:
        return None
    return ResultRecord(asked=command, status=result.status, data=result.data, error=result.error(), at=ts)


def result_of(record: ResultRecord) -> Result:
    """Return a result from its record."""
    error = dict(record.error or {})
    code, message = error.pop("code", None), error.pop("message", "")
    return Result(record.status, record.data, code, message, error)
