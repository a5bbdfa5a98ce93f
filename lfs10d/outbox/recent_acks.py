"""Samples acknowledged lately, sent again where the broker may have lost them after its acknowledgement. Pure.

An acknowledgement of a broker that dies is not durable: what was acknowledged from 10 s before a loss until the backlog
is opened goes once more. After the first connect of a life so does what was acknowledged until then with the word that
nobody listens: after a power cut subscribers are late there too.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from dataclasses import replace

from lfs10d.outbox.history import QueuedSample

AGAIN_WITHIN = 10.0
"""Seconds before a loss of the connection whose acknowledgements are not believed (contract, section 3)."""


class RecentAcks:
    """At most `capacity` samples of each kind; `detection`: seconds in which a dead connection is noticed."""

    def __init__(self, *, capacity: int, detection: float) -> None:
        self.repeat = False
        """A connection was lost since the last `again`, which is to be called once the backlog is open."""
        self._detection = detection
        self._acknowledged: deque[tuple[float, QueuedSample]] = deque(maxlen=capacity)
        self.without_listener: deque[tuple[float, QueuedSample]] = deque(maxlen=capacity)
        """What was passed to nobody on a young connection: `again` is to be called for it too."""

    def add(self, samples: tuple[QueuedSample, ...], now: float, *, without_listener: bool) -> None:
        """Note that the broker has these; `without_listener`: no client received them, on a young connection."""
        if not self.repeat:  # what a loss now would not touch is of no use
            self._forget(now - AGAIN_WITHIN)
        acknowledged = self.without_listener if without_listener and not self.repeat else self._acknowledged
        for queued in samples:
            acknowledged.append((now, queued))

    def lost(self, now: float) -> None:
        """Note that the connection is lost."""
        if not self.repeat:
            self._forget(now - AGAIN_WITHIN - self._detection)
        self._acknowledged.extend(self.without_listener)
        self.without_listener.clear()
        self.repeat = True

    def on_clean_exit(self) -> None:
        """Note a clean exit from a broker that has acknowledged everything: nothing is sent to it a second time."""
        if not self.repeat:
            self._acknowledged.clear()
        self.without_listener.clear()

    @property
    def waiting(self) -> bool:
        """There is something for `again`."""
        return bool(self._acknowledged if self.repeat else self.without_listener)

    def again(self) -> Iterator[QueuedSample]:
        """Take what is to be sent once more, and begin anew."""
        again = self._acknowledged if self.repeat else self.without_listener
        self.repeat = False
        return self._take(again)

    def take_lost(self) -> Iterator[QueuedSample]:
        """Take what was acknowledged before a loss, while the broker is away; nothing without a loss."""
        return self._take(self._acknowledged) if self.repeat else iter(())

    @staticmethod
    def _take(samples: deque[tuple[float, QueuedSample]]) -> Iterator[QueuedSample]:
        while samples:
            yield replace(samples.popleft()[1], repeated=True)

    def _forget(self, before: float) -> None:
        while self._acknowledged and self._acknowledged[0][0] < before:
            self._acknowledged.popleft()
