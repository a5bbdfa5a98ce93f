"""Items of the outbox, made short."""

from __future__ import annotations

from lfs10d.outbox.history import QueuedSample
from lfs10d.outbox.items import HistoryBatch, LiveSample, Message, Retained
from lfs10d.telemetry import publication
from lfs10d.telemetry.publication import Publication, PublicationKind, Sample


def queued(device: str, seq: int, *, since: float = 0.0, row: int | None = None) -> QueuedSample:
    """Return a sample that waits."""
    sample = Sample(device, "k", seq, 1000 * seq, "synced", None, {}, (), "bad", "timeout", None)
    return QueuedSample(sample, since, row=row)


def live(device: str, seq: int, *, since: float = 0.0) -> LiveSample:
    """Return a live sample."""
    sample = queued(device, seq, since=since)
    topic = publication.device_topic(device, publication.TELEMETRY)
    return LiveSample(Publication(topic, {}, PublicationKind.SAMPLE, retain=False, qos=1, sample=sample.sample), sample)


def batch(device: str, *seqs: int, first_row: int | None = None) -> HistoryBatch:
    """Return a history batch; with rows in the store from `first_row` on."""
    rows = (None if first_row is None else first_row + number for number in range(len(seqs)))
    return HistoryBatch(tuple(queued(device, seq, row=row) for seq, row in zip(seqs, rows, strict=True)))


def retained(topic: str, payload: object = "x") -> Retained:
    """Return a version of a retained topic."""
    return Retained(publication.retained(topic, None if payload is None else {"is": str(payload)}))


def event(name: str) -> Message:
    """Return an event."""
    return Message(publication.event(name, 0))


def trace() -> Message:
    """Return a trace."""
    return Message(Publication("line/trace", {}, PublicationKind.TRACE, retain=False, qos=0))
