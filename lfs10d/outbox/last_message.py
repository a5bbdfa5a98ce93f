"""The last message before a clean disconnect. Pure."""

from __future__ import annotations

from lfs10d.outbox.in_flight import InFlight
from lfs10d.outbox.items import OutboxItem, Retained


class LastMessage:
    """`item` is sent as soon as the window has room, and nothing else from then on."""

    def __init__(self, item: Retained) -> None:
        self.item = item
        self.sent = False
        self.over = False
        """The broker has answered it."""

    def next(self, in_flight: InFlight, now: float) -> Retained | None:
        """Take it, once."""
        if self.sent or in_flight.full:
            return None
        self.sent = True
        in_flight.begin(self.item, now)
        return self.item

    def note(self, item: OutboxItem) -> None:
        """Note that an item is under way no longer."""
        self.over = self.over or item is self.item
