"""A slave whose exchanges are told one by one to those who doubt answers: by when each began, and what it was like."""

from __future__ import annotations

from dataclasses import replace

from lfs10d.line.device import CONFIDENT_FROM, ResponseTimes
from lfs10d.line.doubtful_answers import DoubtfulAnswers
from lfs10d.modbus.duplicates import Duplicates
from lfs10d.modbus.outcome import Outcome
from lfs10d.modbus.request import ReadRegisters, Request
from lfs10d.reading import Fault, FaultCode
from tests.support.outcomes import ended

WIND = ReadRegisters(1, 1, 2)
WHO = ReadRegisters(1, 5, 1)
SENT = bytes((1, 3, 0, 1, 0, 2, 0x95, 0xCB))
USUAL = 0.02
TOOK = 0.038
"""Request 8 ms, turnaround 20 ms, answer 10 ms."""


class Line:
    """A slave that always took 20 ms; each exchange is told by its begin."""

    def __init__(self, learned: int = CONFIDENT_FROM) -> None:
        self.duplicates = Duplicates()
        self.doubts = DoubtfulAnswers(self.duplicates)
        self.usual = ResponseTimes()
        self._long_ago = -1000.0
        for _ in range(learned):
            self.learn(USUAL)

    def learn(self, turnaround: float) -> None:
        """Have it answer once, long ago."""
        self._long_ago += 2.0
        self.ask(self._long_ago, turnaround)
        self.usual.learn(turnaround)

    def ask(
        self,
        began: float,
        turnaround: float = USUAL,
        *,
        code: FaultCode | None = None,
        beside: bytes = b"",
        timeout: float = 0.1,
        explained: bool = False,
        tardy: bool = False,
        request: Request = WIND,
    ) -> bool:
        """Tell of an exchange with these bytes `beside` an answer or in place of it; whether that is doubtful."""
        outcome: Outcome = ended(
            request,
            asked=began,
            began=began,
            sent_end=began + 0.008,
            turnaround=None if code else turnaround,
            ended=began + 0.018 + turnaround,
            answer=None if code else (1, 2),
            fault=Fault(code, "failed") if code else None,
            heard=b"" if code is FaultCode.TIMEOUT else b"x",
            unsolicited=len(beside),
            strays=((beside, began + 0.02),) if beside else (),
            sent=SENT,
        )
        return self.doubts.exchanged(outcome, self.usual, timeout, tardy=tardy, explained=explained)

    def refuse(self, began: float, exception: int = 2) -> bool:
        """Tell of an exchange that ended with an exception."""
        fault = Fault(FaultCode.EXCEPTION, "refused", exception)
        refused = ended(WIND, fault=fault, asked=began, began=began, sent_end=began + 0.008, ended=began + 0.03)
        return self.doubts.exchanged(replace(refused, answered=True, heard=b"x"), self.usual, 0.1)

    def twice(self, at: float) -> None:
        """Let two second answers be known, each 50 ms after its answer."""
        for n in range(2):
            self.duplicates.answered(1, at + 0.1 * n)
            self.duplicates.second(1, at + 0.1 * n + 0.05)

    def alone_until(self, now: float) -> float | None:
        """Return until when the slave is left alone."""
        return self.duplicates.rests_until(1, now)


def jittery() -> Line:
    """Return one that took 20 to 69 ms, and answered at 1 s."""
    line = Line(0)
    for n in range(50):
        line.learn(0.02 + 0.001 * n)
    line.ask(1.0)
    return line
