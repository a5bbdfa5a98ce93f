"""A request to put on the line, and the state of the line that its exchange must know. Plain values."""

from __future__ import annotations

from lfs10d.modbus.echo import Echo
from lfs10d.modbus.frames import Codec
from lfs10d.modbus.request import Request
from lfs10d.modbus.timing import LineTiming
from lfs10d.system.dataclass import dataclass


@dataclass(frozen=True, slots=True)
class Ask:
    """Put this request on the line now.

    `timeout` (s) runs from the request's last bit to the answer's first byte; `patience` is the slave's learned
    p99 of it, None where it is not known. `baudrate` None means the line's own rate. `at_once`: nobody else is asked
    between the job's exchange before and this one, so that what comes late is received here. `request_gap` (s) is the
    rest that the slave needs by what the job knows of it; the scheduler keeps what it knows itself in any case.
    """

    request: Request
    codec: Codec
    timeout: float
    patience: float | None = None
    baudrate: int | None = None
    at_once: bool = False
    request_gap: float = 0.0


@dataclass(frozen=True, slots=True)
class LineContext:
    """The state of the line that every exchange needs. Durations are seconds.

    `adapter_latency` is the longest pause that the adapter may put into one answer. `broadcast_delay` is the silence
    after a broadcast. `gap` is the required silence where it is longer than the timing's (a change of rate).
    `echo_proved`: that the adapter has no echo was observed, not only configured. `paced`: the port is a real wire, on
    which nothing arrives sooner than the rate allows (not so on a pseudo terminal or behind a network bridge).
    """

    timing: LineTiming
    echo: Echo
    adapter_latency: float
    broadcast_delay: float = 0.1
    gap: float | None = None
    paced: bool = False
    echo_proved: bool = False
