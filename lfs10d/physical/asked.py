"""Requests for physical changes as the journal keeps them, and their answers: there and back. Pure."""

from __future__ import annotations

from lfs10d.commands import Answer, Call
from lfs10d.journal import Asked, Told


def asked_by(name: str, call: Call) -> Asked:
    """Return a request as the journal keeps it."""
    return Asked(
        name=name,
        id=call.id,
        transaction=call.transaction,
        fingerprint=call.fingerprint,
        topic=call.topic,
        correlation=None if call.correlation is None else call.correlation.hex(),
    )


def call_of(asked: Asked) -> Call:
    """Return a request as the service knows it."""
    correlation = None if asked.correlation is None else bytes.fromhex(asked.correlation)
    return Call(asked.id, asked.transaction, fingerprint=asked.fingerprint, topic=asked.topic, correlation=correlation)


def told(asked: Asked | None, answer: Answer, ts: int) -> Told | None:
    """Return an answer given at `ts` (epoch ms) as the journal keeps it; None if nobody asked."""
    if asked is None:
        return None
    return Told(asked=asked, status=answer.status, data=answer.data, error=answer.error(), at=ts)


def answer_of(told: Told) -> Answer:
    """Return an answer as the service gives it."""
    error = dict(told.error or {})
    code, message = error.pop("code", None), error.pop("message", "")
    return Answer(told.status, told.data, code, message, error)
