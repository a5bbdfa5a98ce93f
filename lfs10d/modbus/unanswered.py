"""Which requests may still be answered: the memory that keeps a late answer from passing for the next one.

Modbus RTU has no transaction id, and no waiting time proves that a late answer will not come. So a request that got
no answer stays here until its slave has answered something that can only be newer, for a slave answers in order.

Rules
-----
1. No answer, or bytes that do not begin as one: the slave is unsynchronised; its next exchange must be a *barrier*,
   a read of another shape than the one unanswered.
2. Any answer to the barrier, whole or begun as one, ends that: nothing older is pending.
3. An exception looks the same for every shape. While something older was pending it may be the older one's: then
   the slave stays unsynchronised and is left alone for twice its time-out, at least 1 s, after which it counts as
   synchronised. So does a slave whose profile has no second shape.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from lfs10d.modbus.exchange import Pending

if TYPE_CHECKING:
    from lfs10d.modbus.exchange import Outcome
    from lfs10d.modbus.frames import Codec, Request

QUIET_LEAST = 1.0
"""How long a slave is left alone where no barrier can tell, at least; in s."""


class Unanswered:
    """The unanswered requests of one line, by slave id."""

    def __init__(self) -> None:
        self._pending: dict[int, list[Pending]] = {}
        self._quiet_until: dict[int, float] = {}

    def earlier(self) -> tuple[Pending, ...]:
        """Return every request whose answer may still come, each slave's oldest first."""
        if not self._pending:
            return ()
        return tuple(pending for each in self._pending.values() for pending in each)

    def unsynchronised(self, slave: int, now: float) -> bool:
        """Whether an answer to an older request of `slave` may still come."""
        if slave not in self._pending:
            return False
        if now >= self._quiet_until.get(slave, now + 1):
            self.forget(slave)
            return False
        return True

    def quiet_until(self, slave: int) -> float | None:
        """Until when `slave` must be left alone (rule 3); None: a barrier may be asked now."""
        return self._quiet_until.get(slave)

    def leave_alone(self, slave: int, timeout: float) -> None:
        """Decide that no barrier helps for `slave`, whose time-out is `timeout` s: rule 3."""
        sent = max(pending.sent_end for pending in self._pending[slave])
        self._quiet_until[slave] = sent + max(2 * timeout, QUIET_LEAST)

    def forget(self, slave: int) -> None:
        """Count `slave` as synchronised."""
        self._pending.pop(slave, None)
        self._quiet_until.pop(slave, None)

    def settled(self, outcome: Outcome, codec: Codec, timeout: float) -> None:
        """Learn from an exchange that is over; `timeout` in s is the one it had."""
        slave = outcome.request.slave
        for late in outcome.late:
            self._answered(late.request)
        if outcome.sent_end is None or slave == 0:
            return
        if outcome.ambiguous:
            self._remember(outcome.request, codec, outcome.sent_end)
            self.leave_alone(slave, timeout)
        elif outcome.answer is not None or outcome.answered:
            self.forget(slave)
        else:
            self._remember(outcome.request, codec, outcome.sent_end)

    def _answered(self, request: Request) -> None:
        """Drop `request` and, since a slave answers in order, what its slave was asked before."""
        pending = self._pending.get(request.slave, [])
        requests = [each.request for each in pending]
        if request not in requests:
            return
        rest = pending[requests.index(request) + 1 :]
        if rest:
            self._pending[request.slave] = rest
        else:
            self.forget(request.slave)

    def _remember(self, request: Request, codec: Codec, sent_end: float) -> None:
        """Keep the newest of equal requests: a slave that answers it has answered those before."""
        pending = [each for each in self._pending.get(request.slave, []) if each.request != request]
        self._pending[request.slave] = [*pending, Pending(request, codec, sent_end)]
