"""Commands and results as the journal keeps them, and back. Pure."""

from __future__ import annotations

from lfs10d.command import Command, Result
from lfs10d.reconfiguration.journal import CommandRecord, ResultRecord


def command_record(name: str, command: Command) -> CommandRecord:
    """Return a command as the journal keeps it."""
    return CommandRecord(
        name=name,
        id=command.id,
        transaction=command.transaction,
        fingerprint=command.fingerprint,
        topic=command.topic,
        correlation=None if command.correlation is None else command.correlation.hex(),
    )


def command_of(record: CommandRecord) -> Command:
    """Return a command as the dispatcher knows it."""
    correlation = None if record.correlation is None else bytes.fromhex(record.correlation)
    return Command(
        record.id, record.transaction, fingerprint=record.fingerprint, topic=record.topic, correlation=correlation
    )


def result_record(command: CommandRecord | None, result: Result, ts: int) -> ResultRecord | None:
    """Return a result given at `ts` (epoch ms) as the journal keeps it; None where no command is to be answered."""
    if command is None:
        return None
    return ResultRecord(asked=command, status=result.status, data=result.data, error=result.error(), at=ts)


def result_of(record: ResultRecord) -> Result:
    """Return a result as the dispatcher gives it."""
    error = dict(record.error or {})
    code, message = error.pop("code", None), error.pop("message", "")
    return Result(record.status, record.data, code, message, error)
