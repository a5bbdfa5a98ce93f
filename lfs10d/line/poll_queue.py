"""The queue of polls: fixed grids, the earliest due first; then devices with interval 0 in turn.

Polls lie on a fixed grid per device: no drift. A point of the grid that is missed is skipped and counted. A retry
goes behind what was due before the attempt failed. So overload degrades evenly, and no device is asked twice before
one that was due. A device with interval 0 that waited 5 s goes as one that was due then. One that is silent at the
start is polled again at once, but not before the first poll of each other device.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable
from heapq import heappop, heappush
from math import floor, inf

from lfs10d.line.device import Device
from lfs10d.line.jobs.poll import Poll
from lfs10d.modbus.pending import PendingRequests
from lfs10d.reading import Purpose

FLAT_OUT_PATIENCE = 5.0
"""A device with interval 0 counts as due this many s after its last poll."""
EXCLUDED_PAUSE = 0.25
"""Seconds after which a device whose slave id belongs to a job is looked at again."""
LATE = 0.25
"""Part of its interval that a device may wait before the line hurries."""
SPREAD = 2.0
"""Greatest distance of grids in exchanges, so that every device is polled soon after the start."""
TOGETHER_FROM = 1.0
"""Polls of an interval (s) from this on follow each other where they leave enough of the line: code that has just run
costs less of the processor. With shorter ones a job that waits in silence would make more of them miss their points."""
TOGETHER_MOST = 1 / 3
"""Largest part of the line that polls may fill for that."""


def spread(devices: Iterable[Device], *, polled: int, wire_time: float, now: float) -> None:
    """Distribute the grids of `devices` from `now` on, so that they are not due at the same moment.

    `polled` is how many devices share the line, `wire_time` (s) what one exchange takes.
    """
    phase = now
    for device in devices:
        device.due = phase
        interval = device.spec.interval
        together = interval >= TOGETHER_FROM and polled * wire_time <= TOGETHER_MOST * interval
        phase += min(interval / polled, wire_time * (1.0 if together else SPREAD))


class PollQueue:
    """The devices waiting for their poll and the polls waiting for their next exchange."""

    def __init__(self, pending: PendingRequests) -> None:
        self._pending = pending
        self._due: list[tuple[float, int, Device | Poll]] = []
        self._flat: deque[Device] = deque()
        self._turn = 0

    def clear(self) -> None:
        """Forget all devices and polls."""
        for _, _, entry in self._due:
            if isinstance(entry, Device):
                entry.queued = False
        for device in self._flat:
            device.queued = False
        self._due.clear()
        self._flat.clear()

    def polls(self) -> list[Poll]:
        """Return the polls that wait for their next exchange."""
        return [entry for _, _, entry in self._due if isinstance(entry, Poll)]

    def enqueue(self, device: Device) -> None:
        """Let `device` wait for its next grid point, if it is polled and does not wait yet."""
        if device.queued or not device.spec.enabled or device.doubtful:
            return
        device.queued = True
        if device.starting:
            first = (each.due for _, _, each in self._due if isinstance(each, Device) and each.last_asked == -inf)
            self._push(max(device.again_at, *first, -inf), device)
        elif device.spec.interval == 0:
            self._flat.append(device)
        else:
            self._push(device.due, device)

    def resume(self, poll: Poll, key: float) -> None:
        """Let `poll` wait for its next exchange as one that became due at `key`."""
        self._push(key, poll)

    def patient(self, now: float) -> bool:
        """Whether the line need not hurry: no device with interval 0, no retry and no late poll waits."""
        if self._flat:
            return False
        due, _, first = self._due[0] if self._due else (inf, 0, None)
        return first is None or (isinstance(first, Device) and now - due < LATE * first.spec.interval)

    def next_due(self) -> float:
        """When the next poll is due; inf where none waits. A device with interval 0 is always due."""
        if self._flat:
            return -inf
        return self._due[0][0] if self._due else inf

    def choose(self, now: float, excluded: frozenset[int]) -> Poll | None:
        """Take the next poll; `excluded` slave ids are not polled now."""
        for _ in range(len(self._due) + len(self._flat)):
            entry = self._first(now)
            if entry is None:
                return None
            device = entry.device if isinstance(entry, Poll) else entry
            if device.slave in excluded:
                self._push(now + EXCLUDED_PAUSE, entry)
            elif isinstance(entry, Poll):
                return entry
            else:
                device.queued = False
                if not device.doubtful:
                    return self._begin(device, now)
        return None

    def _first(self, now: float) -> Device | Poll | None:
        due = self._due[0][0] if self._due else inf
        if due <= now and (not self._flat or due <= self._flat_due()):
            return heappop(self._due)[2]
        return self._flat.popleft() if self._flat else None

    def _flat_due(self) -> float:
        device = self._flat[0]
        return max(device.last_asked, device.due) + FLAT_OUT_PATIENCE

    def _begin(self, device: Device, now: float) -> Poll:
        interval = device.spec.interval
        due = now
        if device.starting:
            back_on_grid(device, now)
        elif interval > 0:
            due = device.due
            missed = floor((now - due) / interval)
            device.overruns += missed
            device.due = due + (missed + 1) * interval
        device.polling = True
        device.last_asked = now
        return Poll(device, self._pending, due=due, purpose=Purpose.POLL)

    def _push(self, key: float, entry: Device | Poll) -> None:
        self._turn += 1
        heappush(self._due, (key, self._turn, entry))


def back_on_grid(device: Device, now: float) -> None:
    """Continue at the next grid point after an offline device has answered; points that passed are no overrun."""
    interval = device.spec.interval
    if interval > 0 and device.due <= now:
        device.due += (floor((now - device.due) / interval) + 1) * interval
