"""The queue of live samples: the devices in turn, of each the oldest first. Pure.

A device that is polled often delays no other: each waits for at most one sample of every other device.
"""

from __future__ import annotations

from collections import deque

from lfs10d.outbox.items import LiveSample
from lfs10d.system.clock_step import ClockState

LIVE_FOR = 3.0
"""Seconds after which a sample is history (contract, section 3)."""


class LiveQueue:
    """What waits; `len()` counts the samples."""

    def __init__(self) -> None:
        self.waiting: dict[LiveSample, None] = {}
        """The oldest first."""
        self._devices: dict[str, deque[LiveSample]] = {}  # in the order of their turns; none is empty

    def __len__(self) -> int:
        return len(self.waiting)

    def add(self, live: LiveSample) -> None:
        """Put a new sample behind those of its device."""
        self.waiting[live] = None
        device = live.queued.sample.device
        if device in self._devices:
            self._devices[device].append(live)
        else:
            self._devices[device] = deque((live,))

    def put_back(self, live: LiveSample) -> None:
        """Put a sample that did not arrive before all others."""
        self.waiting = {live: None, **self.waiting}
        self._devices.setdefault(live.queued.sample.device, deque()).appendleft(live)

    def take(self) -> LiveSample | None:
        """Take the sample whose turn it is, None where none waits."""
        if not self._devices:
            return None
        device = next(iter(self._devices))
        waiting = self._devices.pop(device)
        live = waiting.popleft()
        if waiting:
            self._devices[device] = waiting
        del self.waiting[live]
        return live

    def take_oldest(self) -> LiveSample | None:
        """Take the sample that waits longest, None where none waits."""
        live = self.oldest()
        if live is not None:
            del self.waiting[live]
            device = live.queued.sample.device
            self._devices[device].remove(live)  # its first
            if not self._devices[device]:
                del self._devices[device]
        return live

    def oldest(self) -> LiveSample | None:
        """Return the sample that waits longest, None where none waits."""
        return next(iter(self.waiting), None)

    @property
    def old_at(self) -> float | None:
        """When the oldest sample becomes history; None: none waits."""
        live = self.oldest()
        return None if live is None else live.queued.since + LIVE_FOR

    def take_old(self, now: float) -> list[LiveSample]:
        """Take the samples that are history by now."""
        old = []
        while (live := self.oldest()) is not None and now - live.queued.since > LIVE_FOR:
            self.take_oldest()
            old.append(live)
        return old

    def correct(self, shift: int, clock: ClockState = "synced") -> None:
        """Give all the time that the clock tells now, as `QueuedSample.at` does; the turns stay."""
        replaced = {live: live.at(shift, clock) for live in self.waiting}
        self.waiting = dict.fromkeys(replaced.values())
        self._devices = {device: deque(replaced[live] for live in waiting) for device, waiting in self._devices.items()}
