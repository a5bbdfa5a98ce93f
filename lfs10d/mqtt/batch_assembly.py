"""A history batch as one JSON array, serialised in slices: the loop has others to serve. Pure."""

from __future__ import annotations

from dataclasses import field

from lfs10d.mqtt.encoding import array, encode, packet_size
from lfs10d.mqtt.messages import Accepted
from lfs10d.outbox.backlog import BATCH_BYTES
from lfs10d.outbox.items import HistoryBatch
from lfs10d.system.dataclass import dataclass

SAMPLES_AT_ONCE = 16
"""Samples serialised in one go; a whole batch would take a millisecond."""


def room_for_batch(topic: str, accepted: Accepted | None) -> int:
    """Return how many bytes the payload of a batch on a full topic may have."""
    if accepted is None or accepted.maximum_packet_size is None:
        return BATCH_BYTES
    around = packet_size(topic, b"", version=accepted.version)
    # The remaining length may take three bytes more than that of an empty payload.
    return min(BATCH_BYTES, accepted.maximum_packet_size - around - 3)


@dataclass(slots=True)
class BatchAssembly:
    """A batch that is being serialised; its payload has at most `most` bytes, or one sample."""

    batch: HistoryBatch
    most: int
    _parts: list[bytes] = field(default_factory=list)
    _size: int = 1

    def serialise_some(self, line: str) -> int | None:
        """Serialise the next samples; return how many have room if not all do: `batch` is then to be shortened."""
        done = len(self._parts)
        for queued in self.batch.samples[done : done + SAMPLES_AT_ONCE]:
            part = encode(queued.sample.payload(line, historical=True))
            self._size += len(part) + 1  # the comma, or the bracket behind it
            if self._parts and self._size > self.most:
                return len(self._parts)
            self._parts.append(part)
        return None

    @property
    def complete(self) -> bool:
        """All samples of the batch are serialised."""
        return len(self._parts) == len(self.batch.samples)

    @property
    def payload(self) -> bytes:
        """The JSON array, once it is complete; the JSON object of what goes by itself."""
        return array(self._parts) if self.batch.samples[0].sample.grouped else self._parts[0]
