"""Counts since boot, and load and rates of the last half minute, for `line/stats` and `device/<name>/stats`.

Adding an event costs a few additions, whatever the number of devices; sorting is done only when the figures
are asked for. What is not known is None, never 0 and never NaN. Times are monotonic seconds.
"""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Iterable
from math import ceil, floor
from typing import NamedTuple

from lfs10d.reading import PORT_CODES, Exchanged, FaultCode, Purpose, Reading, UartCounters
from lfs10d.system.dataclass import dataclass
from lfs10d.telemetry.publication import VERSION, BacklogStats

WINDOW = 30
"""Seconds over which rates are computed."""

LEAST_SPAN = 1.0
"""Shortest time in s for which a rate is published."""

RECENT_GAPS = 1000
RECENT_RTTS = 100

OTHER_RATES = frozenset({Purpose.SCAN, Purpose.CHANGE})
"""Purposes that may use another baud rate: their gaps are not counted."""


def percentile(values: Iterable[float], percent: int) -> float | None:
    """Return the smallest value that at least `percent` (1..100) per cent do not exceed; None of none."""
    ordered = sorted(values)
    return ordered[ceil(len(ordered) * percent / 100) - 1] if ordered else None


def scaled(value: float | None, factor: float, digits: int) -> float | None:
    """Return `value` times `factor`, rounded for publication; None stays None."""
    return None if value is None else round(value * factor, digits)


@dataclass(slots=True)
class _Second:
    """The counts of one second; `busy` is the line's time in use, in s."""

    number: int
    polls: int = 0
    busy: float = 0.0
    longest: float = 0.0


class Rates(NamedTuple):
    """The last half minute: load in per cent, polls per s, longest s between two polls of one device."""

    load_pct: float | None
    polls_per_s: float | None
    cycle_s: float | None


class LineCounters:
    """The figures of the line; `started` is when counting began."""

    def __init__(self, started: float) -> None:
        self._started = started
        self._seconds: deque[_Second] = deque()
        self._gaps: deque[float] = deque(maxlen=RECENT_GAPS)
        self._least_gap: float | None = None
        self.exchanges = 0
        self.errors: Counter[str] = Counter()
        self.unsolicited = 0
        self.uart: UartCounters | None = None

    def exchanged(self, event: Exchanged) -> None:
        """Count one exchange and its dropped late answers; its fault is counted with its poll."""
        self.exchanges += 1
        self.unsolicited += event.unsolicited
        if event.late:
            self.errors[FaultCode.LATE.value] += event.late
        self._second(event.at).busy += event.at - event.asked
        gap = event.gap
        if gap is not None and event.purpose not in OTHER_RATES:
            self._gaps.append(gap)
            if self._least_gap is None or gap < self._least_gap:
                self._least_gap = gap

    def polled(self, reading: Reading, apart: float | None) -> None:
        """Count one poll and its failed attempts; `apart` is the time in s since the device's previous poll."""
        second = self._second(reading.at)
        second.polls += 1
        if apart is not None and apart > second.longest:
            second.longest = apart
        for code in reading.failed_attempts:
            self._failed(code)
        fault = reading.fault
        if fault is not None and not fault.busy:
            self._failed(fault.code)

    def overran(self, missed: int) -> None:
        """Count points of the grid that passed without a poll."""
        self.errors[FaultCode.OVERRUN.value] += missed

    def lost(self, code: FaultCode) -> None:
        """Count one loss of the port."""
        self.errors[code.value] += 1

    def retimed(self) -> None:
        """Forget the measured gaps: the line has another rate."""
        self._gaps.clear()
        self._least_gap = None

    def rates(self, now: float) -> Rates:
        """Return the figures of the last half minute, or since the start where that is less: at least 1 s."""
        oldest = floor(now) - WINDOW + 1
        span = min(now - oldest, now - self._started)
        polls, busy, longest = 0, 0.0, 0.0
        for second in self._seconds:
            if second.number >= oldest:
                polls += second.polls
                busy += second.busy
                longest = max(longest, second.longest)
        cycle = round(longest, 3) if longest > 0 else None
        if span < LEAST_SPAN:
            return Rates(None, None, cycle)
        return Rates(round(min(100.0, 100 * busy / span), 1), round(polls / span, 2), cycle)

    def payload(self, now: float, *, ts: int, gap_required: float, backlog: BacklogStats) -> dict[str, object]:
        """Return the object for `line/stats`."""
        uart = self.uart
        return {
            "v": VERSION,
            "ts": ts,
            **self.rates(now)._asdict(),
            "gap_required_us": scaled(gap_required, 1e6, 1),
            "gap_us": {
                "min": scaled(self._least_gap, 1e6, 1),
                "p50": scaled(percentile(self._gaps, 50), 1e6, 1),
                "p99": scaled(percentile(self._gaps, 99), 1e6, 1),
            },
            "exchanges": self.exchanges,
            "errors": dict(self.errors),
            "unsolicited_bytes": self.unsolicited,
            "uart": None
            if uart is None
            else {
                "framing": uart.framing,
                "parity": uart.parity,
                "overrun": uart.overrun,
                "break": uart.breaks,
            },
            "store": backlog._asdict(),
        }

    def _failed(self, code: FaultCode) -> None:
        if code is not FaultCode.LATE:  # counted by `exchanged`, answer by answer
            self.errors[code.value] += 1

    def _second(self, at: float) -> _Second:
        """Return the second of the time `at`; late events are counted in the newest."""
        seconds = self._seconds
        number = floor(at)
        if seconds and seconds[-1].number >= number:
            return seconds[-1]
        while seconds and seconds[0].number <= number - WINDOW:
            seconds.popleft()
        seconds.append(_Second(number))
        return seconds[-1]


class DeviceCounters:
    """The figures of one device; `response_timeout` in s, None until it is known, `request_gap` in s."""

    def __init__(self, response_timeout: float | None, request_gap: float = 0.0) -> None:
        self.response_timeout = response_timeout
        self.request_gap = request_gap
        self.polls = 0
        self.good = 0
        """Polls with a value, the `partial` ones too."""
        self.partial = 0
        self.errors: Counter[str] = Counter()
        self.last_good_ts: int | None = None
        self._rtts: deque[float] = deque(maxlen=RECENT_RTTS)
        self._last_poll: float | None = None

    def polled(self, reading: Reading, ts: int) -> float | None:
        """Count one reading; return the time in s since the previous poll, None if there is none.

        Probes stand apart: their distance is the device's illness, not the line's pace.
        """
        self.response_timeout = reading.response_timeout
        self.request_gap = reading.request_gap
        if reading.overruns:
            self.errors[FaultCode.OVERRUN.value] += reading.overruns
        fault = reading.fault
        if fault is None:
            self.good += 1
            self.last_good_ts = ts
            if reading.value_errors:
                self.partial += 1
            if reading.rtt is not None:
                self._rtts.append(reading.rtt)
        elif not fault.busy:
            self.errors[fault.code.value] += 1
        if fault is not None and fault.code in PORT_CODES:
            self._last_poll = None
            return None
        self.polls += 1
        before = self._last_poll
        self._last_poll = None if reading.probe else reading.at
        return None if before is None or reading.probe else reading.at - before

    def payload(self, ts: int) -> dict[str, object]:
        """Return the object for `device/<name>/stats`."""
        return {
            "v": VERSION,
            "ts": ts,
            "polls": self.polls,
            "good": self.good,
            "partial": self.partial,
            "errors": dict(self.errors),
            "rtt_ms": {
                "p50": scaled(percentile(self._rtts, 50), 1e3, 1),
                "p95": scaled(percentile(self._rtts, 95), 1e3, 1),
            },
            "response_timeout_ms": scaled(self.response_timeout, 1e3, 1),
            "request_gap_ms": scaled(self.request_gap, 1e3, 1),
            "last_good_ts": self.last_good_ts,
        }
