"""Requests that are still unanswered, and what happens to them."""

from __future__ import annotations

from dataclasses import replace

from lfs10d.modbus.frames import Codec, Framing
from lfs10d.modbus.outcome import LateAnswer
from lfs10d.modbus.pending import PendingRequests
from lfs10d.modbus.request import ReadRegisters, Request
from lfs10d.reading import Fault, FaultCode
from tests.support.outcomes import ended

RTU = Codec(Framing.RTU)
WIND, WHO = ReadRegisters(1, 0x0001, 2), ReadRegisters(1, 0x0005, 1)
PLAIN = ended(WIND, fault=Fault(FaultCode.TIMEOUT, "no answer"))


class Line:
    """An `PendingRequests` and what happens on its line."""

    def __init__(self) -> None:
        self.pending = PendingRequests()

    def silent(self, request: Request, at: float, code: FaultCode = FaultCode.TIMEOUT, *late: Request) -> None:
        self._settle(request, at, fault=Fault(code, ""), late=late)

    def answered(self, request: Request, at: float, *late: Request) -> None:
        self._settle(request, at, answer=(7,), fault=None, answered=True, late=late)

    def begun(self, request: Request, at: float) -> None:
        self._settle(request, at, fault=Fault(FaultCode.CRC, ""), answered=True)

    def refused(self, request: Request, at: float, *, ambiguous: bool) -> None:
        self._settle(request, at, fault=Fault(FaultCode.EXCEPTION, "", 2), answered=True, ambiguous=ambiguous)

    def _settle(
        self,
        request: Request,
        at: float,
        *,
        late: tuple[Request, ...] = (),
        answer: tuple[int, ...] | None = None,
        fault: Fault | None,
        answered: bool = False,
        ambiguous: bool = False,
    ) -> None:
        told = tuple(LateAnswer(each, 0.3) for each in late)
        outcome = replace(
            PLAIN,
            request=request,
            sent_end=at,
            late=told,
            answer=answer,
            fault=fault,
            answered=answered,
            ambiguous=ambiguous,
        )
        self.pending.on_outcome(outcome, RTU, 0.2, at + 0.2)

    def waiting(self, slave: int = 1) -> list[Request]:
        return [each.request for each in self.pending.earlier(slave)]

    def free(self, request: Request, now: float) -> bool:
        """Whether a value may be asked now."""
        if self.pending.left_alone_until(request.slave, now) is not None:
            return False
        if self.pending.confusable(request, RTU):
            return False
        return self.pending.lingering_until(request, RTU, now) is None
