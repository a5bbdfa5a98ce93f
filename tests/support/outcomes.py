"""Outcomes of exchanges, for tests of what receives them: usual ones, in which a test replaces what it needs."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from lfs10d.modbus.outcome import Outcome
from lfs10d.modbus.request import Request


def ended(request: Request, **facts: Any) -> Outcome:  # noqa: ANN401  # passed on to a dataclass, which checks names
    """Return an exchange begun at 0 s and over at 0.2 s in which nobody was heard, but for these `facts`."""
    silent = Outcome(
        request=request,
        answer=None,
        fault=None,
        asked=0.0,
        began=0.0,
        sent_end=0.0,
        gap=0.01,
        ended=0.2,
        turnaround=None,
        rtt=None,
        answered=False,
        late=(),
        echoed=None,
        sent=b"",
        heard=b"",
        unsolicited=0,
        quiet_since=0.0,
    )
    return replace(silent, **facts)
