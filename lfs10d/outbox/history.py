"""The samples that wait for their turn on `history`. Pure.

One shelf per source and boot, in order of seq: a device's samples, or its records. The next to be taken is the shelf
that holds the oldest sample. A sample that the broker has acknowledged before may stand here once more (`repeated`):
where there is no room, these go first, and their going is no loss.
"""

from __future__ import annotations

from bisect import insort
from collections.abc import Container, Iterable
from dataclasses import field, replace

from lfs10d.outbox.losses import Key
from lfs10d.system.clock_step import ClockState, corrects
from lfs10d.system.dataclass import dataclass
from lfs10d.telemetry.publication import Sample


@dataclass(frozen=True, slots=True)
class QueuedSample:
    """One sample that waits since `since` (monotonic s); `repeated`: the broker acknowledged it before.

    `shift` is the wall clock less the monotonic one when it was measured, in ms; None: of an earlier boot.
    `row` is its id in the store, None where it is in memory alone.
    """

    sample: Sample
    since: float
    repeated: bool = False
    shift: int | None = None
    row: int | None = None

    @property
    def key(self) -> Key:
        """Source and boot: one history batch holds samples of one key."""
        return self.sample.source, self.sample.boot

    def at(self, shift: int, clock: ClockState = "synced") -> QueuedSample:
        """Return it with the time that the clock tells now, whose word is `clock`.

        Unchanged if its own was synchronised; and where nobody vouches for the clock now, unless it was stepped since.
        """
        if self.shift is None or not corrects(self.sample.clock, self.shift, shift, clock):
            return self
        right = replace(self.sample, ts=self.sample.ts + shift - self.shift, clock=clock)
        return replace(self, sample=right, shift=shift)


def _seq(queued: QueuedSample) -> int:
    return queued.sample.seq


def _age(queued: QueuedSample) -> tuple[float, int]:
    """Return a key by which older samples sort first; samples of one page of the store sort by row."""
    return queued.since, queued.row or 0


@dataclass(slots=True)
class History:
    """What waits; `len()` counts the samples. No sample is put here while it stands here already."""

    count: int = 0
    """The number of samples."""
    _queues: dict[Key, list[QueuedSample]] = field(default_factory=dict)
    _repeated: int = 0

    def __len__(self) -> int:
        return self.count

    def __contains__(self, key: Key) -> bool:
        """Return whether a sample of this source and boot waits."""
        return key in self._queues

    def add(self, queued: QueuedSample) -> None:
        """Put one sample in its place."""
        queue = self._queues.setdefault(queued.key, [])
        if queue and _seq(queue[-1]) > _seq(queued):
            insort(queue, queued, key=_seq)
        else:
            queue.append(queued)
        self.count += 1
        self._repeated += queued.repeated

    def extend(self, many: Iterable[QueuedSample]) -> None:
        """Put several in their places."""
        for queued in many:
            self.add(queued)

    def put_back(self, taken: tuple[QueuedSample, ...]) -> None:
        """Put back samples of one key that were taken last: before all others of it, if that is their place."""
        queue = self._queues.get(taken[0].key)
        if queue is None or _seq(taken[-1]) > _seq(queue[0]):
            self.extend(taken)
            return
        queue[:0] = taken
        self.count += len(taken)
        self._repeated += sum(queued.repeated for queued in taken)

    def waits(self, passed_over: Container[str] = frozenset()) -> bool:
        """Return whether a sample waits of a source that is not `passed_over`."""
        return any(source not in passed_over for source, _ in self._queues)

    def take(self, most: int, passed_over: Container[str] = frozenset()) -> tuple[QueuedSample, ...]:
        """Take up to `most` samples of the key that holds the oldest, in order of seq; () where none waits.

        Those of sources that are `passed_over` stay; of samples that are sent each by itself one is taken.
        """
        keys = [key for key in self._queues if key[0] not in passed_over]
        if not keys:
            return ()
        key = min(keys, key=lambda each: _age(self._queues[each][0]))
        queue = self._queues[key]
        if not queue[0].sample.grouped:
            most = 1
        taken = tuple(queue[:most])
        del queue[:most]
        if not queue:
            del self._queues[key]
        self.count -= len(taken)
        self._repeated -= sum(queued.repeated for queued in taken)
        return taken

    def evict(self) -> QueuedSample | None:
        """Make room: drop all that were acknowledged before (None), else take the oldest (None: none waits)."""
        if not self._repeated:
            return next(iter(self.take(1)), None)
        queues = {key: [queued for queued in queue if not queued.repeated] for key, queue in self._queues.items()}
        self._queues = {key: queue for key, queue in queues.items() if queue}
        self.count -= self._repeated
        self._repeated = 0
        return None

    def correct(self, shift: int, clock: ClockState = "synced") -> None:
        """Give all the time that the clock tells now, as `QueuedSample.at` does."""
        for queue in self._queues.values():
            queue[:] = [queued.at(shift, clock) for queued in queue]

    def clear(self) -> None:
        """Forget all."""
        self._queues.clear()
        self.count = self._repeated = 0

    def oldest(self) -> QueuedSample | None:
        """Return the one that waits longest, None where none waits."""
        return min((queue[0] for queue in self._queues.values()), key=_age, default=None)
