"""The items of the outbox: each becomes one message to the broker. Pure values.

Topics are under `B`. Two items are never equal, whatever they say: each is one message.
"""

from __future__ import annotations

from dataclasses import replace
from math import inf
from typing import TypeAlias

from lfs10d.outbox.history import QueuedSample
from lfs10d.outbox.losses import Loss
from lfs10d.system.clock_step import ClockState
from lfs10d.system.dataclass import dataclass
from lfs10d.telemetry.publication import EVENT, Publication, iso_time


@dataclass(frozen=True, slots=True, eq=False)
class Published:
    """What goes as it was published."""

    publication: Publication

    @property
    def topic(self) -> str:
        """The topic under `B`."""
        return self.publication.topic


@dataclass(frozen=True, slots=True, eq=False)
class Retained(Published):
    """The newest version of a retained topic, published at `since` (monotonic s); payload None clears it."""

    since: float = -inf


@dataclass(frozen=True, slots=True, eq=False)
class Message(Published):
    """A response, an event or a trace; `correlation` is the request's Correlation Data."""

    correlation: bytes | None = None


@dataclass(frozen=True, slots=True, eq=False)
class LiveSample(Published):
    """A sample while it is young."""

    queued: QueuedSample

    def at(self, shift: int, clock: ClockState = "synced") -> LiveSample:
        """Return it with the time that the clock tells now, as `QueuedSample.at` does."""
        queued = self.queued.at(shift, clock)
        payload = self.publication.payload
        if queued is self.queued or not isinstance(payload, dict):
            return self
        sample = queued.sample
        if sample.grouped:
            corrected = {**payload, "ts": sample.ts, "time": iso_time(sample.ts), "clock": sample.clock}
        else:  # a record has more times than one
            corrected = sample.payload(str(payload["line"]))
        return LiveSample(replace(self.publication, payload=corrected, sample=sample), queued)


@dataclass(frozen=True, slots=True, eq=False)
class HistoryBatch:
    """1..100 samples of one device and boot in order of seq, for `history`; or one that goes by itself."""

    samples: tuple[QueuedSample, ...]

    @property
    def topic(self) -> str:
        """The topic under `B`."""
        return self.samples[0].sample.history_topic


@dataclass(frozen=True, slots=True, eq=False)
class LossNotice:
    """Lost samples, for event `dropped`."""

    loss: Loss

    @property
    def topic(self) -> str:
        """The topic under `B`."""
        return EVENT


OutboxItem: TypeAlias = Retained | Message | LiveSample | HistoryBatch | LossNotice


def samples_of(item: OutboxItem) -> tuple[QueuedSample, ...]:
    """Return the samples an item carries."""
    match item:
        case LiveSample(queued=queued):
            return (queued,)
        case HistoryBatch(samples=samples):
            return samples
        case _:
            return ()
