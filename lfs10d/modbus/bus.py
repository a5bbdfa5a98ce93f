"""The bus: owns the port and carries out one request at a time.

A thin shell around `Exchange`; it decides nothing but when to reopen the port. Every byte on the line passes here,
in one thread. `step` does what can be done now and says when to come back; the thread waits in between, in virtual
time there is no wait.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from math import inf
from typing import Literal, TypeAlias

from lfs10d.errors import PortBusyError, PortError, PortGoneError
from lfs10d.modbus.ask import Ask, LineContext
from lfs10d.modbus.echo import Echo, EchoLearner
from lfs10d.modbus.exchange import Exchange, Listen, Quiet, Settled
from lfs10d.modbus.outcome import Outcome
from lfs10d.modbus.pending import Pending
from lfs10d.modbus.port import Port
from lfs10d.modbus.port_settings import PortSettings
from lfs10d.modbus.request import ReadRegisters
from lfs10d.modbus.timing import LineTiming
from lfs10d.reading import Fault, FaultCode, PortChanged, UartCounters
from lfs10d.system.dataclass import dataclass

REOPEN_FIRST = 0.2
"""First pause in s before the lost port is tried again; doubled up to the longest."""
REOPEN_LAST = 1.0
"""The longest pause between two tries to open the port, in s."""
RATE_SETTLE = 0.005
"""Silence before and after a change of rate, in s: the divisor can change under bytes still in the adapter."""
AWAKE_BEFORE = 0.00025
"""Who waits for an answer is awake so long before its last byte, in s, at most a character: what came until then is
sorted, which brings the code back into the processor's caches, and the last byte is read when it comes, not 0.2 ms
later. The next silence begins at that moment."""

STALE_LOOK = 0.001
"""A look at the port that is older than this (s) is taken again: another program had the processor meanwhile."""


UNHURRIED_AFTER = 0.0001
"""Who waits for an answer while nobody waits for the line looks so long after its last byte, in s: all of it is there
then, and one look is enough."""


@dataclass(frozen=True, slots=True)
class Wait:
    """Nothing to do before `until`, or with `listen` before bytes come, and not before `not_before`.

    `hurried`: somebody waits for the line, so that a tenth of a millisecond counts.
    """

    until: float
    listen: bool
    not_before: float = -inf
    hurried: bool = True


@dataclass(frozen=True, slots=True)
class LineRules:
    """Settings for every exchange on this line. Durations in s; `broadcast_delay` is the silence after a broadcast."""

    extra_gap: float = 0.0
    broadcast_delay: float = 0.1
    echo: Literal["auto", "on", "off"] = "auto"


Step: TypeAlias = Wait | Outcome | PortChanged


class Bus:
    """One line: its port, its silence, its echo. `clock` gives monotonic s, the same as the `now` of every call."""

    def __init__(self, port: Port, rules: LineRules, clock: Callable[[], float]) -> None:
        self.port = port
        self.rules = rules
        self.open = False
        self.timing = self._timing(port.settings)
        self.unsolicited = 0
        self.strays: list[tuple[bytes, float]] = []
        """Bytes received between two exchanges, with the times of their reads; the reader clears it."""
        self._settings = port.settings
        self._clock = clock
        self._echo = EchoLearner(rules.echo)
        self.asked: Ask | None = None
        """What is on the line, or is to be put there next; None while nothing is asked."""
        self._hurried = True
        self._pending: Mapping[int, tuple[Pending, ...]] = {}
        self._exchange: Exchange | None = None
        self._begun: tuple[bytes, float] | None = None
        """The plain beginning of an answer, with the time of its read: it is sorted with the rest."""
        self._context: LineContext | None = None
        """The state of the line for the next exchange; None where anything but the echo has changed."""
        self._quiet_since = -inf
        self._gap: float | None = None
        self._reopen_at = -inf
        self._pause = REOPEN_FIRST
        self._fault: Fault | None = None
        self._unplugged = False

    def _timing(self, settings: PortSettings) -> LineTiming:
        return LineTiming.of(
            settings.baudrate,
            databits=settings.databits,
            parity=settings.parity,
            stopbits=settings.stopbits,
            extra_gap=self.rules.extra_gap,
        )

    @property
    def echo(self) -> Echo:
        """The adapter's echo as far as it is known; nothing is written while it is unknown."""
        return self._echo.state

    # -- the port

    def reopen(self, now: float) -> PortChanged | Wait:
        """Try to open the port, by its path, if the time has come."""
        if now < self._reopen_at:
            return Wait(self._reopen_at, listen=False)
        self.port.settings = self._settings
        try:
            self.port.open()
        except PortError as error:
            self._reopen_at = now + self._pause
            self._pause = min(2 * self._pause, REOPEN_LAST)
            changed = self._lost(error, now)
            return changed or Wait(self._reopen_at, listen=False)
        self.open = True
        self.timing = self.line_timing
        self._fault = None
        self._pause = REOPEN_FIRST
        self._echo.reopened()
        self._quiet_since = self._clock()
        self._gap = self._context = None
        return PortChanged(now, None)

    def _lost(self, error: PortError, now: float) -> PortChanged | None:
        """Close the port and report it, once per reason; unplugged and absent are one reason."""
        hung_up, gone = self.open, isinstance(error, PortGoneError)
        self.close()
        code = FaultCode.PORT_BUSY if isinstance(error, PortBusyError) else FaultCode.PORT_LOST
        fault = Fault(code, str(error))
        if self._fault is not None and (fault == self._fault or (gone and self._unplugged)):
            return None
        self._fault = fault
        self._unplugged = hung_up and gone
        return PortChanged(now, fault)

    @property
    def speaking_until(self) -> float:
        """When the request under way has left the wire; closing the port before would cut it."""
        return -inf if self._exchange is None else self._exchange.quiet_since

    def close(self) -> None:
        """Close the port; the request under way is abandoned."""
        self.open = False
        self._exchange = self.asked = self._begun = None
        self.port.close()

    def retry(self, now: float) -> None:
        """Try to open the closed port at once; the result is reported even if nothing changed."""
        self._reopen_at = now
        self._pause = REOPEN_FIRST
        self._fault = None

    def reconfigure(self, settings: PortSettings, rules: LineRules, now: float) -> None:
        """Use other settings from the next exchange on; those that are set at opening reopen the port."""
        if rules.echo != self.rules.echo:
            self._echo = EchoLearner(rules.echo)
        self.rules = rules
        self._context = None
        before, self._settings = self._settings, settings
        if self.open and _at_opening(before) != _at_opening(settings):
            self.close()
        if self.open:
            self.timing = self._timing(self.port.settings)
        else:
            self._reopen_at = now

    @property
    def line_timing(self) -> LineTiming:
        """The times at the line's own rate."""
        return self._timing(self._settings)

    def counters(self) -> UartCounters | None:
        """Return the driver's counters, None where it has none or the port is lost."""
        try:
            return self.port.counters() if self.open else None
        except PortError:  # the next exchange will tell
            return None

    # -- one exchange

    def ask(self, ask: Ask, pending: Mapping[int, tuple[Pending, ...]], *, hurried: bool = True) -> None:
        """Take the next request; `step` carries it out.

        `pending` are the requests to any slave whose answers may still come, by slave id; it may change until then.
        `hurried`: others wait for the line.
        """
        self.asked = ask
        self._hurried = hurried
        self._pending = pending

    def step(self, now: float, *, readable: bool) -> Step:
        """Do what can be done now; return the outcome when the exchange is over."""
        try:
            return self._step(now, readable=readable)
        except PortError as error:
            self._reopen_at = now + REOPEN_FIRST
            return self._lost(error, now) or Wait(self._reopen_at, listen=False)

    def _step(self, now: float, *, readable: bool) -> Step:
        heard = self.port.read() if readable else b""
        if heard:
            now = self._clock()  # a byte may have come after the turn began: it counts from when it was read
        if self._exchange is None:
            if heard:  # nobody asked for it: it restarts the silence
                self.unsolicited += len(heard)
                self.strays.append((heard, now))
                self._quiet_since = max(self._quiet_since, now)
            if self.asked is None:
                return Wait(inf, listen=True)
            settings = self._settings if self.asked.baudrate is None else self._settings_at(self.asked.baudrate)
            if settings is not self.port.settings and settings != self.port.settings:
                if now < self._quiet_since + RATE_SETTLE:
                    return Wait(self._quiet_since + RATE_SETTLE, listen=True)
                self._change_rate(settings)
            self._exchange = self._begin(self.asked, now)
        elif (heard or self._begun) and (wait := self._hear(self._exchange, heard, now)) is not None:
            return wait
        return self._carry_on(self._exchange, now)

    def _hear(self, exchange: Exchange, heard: bytes, now: float) -> Wait | None:
        """Give the exchange what was read; return how to wait where that is plainly the beginning of its answer."""
        begun, self._begun = self._begun, None
        if begun is None:
            if (listen := exchange.foreseen(heard, now)) is not None:
                self._begun = heard, now
                return self._listen(listen)
            exchange.received(heard, now)
        elif heard:
            exchange.received(heard, now, begun)
        else:
            exchange.received(*begun)
        return None

    def _listen(self, listen: Listen) -> Wait:
        early = min(AWAKE_BEFORE, self.timing.character) if self._hurried else -UNHURRIED_AFTER
        return Wait(listen.until, listen=True, not_before=listen.not_before - early, hurried=self._hurried)

    def _settings_at(self, baudrate: int) -> PortSettings:
        return self._settings if baudrate == self._settings.baudrate else replace(self._settings, baudrate=baudrate)

    def _change_rate(self, settings: PortSettings) -> None:
        """Use other settings: drain the port, then keep the longer of the two gaps once."""
        before = self.timing
        self.port.drain()
        self.port.reconfigure(settings)
        self.port.flush()
        self.timing = self._timing(settings)
        self._gap = self.timing.slower(before)
        self._context = None
        self._quiet_since = self._clock() + RATE_SETTLE

    def _begin(self, ask: Ask, now: float) -> Exchange:
        line = self._context
        if line is None or line.echo is not self._echo.state:
            line = self._context = LineContext(
                timing=self.timing,
                echo=self._echo.state,
                adapter_latency=self.port.adapter_latency,
                broadcast_delay=self.rules.broadcast_delay,
                gap=self._gap,
                paced=self.port.paced,
                echo_proved=self._echo.proved,
            )
        return Exchange(ask, line, self._pending, asked=now, quiet_since=self._quiet_since)

    def _carry_on(self, exchange: Exchange, now: float) -> Wait | Outcome:
        while True:
            action = exchange.step(now)
            if isinstance(action, Listen):
                return self._listen(action)
            if isinstance(action, Quiet):
                return Wait(action.until, listen=True, hurried=self._hurried)
            if isinstance(action, Settled):
                return self._settled(action.outcome)
            looked = self._clock()
            if self.port.waiting():  # the last look before we speak
                data = self.port.read()
                now = self._clock()
                exchange.received(data, now)
                continue
            begun = now = self._clock()
            if begun - looked > STALE_LOOK:
                continue
            self.port.write(action.frame)
            now = self._clock()
            exchange.sent(begun, now)

    def _settled(self, outcome: Outcome) -> Outcome:
        self._exchange = self.asked = None
        self._quiet_since = outcome.quiet_since
        if self._gap is not None and outcome.sent_end is not None:
            self._gap = self._context = None
        if isinstance(outcome.request, ReadRegisters):
            self._echo.observed(outcome.echoed)
        return outcome


def _at_opening(settings: PortSettings) -> tuple[object, ...]:
    return settings.path, settings.low_latency, settings.rs485
