"""What the subscriber heard, as plain values. Pure."""

from __future__ import annotations

import json
from collections.abc import Iterable
from typing import Any, NamedTuple

from soak.ledger import Told


class Message(NamedTuple):
    """One message; `at` is monotonic seconds. An empty topic: the subscriber has (re)connected."""

    at: float
    topic: str
    payload: bytes


def samples_of(message: Message) -> Iterable[Told]:
    """Return the samples in a message on `telemetry` or `history`; none of other topics."""
    if message.topic.endswith("/telemetry"):
        return [_told(json.loads(message.payload), historical=False)]
    if message.topic.endswith("/history"):
        return [_told(one, historical=True) for one in json.loads(message.payload)]
    return []


def _told(sample: dict[str, Any], *, historical: bool) -> Told:
    return Told(
        sample["device"],
        sample["boot"],
        sample["seq"],
        sample["ts"],
        sample["wind_speed"],
        sample["error"],
        sample["quality"],
        historical,
    )
