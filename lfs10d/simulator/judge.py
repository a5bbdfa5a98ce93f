"""The judge of the master: finds requests that begin too early or are torn, as a strict slave does.

Rules (Modbus over Serial Line V1.02, section 2.5.1.1; LFS10, DZB and EH600 manuals), for RTU:

- A request begins after at least t3.5 of silence since the last byte on the line, whoever sent that, and of the
  slower rate where the rate changed. Else it is not heard: a gap violation.
- No pause above t1.5 lies inside a request. Else it is not heard: a t1.5 violation.
- Nobody writes while another speaks: a collision.

In ASCII only the last holds; a colon begins a frame anew and CR LF ends it.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import field
from enum import StrEnum
from typing import Final

from lfs10d.simulator.burst import MASTER
from lfs10d.simulator.sensor import Reply
from lfs10d.simulator.wire import SECOND, Format, Framing, unseal
from lfs10d.system.dataclass import dataclass

ROUNDING: Final = 2
"""Nanoseconds by which two times may be off because a master's clock is a float and ours is whole."""

ASCII_PAUSE: Final = SECOND
"""The longest pause inside an ASCII frame (Modbus over Serial Line V1.02, section 2.5.2.1)."""

EXCESS_EDGES_US: Final = (0, 20, 50, 100, 200, 500, 1000, 2000, 5000, 10000, 50000)
"""Upper edges of the histogram: by how much a gap exceeded what it had to be."""


class JudgeReport(StrEnum):
    """The verdict on a request."""

    HEARD = "heard"
    GAP = "gap"
    """Begun too early."""
    TORN = "torn"
    """A pause above t1.5 inside."""
    COLLISION = "collision"
    """Written while another was speaking."""
    STRUCK = "struck"
    """Another began to speak into it."""
    MALFORMED = "malformed"
    """No frame at all, or its check is wrong."""


FIGURES: Final[Mapping[str, JudgeReport]] = {
    "gap_violations": JudgeReport.GAP,
    "t15_violations": JudgeReport.TORN,
    "collisions": JudgeReport.COLLISION,
    "struck": JudgeReport.STRUCK,
    "malformed": JudgeReport.MALFORMED,
}
"""The verdicts of requests that were not heard, as the summary names them."""


@dataclass(slots=True)
class HeardRequest:
    """One request as it was on the line, as far as it has come, and what was sent in answer: the oracle of a test."""

    format: Format
    begun: int
    ended: int
    frame: bytes
    gap: int | None
    """Silence before it; None if nothing was ever sent before."""
    verdict: JudgeReport | None = None
    """None: nothing against it yet."""
    speaker: str = MASTER
    body: bytes = b""
    """Without the check; empty if it was not heard."""
    answers: list[Reply] = field(default_factory=list)


@dataclass(slots=True)
class Judge:
    """Hears every byte of the master with its time; counts. All gaps are nanoseconds."""

    framing: Framing = "rtu"
    counts: Counter[str] = field(default_factory=Counter)
    """Requests by their verdict."""
    min_gap: int | None = None
    min_excess: int | None = None
    """The smallest gap less what it had to be; negative is a violation."""
    histogram: list[int] = field(default_factory=lambda: [0] * (len(EXCESS_EDGES_US) + 1))
    _open: HeardRequest | None = None
    _torn_off: bytes = b""

    def listen(
        self, data: bytes, start: int, shape: Format, *, quiet_since: int | None, slower: Format, busy: bool
    ) -> HeardRequest:
        """Hear bytes that begin at `start` and follow each other; return the request they belong to.

        `quiet_since` is the end of the last byte on the line before (None: there was none), `slower` the format
        whose t3.5 has to pass, `busy` whether another speaks right now. Ask `settle` at the end of the bytes.
        """
        ended = start + shape.span(len(data))
        hearing = self._open
        if hearing is not None and start - hearing.ended > self._longest_silence(shape):
            self._close(hearing)
            hearing = None
        if hearing is None:
            gap = None if quiet_since is None else start - quiet_since
            hearing = self._open = HeardRequest(shape, start, ended, data, gap)
            if not busy:
                self._measure(hearing, slower)
        else:
            if self.framing == "rtu" and self._complete(hearing.frame):
                hearing.verdict = hearing.verdict or JudgeReport.GAP  # a second request on the heels of the first
            elif self.framing == "rtu" and start - hearing.ended > shape.t15 + ROUNDING:
                hearing.verdict = hearing.verdict or JudgeReport.TORN
            hearing.frame += data
            hearing.ended = ended
        if busy:
            hearing.verdict = hearing.verdict or JudgeReport.COLLISION
        return hearing

    def settle(self, hearing: HeardRequest, *, struck: bool) -> JudgeReport | None:
        """Decide at its end whether a request was heard; None while it is incomplete and may go on.

        `struck`: another's bytes fell into it.
        """
        if hearing is not self._open:
            return None
        if struck:
            hearing.verdict = hearing.verdict or JudgeReport.STRUCK
        if not self._complete(hearing.frame):
            return None
        return self._count(hearing, hearing.verdict or JudgeReport.HEARD)

    def patience(self, hearing: HeardRequest) -> int:
        """Return until when an incomplete request may still go on."""
        return hearing.ended + self._longest_silence(hearing.format) + 1

    def expire(self, hearing: HeardRequest, now: int) -> JudgeReport | None:
        """End a request that was not completed in time; None if it has ended or went on since."""
        if hearing is not self._open or now < self.patience(hearing):
            return None
        return self._close(hearing)

    def _close(self, hearing: HeardRequest) -> JudgeReport:
        torn = hearing.verdict is None and self._complete(self._torn_off + hearing.frame)
        return self._count(hearing, hearing.verdict or (JudgeReport.TORN if torn else JudgeReport.MALFORMED))

    def summary(self) -> dict[str, object]:
        """Return every count, ready for JSON; gaps in microseconds."""
        edges = [*(f"<{edge}" for edge in EXCESS_EDGES_US), f">={EXCESS_EDGES_US[-1]}"]
        return {
            "requests": self.counts.total(),
            "heard": self.counts[JudgeReport.HEARD],
            "unheard": self.counts.total() - self.counts[JudgeReport.HEARD],
            **{name: self.counts[verdict] for name, verdict in FIGURES.items()},
            "min_gap_us": None if self.min_gap is None else self.min_gap / 1000,
            "min_excess_us": None if self.min_excess is None else self.min_excess / 1000,
            "excess_us": dict(zip(edges, self.histogram, strict=True)),
        }

    def _longest_silence(self, shape: Format) -> int:
        """Return the pause after which what follows is another request."""
        return shape.t35 - ROUNDING - 1 if self.framing == "rtu" else ASCII_PAUSE

    def _measure(self, hearing: HeardRequest, slower: Format) -> None:
        if hearing.gap is None:
            return
        excess = hearing.gap - slower.t35
        self.min_gap = hearing.gap if self.min_gap is None else min(self.min_gap, hearing.gap)
        self.min_excess = excess if self.min_excess is None else min(self.min_excess, excess)
        if -ROUNDING <= excess < 0:
            excess = 0
        place = sum(excess >= 1000 * edge for edge in EXCESS_EDGES_US)
        self.histogram[place] += 1
        if excess < 0 and self.framing == "rtu":
            hearing.verdict = JudgeReport.GAP

    def _complete(self, frame: bytes) -> bool:
        return any(unseal(frame, self.framing, check) is not None for check in ("crc", "sum"))

    def _count(self, hearing: HeardRequest, verdict: JudgeReport) -> JudgeReport:
        self._open = None
        self._torn_off = hearing.frame if verdict is JudgeReport.MALFORMED else b""
        hearing.verdict = verdict
        self.counts[verdict] += 1
        return verdict
