"""A request as it came in, before anything about it is judged. Pure."""

from __future__ import annotations

from dataclasses import dataclass, field

from lfs10d.mqtt.messages import Incoming
from lfs10d.mqtt.topics import Topics


@dataclass(frozen=True, slots=True)
class InboundRequest:
    """One message under `B/request`.

    `levels` follow `request/`: `("device", "read")`; any number, of any text. `topic` and `response_topic` are
    under `B`; `response_topic` is None where the request names none, or an invalid one. By MQTT 3.1.1
    `retained` is True only for what was retained before we subscribed.
    """

    topic: str
    levels: tuple[str, ...]
    payload: bytes = field(repr=False)
    retained: bool
    response_topic: str | None = None
    correlation: bytes | None = field(default=None, repr=False)


def inbound(message: Incoming, topics: Topics) -> InboundRequest | None:
    """Return the request a message is, None for a message that is no request."""
    levels = topics.request_levels(message.topic)
    relative = topics.relative(message.topic)
    if levels is None or relative is None:
        return None
    return InboundRequest(
        relative,
        levels,
        message.payload,
        message.retained,
        topics.response_topic(message.response_topic),
        message.correlation,
    )
