"""The soak's line: eight ailing sensors on a pseudo terminal, and everything they sent, for the oracle."""

from __future__ import annotations

import os
import threading
from collections.abc import Iterable, Mapping, Sequence
from itertools import islice
from pathlib import Path

from lfs10d.simulator.builder import LinePlan, build
from lfs10d.simulator.burst import MASTER
from lfs10d.simulator.faults import FaultKind
from lfs10d.simulator.judge import HeardRequest
from lfs10d.simulator.line import SimulatedLine
from lfs10d.simulator.line_faults import stray
from lfs10d.simulator.pty import PtyLine
from lfs10d.simulator.sensor import Sensor
from lfs10d.simulator.wire import SECOND, Format
from soak.attestation import epoch_of
from soak.oracle import Numbered, Sent, number_of
from tests.support.faulty_sensors import add_fault, believable

BAUDRATE = 19200
SLAVES = range(1, 9)
SETTLED_AFTER = 2 * SECOND
"""The longest delay of an answer, and some more: what was asked before that is over, struck or not (ns)."""

PROMPT = SECOND // 25
"""An answer begun within that of its request is waited for: the shortest time-out is 50 ms (contract, section 1)."""

PATIENCE = 5.0


def ail(line: SimulatedLine) -> None:
    """Give each sensor but the first what ails it, and the line its stray bytes."""
    add_fault(line.sensor(2), FaultKind.NOISY, 0.03)
    add_fault(line.sensor(2), FaultKind.GARBAGE, 0.01)
    add_fault(line.sensor(3), FaultKind.LATE, 0.01, delay=0.6)
    add_fault(line.sensor(3), FaultKind.LATE, 0.01, delay=0.15)
    add_fault(line.sensor(4), FaultKind.SILENT, first=20.0, last=26.0, every=60.0)
    for kind in (FaultKind.NAN, FaultKind.INFINITE, FaultKind.OUT_OF_RANGE, FaultKind.SUBNORMAL):
        add_fault(line.sensor(5), kind, 0.01)
    for kind in (FaultKind.TRUNCATED, FaultKind.LEADING_NOISE, FaultKind.TRAILING_NOISE):
        add_fault(line.sensor(6), kind, 0.01)
    for kind in (FaultKind.WRONG_ID, FaultKind.WRONG_FUNCTION, FaultKind.EXCEPTION):
        add_fault(line.sensor(7), kind, 0.01)
    add_fault(line.sensor(8), FaultKind.SLOW_BYTES, 0.01)
    add_fault(line.sensor(8), FaultKind.SILENT, 0.02)
    stray(line, 0.005)


class Line:
    """The line at `link`; `pull` and `plug` its adapter, `answers` takes what was sent since the last call."""

    def __init__(self, link: Path, seed: int) -> None:
        simulated = build(LinePlan(SLAVES, Format(BAUDRATE), turnaround=0.003, jitter=0.002, seed=seed), keep_log=True)
        numbered = Numbered()
        for sensor in simulated.sensors:
            sensor.source = numbered
        ail(simulated)
        self._names: dict[Sensor, str] = {sensor: f"slave-{sensor.slave}" for sensor in simulated.sensors}
        self._served = PtyLine(simulated, link=link, realtime=True)
        self._blocking: tuple[int, int] | None = None
        self._in = False
        self.settled_until = 0.0
        """Epoch seconds: every answer that ended before is told of."""

    def plug(self) -> None:
        """Put the adapter in, as another terminal than before."""
        blocking = os.openpty()  # takes the number that has become free
        self._served.start()
        self._in = True
        if self._blocking is not None:
            for descriptor in self._blocking:
                os.close(descriptor)
        self._blocking = blocking

    def pull(self) -> None:
        """Pull the adapter: terminal and link go."""
        self._in = False
        self._served.stop()

    @property
    def terminal(self) -> str:
        """The terminal itself, /dev/pts/..."""
        return self._served.terminal

    def close(self) -> None:
        """End it; a second time does nothing."""
        self._in = False
        self._served.stop()
        for descriptor in self._blocking or ():
            os.close(descriptor)
        self._blocking = None

    def answers(self) -> list[Sent]:
        """Return the answers with a value whose fate is settled, in order; nothing while the adapter is out."""
        if not self._in:
            return []
        taken: list[list[HeardRequest]] = []
        settled = 0
        done = threading.Event()

        def take(line: SimulatedLine) -> None:
            nonlocal settled
            settled = line.now - SETTLED_AFTER
            count = next((n for n, one in enumerate(line.log) if one.ended > settled), len(line.log))
            # The first that stays tells whether the last that goes was answered before it.
            taken.extend((line.log[:count], line.log[count : count + 1]))
            del line.log[:count]
            done.set()

        self._served.tell(take)
        if not done.wait(PATIENCE):
            raise RuntimeError("the simulated line does not answer")
        origin = epoch_of(self._served.now)
        self.settled_until = origin + max(0, settled) / SECOND
        going, staying = taken
        return answers_of(going, going + staying, self._names, origin)


def answers_of(
    going: Iterable[HeardRequest], requests: Sequence[HeardRequest], names: Mapping[Sensor, str], origin: float
) -> list[Sent]:
    """Return the answers with a value to the first of the `requests`, those `going`; all are in order of time.

    `origin` is the line's time 0 in epoch seconds.
    """
    sent = []
    for place, request in enumerate(going):
        later = islice(requests, place + 1, None)
        following = next((one.begun for one in later if one.speaker is MASTER), None)
        for answer in request.answers:
            number = number_of(answer.values[0]) if answer.values else None
            if number is None:
                continue
            burst = answer.burst
            end = burst.ends[-1] if burst.ends else burst.start
            in_time = following is None or end <= following
            believed = request.speaker is MASTER and believable(answer) and in_time
            prompt = burst.start - request.ended <= PROMPT
            sent.append(Sent(number, names[answer.sensor], origin + end / SECOND, believed, prompt))
    return sent
