"""The master's port on a simulated line, in virtual time; and what drives a master through virtual time."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final, Protocol

from lfs10d.errors import PortBusyError, PortGoneError
from lfs10d.modbus.port_settings import PortSettings
from lfs10d.reading import UartCounters
from lfs10d.simulator.adapter import Adapter
from lfs10d.simulator.line import SimulatedLine
from lfs10d.simulator.wire import SECOND, Format, Parity, nanoseconds

LOW_LATENCY: Final = 0.004
"""What a port reports as adapter latency where low latency was confirmed (s)."""
USUAL_LATENCY: Final = 0.020
"""What it reports elsewhere (s)."""
STANDSTILL: Final = 10_000
"""Turns without any progress of time after which `run` gives up."""
_DESCRIPTOR: Final = 1_000_000  # no such file: a select on it fails at once


class Turn(Protocol):
    """What a turn returns: when the next is due, and whether bytes that arrive make it due earlier."""

    @property
    def until(self) -> float:
        """When it is due at the latest (s)."""

    @property
    def listen(self) -> bool:
        """Whether it is due as soon as the port is readable."""


class VirtualClock:
    """Seconds that pass only when somebody says so; call it as one calls `time.monotonic`."""

    def __init__(self, now: float = 0.0) -> None:
        self.now = now

    def __call__(self) -> float:
        """Return the time."""
        return self.now


def format_of(settings: PortSettings) -> Format:
    """Return how a port with these settings sends and hears characters."""
    parity: Parity = "none"
    if settings.parity != "none":
        parity = "even" if settings.parity == "even" else "odd"
    return Format(settings.baudrate, settings.databits, parity, settings.stopbits)


class SimulatedPort:
    """A `modbus.port.Port` on a simulated line.

    `latency` (s) is the adapter's real one, `confirmed` whether the driver confirmed its low-latency mode.
    """

    def __init__(
        self,
        line: SimulatedLine,
        clock: VirtualClock,
        settings: PortSettings,
        *,
        echo: bool = False,
        latency: float = 0.0,
        confirmed: bool = False,
        counts: bool = True,
    ) -> None:
        self.line = line
        self.clock = clock
        self.settings = settings
        self.confirmed = confirmed
        self.counts = counts
        self.adapter_latency = USUAL_LATENCY
        self.paced = True
        self.adapter = Adapter(line, format_of(settings), echo=echo, latency=nanoseconds(latency))
        self.plugged = True
        self.locked = False
        self.openings = 0
        self._open = False
        self._hung_up = False
        self._readable = bytearray()
        self._sent_by = 0

    def open(self) -> None:
        """Open it; PortGoneError while unplugged, PortBusyError while another program has it."""
        if not self.plugged:
            raise PortGoneError(self.settings.path, "no such device; is the adapter plugged in?")
        if self.locked:
            raise PortBusyError(self.settings.path, "locked by another program; end that program")
        self._open, self._hung_up = True, False
        self.openings += 1
        self.adapter_latency = LOW_LATENCY if self.confirmed and self.settings.low_latency else USUAL_LATENCY
        self.adapter.retune(format_of(self.settings), self._time())
        self.flush()

    def close(self) -> None:
        """Close it; what arrives until the next opening is lost."""
        self._open = False

    def fileno(self) -> int:
        """Return a number no select accepts: virtual time is driven by `run`. -1 when closed."""
        return _DESCRIPTOR if self._open else -1

    def write(self, frame: bytes) -> None:
        """Send a frame from now on, behind what is still being sent."""
        self._demand()
        self._sent_by = self.line.transmit(frame, self._time(), self.adapter.format)

    def read(self) -> bytes:
        """Return what is readable now."""
        self._demand()
        self._hear()
        data = bytes(self._readable)
        self._readable.clear()
        return data

    def waiting(self) -> int:
        """Return how many bytes are readable now."""
        self._demand()
        self._hear()
        return len(self._readable)

    def drain(self) -> None:
        """Wait, in virtual time, until everything is sent."""
        self._demand()
        self.clock.now = max(self.clock.now, self._sent_by / SECOND)

    def flush(self) -> None:
        """Discard what is readable now."""
        self._demand()
        self._hear()
        self._readable.clear()

    def reconfigure(self, settings: PortSettings) -> None:
        """Speak and hear in another format from now on; bytes still being sent are spoilt."""
        self._demand()
        now = self._time()
        self.line.advance(now)
        shape = format_of(settings)
        if shape != self.adapter.format:
            self.line.strike(now)
        self.adapter.retune(shape, now)
        self.settings = settings

    def counters(self) -> UartCounters | None:
        """Return how many bytes came at another rate; None where the driver counts nothing."""
        return UartCounters(self.adapter.framing_errors, 0, 0, 0) if self.counts else None

    def unplug(self) -> None:
        """Pull the adapter out: every call fails until it is plugged in and opened again."""
        self.plugged = False
        self._hung_up = True

    def replug(self) -> None:
        """Put the adapter back."""
        self.plugged = True

    def hang_up(self) -> None:
        """Lose the open port once; it can be opened again at once."""
        self._hung_up = True

    def lost(self) -> bool:
        """Say whether it is open and hung up: whoever uses it is told so."""
        return self._open and self._hung_up

    def next_event(self) -> float | None:
        """Return when a byte becomes readable or something is decided on the line; None if nothing is pending."""
        if self._readable:
            return self.clock.now
        times = [time for time in (self.adapter.next_ready(), self.line.next_event()) if time is not None]
        return max(min(times) / SECOND, self.clock.now) if times else None

    def arrival(self, limit: float) -> float:
        """Let the line go on until a byte is readable or the port hangs up, at `limit` at the latest; return then.

        Only for one who knows that nobody sends before.
        """
        if self._readable or self.lost():
            return self.clock.now
        last = nanoseconds(limit)
        while True:
            ready = self.adapter.next_ready() if self._open else None
            event = self.line.next_event()
            if event is not None and event <= last and (ready is None or event < ready):
                self.line.advance(event)
                if self.lost():
                    return max(event / SECOND, self.clock.now)
            elif ready is None or ready > last:
                return limit
            else:
                return max(ready / SECOND, self.clock.now)

    def _time(self) -> int:
        return nanoseconds(self.clock.now)

    def _hear(self) -> None:
        now = self._time()
        self.line.advance(now)
        self._readable += self.adapter.collect(now)

    def _demand(self) -> None:
        if self.lost() or not self._open:
            raise PortGoneError(self.settings.path, "hung up; is the adapter plugged in?")


def run(turn: Callable[[float], Turn], port: SimulatedPort, clock: VirtualClock, until: float) -> None:
    """Call `turn` whenever it is due, in virtual time, until that time has come.

    If what it returns has `not_before`, bytes do not make it due before that.

    Raises RuntimeError when it is due again and again without time going on.
    """
    turns = 0
    before = clock.now
    while clock.now < until:
        wait = turn(clock.now)
        limit = max(min(wait.until, until), clock.now)
        earliest = min(getattr(wait, "not_before", clock.now), limit)
        clock.now = max(port.arrival(limit), earliest) if wait.listen else limit
        turns = turns + 1 if clock.now == before else 0
        before = clock.now
        if turns > STANDSTILL:
            raise RuntimeError(f"time stands still at {before} s: the turn is always due now")
    port.line.advance(nanoseconds(clock.now))
