"""The pause that one slave needs between two exchanges, learned from requests that it ignores. Pure. Durations in s.

Rules
-----
1. Between the end of any exchange with a slave and its next request at least `seconds` pass: what the configuration
   says or what was learned, whichever is longer.
2. A slave that answers a request and is silent to the one right behind it, twice, needs more rest than it had: the
   gap becomes the next longer one of `STEPS`. Until it answers right behind an answer again, each further such
   silence widens the gap by one step; where even the longest does not help, rest was not the cause and none is kept.
3. Who answered a request that came as close, or nearly, needs no more rest: a line that loses answers by chance
   teaches nothing. That is forgotten when the device goes offline, for another sensor may come in its place.
4. A slave that loses the first request after a pause and answers the next one sleeps. After `HELPED` such times the
   first silence after a pause that long is no failure; after three answers to first requests it is awake again.
"""

from __future__ import annotations

from math import inf

STEPS = (0.1, 0.2, 0.4, 0.8, 1.0)
"""The learned gaps in s: from 100 ms, doubled, to 1 s."""
IGNORED = 2
"""Ignored requests right after an answer before a gap is learned."""
NEARLY = 0.7
"""A silence says nothing where an answer came after a pause that was at most this much longer (1 / NEARLY)."""
NEAR = 2.0
"""An answer after at most this many learned gaps proves that the gap is long enough."""
PAUSE = 0.25
"""The shortest pause in s after which a slave may be asleep."""
LONG_PAUSE = 1.0
"""A slave that sleeps does so after this pause in s at the latest, as far as is known."""
HELPED = 2
"""Successful immediate retries before the first silence after a pause is no failure."""
AWAKE = 3
"""Answered first requests after a pause that show that the slave does not sleep."""


class RequestGap:
    """The gap of one slave at the line's own rate. `configured` is the gap of profile and configuration."""

    __slots__ = (
        "_awake", "_closest", "_ended", "_helped", "_ignored", "_in_vain", "_lost_after", "_sleeps_after", "_spoke",
        "_widening", "configured", "learned",
    )  # fmt: skip

    def __init__(self, configured: float = 0.0) -> None:
        self.configured = configured
        self.learned = 0.0
        self._ended = -inf
        self._spoke = False
        self._closest = inf
        self._ignored = 0
        self._widening = False
        self._in_vain = False
        self._lost_after: float | None = None
        self._sleeps_after = inf
        self._helped = 0
        self._awake = 0

    @property
    def seconds(self) -> float:
        """The rest to keep."""
        return max(self.configured, self.learned)

    def exchanged(self, began: float, ended: float, *, spoke: bool, silent: bool) -> bool:
        """Learn from an exchange from `began` (its first bit) to `ended`; return whether the gap grew.

        `spoke`: bytes came that begin as an answer. `silent`: nothing was heard. Neither: noise, which teaches nothing.
        """
        apart, behind_answer = began - self._ended, self._spoke
        self._ended, self._spoke = ended, spoke
        if silent or self._helped or self._lost_after is not None:
            self._watch_sleep(apart, spoke=spoke, silent=silent)
        if not behind_answer:
            return False
        if not spoke:
            return silent and self._silent(apart)
        self._closest = min(self._closest, apart)
        if (self._ignored or self._widening) and apart <= max(STEPS[0], NEAR * self.learned):
            self._ignored = 0
            self._widening = False
        return False

    def _silent(self, apart: float) -> bool:
        if self._in_vain or apart >= self._closest * (1.0 if self._widening else NEARLY):
            return False
        if self.may_sleep_after(apart):
            return False
        longer = next((step for step in STEPS if step > max(apart, self.seconds)), None)
        if self._widening and longer is None:
            self._in_vain, self._widening, self.learned = True, False, 0.0
            return False
        if longer is None:
            return False
        self._ignored += 1
        if self._ignored < IGNORED and not self._widening:
            return False
        self.learned, self._widening = longer, True
        return True

    def late(self) -> None:
        """Note an answer after its time: the slave is slow, and was not silent."""
        self._ignored = 0
        self._lost_after = None
        if self._widening:
            self.learned, self._widening = 0.0, False

    def offline(self) -> None:
        """Note that the device is offline: what comes back may be another sensor."""
        self._closest = inf

    # -- sleep

    def _watch_sleep(self, apart: float, *, spoke: bool, silent: bool) -> None:
        lost_after, self._lost_after = self._lost_after, None
        if silent:
            if lost_after is not None:
                self._helped = 0
            elif apart >= PAUSE:
                self._lost_after = min(apart, LONG_PAUSE)
        elif spoke and lost_after is not None and apart < lost_after:
            self._sleeps_after = lost_after if self._helped == 0 else min(self._sleeps_after, lost_after)
            self._helped = min(self._helped + 1, HELPED)
            self._awake = 0
        elif spoke and self._helped and apart >= self._sleeps_after:
            self._awake += 1
            if self._helped < HELPED or self._awake >= AWAKE:
                self._helped = self._awake = 0

    def may_sleep(self, now: float) -> bool:
        """Whether a request at `now` may be lost to sleep, and an immediate retry has helped before."""
        return self.may_sleep_after(now - self._ended)

    def may_sleep_after(self, pause: float) -> bool:
        """Whether the first request after such a pause in s may be lost to sleep."""
        return self._helped > 0 and pause >= NEARLY * self._sleeps_after

    @property
    def sleeps(self) -> bool:
        """Asking again at once has helped often enough: the first silence after a pause is no failure."""
        return self._helped >= HELPED
