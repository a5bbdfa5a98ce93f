"""Items of the outbox, made short."""

from __future__ import annotations

from lfs10d.outbox.history import QueuedSample
from lfs10d.outbox.items import HistoryBatch, LiveSample, Message, Retained
from lfs10d.system.clock_step import ClockState
from lfs10d.telemetry import publication
from lfs10d.telemetry.publication import Publication, PublicationKind, Sample
from lfs10d.telemetry.wind.record import RECORD_NAMES, WindRecord


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


def named_event(name: str, **facts: object) -> Publication:
    """Return an event of a type that only a test knows, so that it can be told from others."""
    payload = {"v": publication.VERSION, "type": name, "ts": 0, **facts}
    return Publication(publication.EVENT, payload, PublicationKind.EVENT, retain=False, qos=1)


def event(name: str) -> Message:
    """Return an event."""
    return Message(named_event(name))


def trace() -> Message:
    """Return a trace."""
    return Message(Publication("line/trace", {}, PublicationKind.TRACE, retain=False, qos=0))


def record(seq: int, device: str = "a", *, boot: str = "k", clock: ClockState = "synced") -> WindRecord:
    """Return a record of ten minutes that ends at 600 x seq s."""
    values = {"length": 600_000, "mean": 5.25, "gust": 9.5, "gust_before": 1250, "samples": 2400, "coverage": 1.0}
    ts, units = 600_000 * seq, {"mean": "m/s"}
    return WindRecord(device, boot, seq, ts, clock, values, units, RECORD_NAMES, "good", None, None)


def recorded(seq: int, device: str = "a") -> Publication:
    """Return what publishes a record."""
    sample = record(seq, device)
    payload = sample.payload("line0")
    return Publication(sample.history_topic, payload, PublicationKind.SAMPLE, retain=False, qos=1, sample=sample)
