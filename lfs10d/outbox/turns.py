"""The order in which the classes of messages are sent when the window is full, by weight. Pure.

Stride scheduling: with each message a class advances by 1 / weight, and the least advanced class goes next; of equals
the first. A class that had nothing to send begins level with the class that went last: it has saved up no turns and
owes none. So a class of weight w that waits gets at least every n-th message, where n is the sum of all weights
divided by w, rounded up, plus one for each other class.
"""

from __future__ import annotations

from collections.abc import Sequence

CHANGES, MESSAGES, LIVE, HISTORY, REFRESHES, TRACES, CLEARINGS = range(7)
"""The classes of the outbox."""

FIRST_CLASSES = HISTORY
"""Classes below this go first while the window has room for all."""

WEIGHT = 8
REFRESH_WEIGHT = 4
LEAST_WEIGHT = 1
"""Weights: of the first four classes, of refreshes, and of the rest."""


def weight(number: int, *, bursting: bool, level: int) -> int:
    """Return the weight of a class; `level` is that of `Drain`.

    What is left of a burst has as much as samples and history together.
    """
    if number == CHANGES:
        return 2 * WEIGHT if bursting else WEIGHT
    if number == HISTORY:
        return WEIGHT if bursting else WEIGHT * level
    if number in (MESSAGES, LIVE):
        return WEIGHT
    return REFRESH_WEIGHT if number == REFRESHES else LEAST_WEIGHT


class Turns:
    """The turns of `classes` classes, numbered from 0."""

    def __init__(self, classes: int) -> None:
        self._advanced = [0.0] * classes
        self._level = 0.0  # where the class stood that went last

    def order(self, waiting: Sequence[int], *, first: int | None = None) -> Sequence[int]:
        """Return the classes `waiting` in the order in which they may send: the first that has a message goes.

        The others have nothing to send. `first`: the classes below this number go before the others now.
        """
        for number, advanced in enumerate(self._advanced):
            if advanced < self._level and number not in waiting:
                self._advanced[number] = self._level
        if len(waiting) < 2:  # noqa: PLR2004 - nothing to compare
            return waiting
        if first is None:
            return sorted(waiting, key=self._advanced.__getitem__)
        return sorted(waiting, key=lambda number: (number >= first, self._advanced[number]))

    def passed(self, number: int) -> None:
        """Note that this class had its turn and nothing to send after all."""
        self._advanced[number] = max(self._advanced[number], self._level)

    def went(self, number: int, weight: float) -> None:
        """Note that a message of this class goes, at this weight."""
        self._level = max(self._level, self._advanced[number])
        self._advanced[number] = self._level + 1.0 / weight
