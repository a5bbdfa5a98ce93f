"""The adapter of a master: which bytes are readable when."""

from __future__ import annotations

from bisect import bisect_right
from collections import deque

from lfs10d.simulator.burst import MASTER, Burst, as_heard
from lfs10d.simulator.line import SimulatedLine
from lfs10d.simulator.wire import Format


class Adapter:
    """A receiver on the line. Change `format`, `echo` and `latency` at any time; all times are ns.

    With `echo` the master's own bytes come back. With a `latency` bytes become readable in pieces, at its
    multiples, as a USB adapter delivers them; without, each when its last bit has arrived.
    """

    def __init__(self, line: SimulatedLine, shape: Format, *, echo: bool = False, latency: int = 0) -> None:
        self.line = line
        self.format = shape
        self.echo = echo
        self.latency = latency
        self.framing_errors = 0
        """Bytes that came at another rate than the adapter listened at."""
        self._bursts: list[tuple[Burst, int]] = []  # with the number of bytes already taken
        self._held: deque[tuple[int, bytes]] = deque()  # arrived, readable from that time on
        line.attach(self)

    def offer(self, burst: Burst) -> None:
        """Take note of bytes that will come."""
        if self.echo or burst.speaker is not MASTER:
            self._bursts.append((burst, 0))

    def next_ready(self) -> int | None:
        """Return when the next byte becomes readable, by what is on the line now; None if none is to come."""
        times = [self._ready(burst.ends[taken]) for burst, taken in self._bursts if taken < len(burst.ends)]
        if self._held:
            times.append(self._held[0][0])
        return min(times) if times else None

    def collect(self, now: int) -> bytes:
        """Return, and take, the bytes that are readable at `now`, in order of arrival."""
        if self._bursts:
            self._hear(now)
        data = b""
        while self._held and self._held[0][0] <= now:
            data += self._held.popleft()[1]
        return data

    def retune(self, shape: Format, now: int) -> None:
        """Listen in another format from `now` on; what has arrived stays as it was heard."""
        self._hear(now)
        self.format = shape

    def _ready(self, end: int) -> int:
        return end if self.latency == 0 else -(-end // self.latency) * self.latency

    def _hear(self, now: int) -> None:
        """Take over what has arrived by `now`, together with what the adapter still keeps."""
        arrived: list[tuple[int, int, bytes]] = []  # when the last bit came, when readable, what
        coming: list[tuple[Burst, int]] = []
        for burst, taken in self._bursts:
            count = bisect_right(burst.ends, now)
            if count > taken:
                data = as_heard(burst, self.format, taken, count)
                if burst.format != self.format:
                    self.framing_errors += count - taken
                ends = burst.ends[taken:count]
                if self.latency == 0:
                    arrived.append((ends[-1], ends[-1], data))
                else:
                    arrived += [(end, self._ready(end), data[n : n + 1]) for n, end in enumerate(ends)]
            if count < len(burst.ends):
                coming.append((burst, max(count, taken)))
        self._bursts = coming
        if len(arrived) > 1:
            arrived.sort(key=lambda one: one[0])
        self._held.extend([(ready, data) for _, ready, data in arrived])
