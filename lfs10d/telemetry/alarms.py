"""The errors of devices and the line: when they become active, and when they are cleared.

Rules
-----
1. A device's error rises after `rise_after` failed polls in a row, whatever their codes; `config_conflict`,
   a fact and no accident of the line, rises at once.
2. While it is active a failed poll with another code changes it: the newest code is shown, the run's others
   are listed in `also`.
3. One good poll ends the run and clears the error. So does what masks it: a lost port, or disabling.
   Afterwards it rises by rule 1 again.
4. `duplicate_id` is of no poll: it rises and clears by what is heard besides the answers (`stands`), whatever the
   polls say. While polls fail it is listed in `also`.
5. An error of the line rises at once. Of several the one that explains the others is shown.

Each change says whether the error object must be published. Times are epoch milliseconds.
"""

from __future__ import annotations

from dataclasses import field
from typing import Final, get_args

from lfs10d.reading import PORT_CODES, Fault, FaultCode, LineFaultCode
from lfs10d.system.dataclass import dataclass
from lfs10d.telemetry.publication import VERSION

HEARD_LIMIT = 32
"""Bytes of `heard`: the last ones received."""

AT_ONCE = frozenset({FaultCode.CONFIG_CONFLICT})

PRECEDENCE: Final[tuple[LineFaultCode, ...]] = get_args(LineFaultCode)
"""Errors of the line; while several are active the first of these is shown."""


@dataclass(slots=True)
class _Run:
    """Failures in a row: the newest fault, all codes in order of appearance."""

    fault: Fault
    since: int
    last: int
    count: int = 1
    codes: dict[FaultCode, None] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.codes[self.fault.code] = None

    def again(self, fault: Fault, ts: int) -> None:
        self.fault = fault
        self.last = ts
        self.count += 1
        self.codes[fault.code] = None

    def payload(self, also: list[str]) -> dict[str, object]:
        return {
            "v": VERSION,
            "active": True,
            "code": self.fault.code.value,
            "also": also,
            "message": self.fault.message,
            "exception_code": self.fault.exception_code,
            "heard": self.fault.heard[-HEARD_LIMIT:].hex(" ").upper(),
            "since": self.since,
            "last": self.last,
            "count": self.count,
        }


def _inactive(last_code: FaultCode | None, cleared: int | None) -> dict[str, object]:
    return {
        "v": VERSION,
        "active": False,
        "code": None,
        "last_code": None if last_code is None else last_code.value,
        "cleared": cleared,
    }


class DeviceAlarm:
    """The error of one device; `rise_after` may be changed at any time and holds from the next failure on."""

    def __init__(self, rise_after: int) -> None:
        self.rise_after = rise_after
        self.active = False
        """An error of the polls is active."""
        self._run: _Run | None = None
        self._lasting: _Run | None = None
        self._inactive = _inactive(None, None)

    def failed(self, fault: Fault, ts: int) -> bool:
        """Count one failed poll; return whether the error became active or changed its code."""
        run = self._run
        if run is None:
            run = self._run = _Run(fault, ts, ts)
            changed = False
        else:
            changed = fault.code != run.fault.code
            run.again(fault, ts)
        if self.active:
            return changed
        self.active = run.count >= self.rise_after or fault.code in AT_ONCE
        return self.active

    def ended(self, ts: int) -> bool:
        """End the run of failures, after a good poll or while masked; return whether an error was cleared."""
        run, self._run = self._run, None
        if run is None or not self.active:
            return False
        self.active = False
        self._inactive = _inactive(run.fault.code, ts)
        return True

    def set_lasting(self, fault: Fault | None, ts: int) -> bool:
        """Set an error that no poll raises or clears (None: it is over); return whether that is a change."""
        before = self._lasting
        if fault is None:
            self._lasting = None
            if before is not None and not self.active:
                self._inactive = _inactive(before.fault.code, ts)
        elif before is None:
            self._lasting = _Run(fault, ts, ts)
        return (before is None) is not (self._lasting is None)

    def payload(self) -> dict[str, object]:
        """Return the error object."""
        run, lasting = self._run if self.active else None, self._lasting
        if run is not None:
            codes = [code.value for code in run.codes if code != run.fault.code]
            return run.payload(codes if lasting is None else [*codes, lasting.fault.code.value])
        if lasting is not None:
            return lasting.payload([])
        return self._inactive


class LineAlarm:
    """The error of the line: the most important of the active ones."""

    def __init__(self) -> None:
        self._runs: dict[FaultCode, _Run] = {}
        self._inactive = _inactive(None, None)

    @property
    def _shown(self) -> _Run | None:
        return next((self._runs[code] for code in PRECEDENCE if code in self._runs), None)

    def failed(self, code: LineFaultCode, message: str, ts: int) -> bool:
        """Raise an error, or count it once more; return whether the shown error changed.

        The port has one fault at a time.
        """
        before = self._face()
        fault = Fault(code, message)
        if code in PORT_CODES:
            for other in PORT_CODES - {code}:
                self._runs.pop(other, None)
        run = self._runs.get(code)
        if run is None:
            self._runs[code] = _Run(fault, ts, ts)
        else:
            run.again(fault, ts)
        return self._face() != before

    def ended(self, codes: frozenset[FaultCode], ts: int) -> bool:
        """Clear the active ones of `codes`; return whether the shown error changed."""
        shown = self._shown
        for code in codes:
            self._runs.pop(code, None)
        if shown is self._shown or shown is None:
            return False
        self._inactive = _inactive(shown.fault.code, ts)
        return True

    def payload(self) -> dict[str, object]:
        """Return the error object; `also` lists the other active codes."""
        shown = self._shown
        if shown is None:
            return self._inactive
        others = [code.value for code in PRECEDENCE if code in self._runs and code != shown.fault.code]
        return shown.payload(others)

    def _face(self) -> tuple[FaultCode, str] | None:
        shown = self._shown
        return None if shown is None else (shown.fault.code, shown.fault.message)
