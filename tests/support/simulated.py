"""The simulator's line at the wire."""

from __future__ import annotations

from dataclasses import dataclass

from lfs10d.simulator.judge import Judge, JudgeReport
from lfs10d.simulator.line import SimulatedLine
from lfs10d.simulator.sensor import Reply
from lfs10d.simulator.wire import Framing, seal, unseal
from tests.support.virtual_port import SimulatedPort, VirtualClock

READ, WRITE = 3, 6


WIND, RATE, ID = 1, 4, 5
"""Registers of an LFS10."""


def violations(judge: Judge) -> int:
    """Return how often the master spoke too early, paused within a request, or spoke into another."""
    return sum(judge.counts[verdict] for verdict in (JudgeReport.GAP, JudgeReport.TORN, JudgeReport.COLLISION))


@dataclass
class Bench:
    """A master that asks one thing at a time and listens for a while."""

    line: SimulatedLine
    port: SimulatedPort
    clock: VirtualClock
    framing: Framing = "rtu"
    heard: bytes = b""

    def listen(self, seconds: float) -> bytes:
        """Let time pass and return what arrived."""
        self.clock.now += seconds
        self.heard = self.port.read()
        return self.heard

    def exchange(self, body: bytes, *, wait: float = 0.2) -> bytes | None:
        """Ask and return the body of what came back, None if that is no frame."""
        self.port.write(seal(body, self.framing))
        return unseal(self.listen(wait), self.framing)

    def read(self, slave: int, register: int = WIND, count: int = 2, *, wait: float = 0.2) -> bytes | None:
        """Read holding registers; return the answer's body."""
        body = bytes((slave, READ)) + register.to_bytes(2, "big") + count.to_bytes(2, "big")
        return self.exchange(body, wait=wait)

    def write(self, slave: int, register: int, value: int) -> bytes | None:
        """Write one register; return the answer's body."""
        return self.exchange(bytes((slave, WRITE)) + register.to_bytes(2, "big") + value.to_bytes(2, "big"))

    def id_of(self, slave: int) -> int | None:
        """Return what the id register of that slave reads, None if it does not answer."""
        body = self.read(slave, ID, 1)
        return None if body is None else int.from_bytes(body[3:], "big")

    def reach(self, seconds: float) -> None:
        """Let the clock reach that time."""
        self.clock.now = max(self.clock.now, seconds)

    @property
    def answer(self) -> Reply:
        """The last answer that a sensor sent."""
        return self.line.log[-1].answers[-1]
