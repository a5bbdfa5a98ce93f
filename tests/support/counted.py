"""Exchanges and readings for the counters."""

from __future__ import annotations

from lfs10d.reading import Exchanged, Fault, FaultCode, Purpose, Reading

START = 1000.0
TIMEOUT = Fault(FaultCode.TIMEOUT, "")
BUSY = Fault(FaultCode.EXCEPTION, "busy", exception_code=6, busy=True)


def exchange(
    at: float,
    *,
    took: float = 0.03,
    gap: float | None = 0.004,
    purpose: Purpose = Purpose.POLL,
    unsolicited: int = 0,
    late: int = 0,
) -> Exchanged:
    return Exchanged(
        at=at,
        asked=at - took,
        began=at - took,
        gap=gap,
        slave=1,
        purpose=purpose,
        fault=None,
        sent=b"",
        heard=b"",
        unsolicited=unsolicited,
        late=late,
    )


def reading(
    at: float,
    fault: Fault | None = None,
    *,
    rtt: float | None = 0.02,
    probe: bool = False,
    failed: tuple[FaultCode, ...] = (),
    overruns: int = 0,
) -> Reading:
    return Reading(
        device="a",
        at=at,
        values={"wind_speed": 1.0} if fault is None else None,
        fault=fault,
        rtt=rtt if fault is None else None,
        online=True,
        response_timeout=0.2,
        probe=probe,
        failed_attempts=failed,
        overruns=overruns,
    )
