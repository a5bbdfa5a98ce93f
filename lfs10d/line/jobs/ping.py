"""A ping: one slave id that is not polled is asked a few times, until it answers. Pure; it only reads."""

from __future__ import annotations

from collections.abc import Callable

from lfs10d.line.device import FIRST_TIMEOUTS
from lfs10d.line.jobs.identification import first_read, speaks
from lfs10d.line.jobs.job import Done, Next, Requeue
from lfs10d.modbus.ask import Ask
from lfs10d.modbus.frames import Codec
from lfs10d.modbus.outcome import Outcome
from lfs10d.profiles.profile import Profile
from lfs10d.reading import Fault, Purpose


class Ping:
    """Asks slave id `slave` as a device of `profile` is asked first, with the time-outs of a new device.

    Any right frame of the slave is an answer, an exception too. `over` is called once, with this job, when it is
    over: `answered`, or `fault` says what came instead; neither where the port is lost.
    """

    purpose = Purpose.REQUEST
    share = 1.0

    def __init__(self, slave: int, profile: Profile, codec: Codec, over: Callable[[Ping], None]) -> None:
        self.slave = slave
        self.excludes = frozenset({slave})
        self.answered = False
        self.fault: Fault | None = None
        self._request = first_read(profile, slave)
        self._codec = codec
        self._gap = profile.request_gap
        self._over = over
        self._asked = 0

    def ask(self, now: float) -> Ask:
        """Ask once more, longer than before."""
        del now
        return Ask(self._request, self._codec, FIRST_TIMEOUTS[self._asked], request_gap=self._gap)

    def on_outcome(self, outcome: Outcome, now: float) -> Next:
        """Take an outcome; silence and noise are asked again."""
        self._asked += 1
        self.answered = speaks(outcome, self._codec)
        # What was heard says more than the silence of the last attempt.
        if outcome.fault is not None and (self.fault is None or outcome.fault.heard):
            self.fault = outcome.fault
        if not self.answered and self._asked < len(FIRST_TIMEOUTS):
            return Requeue(now)
        self._over(self)
        return Done()

    def cut_off(self, now: float) -> None:
        """Note that the port is lost."""
        del now
        self.fault = None
        self._over(self)
