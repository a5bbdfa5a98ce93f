"""Finds the message because of which the broker ends the connection. Pure.

Brokers end a connection for one message: too large, denied. By MQTT 3.1.1 none says why, by MQTT 5 not all do.

- What was under way when the broker ended a connection, and again when it ended the next, is suspected. Where that is
  one topic alone it is the culprit.
- Where it is several, each of them goes alone from then on: the next end has one under way.
- A reason that speaks of a message (`certain`) makes what was under way go alone after the first end already.
- The broker's acknowledgement of a message of that topic, about as large, clears it.
- Ends that no message causes (the network, a broker that shuts down, another client) change nothing.
"""

from __future__ import annotations

from collections.abc import Mapping

from lfs10d.system.dataclass import dataclass

ABOUT_AS_LARGE = 0.9
"""A message of this part of a suspect's size proves that it is not its size."""


@dataclass(frozen=True, slots=True)
class Culprit:
    """A topic under `B` whose message of `size` bytes ends the connection."""

    topic: str
    size: int


class Suspects:
    """The rules above; sizes are in bytes."""

    def __init__(self) -> None:
        self.alone = False
        """Some go alone."""
        self.sizes: dict[str, int] = {}
        """Bytes of the messages suspected, by topic."""

    def goes_alone(self, topic: str) -> bool:
        """Return whether a message of this topic may only be sent while nothing else is under way."""
        return self.alone and topic in self.sizes

    def explain(self, sent: Mapping[str, int]) -> bool:
        """Return whether one of these was under way at the last end too: then a message may be why."""
        return not self.sizes.keys().isdisjoint(sent)

    def ended(self, sent: Mapping[str, int], *, certain: bool) -> Culprit | None:
        """Note that the broker ended the connection while these (topic -> size) were under way."""
        again = {topic: size for topic, size in sent.items() if topic in self.sizes}
        self.sizes = again or dict(sent)
        self.alone = bool(again) or certain
        if len(again) != 1:
            return None
        [(topic, size)] = again.items()
        return Culprit(topic, size)

    def cut(self, culprit: Culprit) -> None:
        """Note that what is sent on the culprit's topic is half as large from now on."""
        self.sizes[culprit.topic] = culprit.size // 2

    def acknowledged(self, topic: str, size: int) -> None:
        """Note that the broker has taken a message of `size` bytes."""
        if size >= ABOUT_AS_LARGE * self.sizes.get(topic, float("inf")):
            del self.sizes[topic]
            self.alone = self.alone and bool(self.sizes)
