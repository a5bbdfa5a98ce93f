"""Builds and parses full topics: `B` = `<base topic>/<line name>`, and the topics under it.

What a daemon publishes is named under `B` in `lfs10d.telemetry.publication`; here are `B` itself, the requests, the
responses and the filters. Pure.
"""

from __future__ import annotations

from dataclasses import field

from lfs10d.mqtt.messages import Incoming
from lfs10d.system.dataclass import dataclass
from lfs10d.telemetry import publication

ONLINE = "online"
OFFLINE = "offline"

REQUEST = "request"
RESPONSE = "response"

OWNED_LEAVES = (
    publication.STATE,
    publication.CONFIG,
    publication.AVAILABILITY,
    publication.ERROR,
    publication.STATS,
    publication.WIND,
)
"""The last levels of the retained topics of a device; nobody but this daemon publishes them under its `B`."""

LONGEST_TOPIC = 65_535
"""Bytes of UTF-8 (MQTT 5.0, section 1.5.4)."""


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


@dataclass(frozen=True, slots=True)
class Topics:
    """The topics of one line under `base`, which is `B`: `lfs10d/line0`."""

    base: str

    @classmethod
    def of(cls, base_topic: str, line: str) -> Topics:
        """Return the topics of `line` below the configured base topic."""
        return cls(f"{base_topic}/{line}")

    @property
    def availability(self) -> str:
        """`online` or `offline`, retained; the last will goes here."""
        return self.full(publication.AVAILABILITY)

    @property
    def requests(self) -> str:
        """The filter of all requests."""
        return self.full(f"{REQUEST}/#")

    @property
    def retained_of_devices(self) -> tuple[str, ...]:
        """The filters under which a daemon that ran before may have left retained topics."""
        return tuple(self.full(publication.device_topic("+", leaf)) for leaf in OWNED_LEAVES)

    def full(self, relative: str) -> str:
        """Return the topic as the broker knows it: `state` under `lfs10d/line0` is `lfs10d/line0/state`.

        After `ELSEWHERE` stands a full topic that is not under `B`.
        """
        if relative.startswith(publication.ELSEWHERE):
            return relative.removeprefix(publication.ELSEWHERE)
        return f"{self.base}/{relative}"

    def relative(self, topic: str) -> str | None:
        """Return what follows `B/`, None for a topic that is not under `B`."""
        prefix = f"{self.base}/"
        return topic.removeprefix(prefix) if topic.startswith(prefix) else None

    def is_owned(self, relative: str) -> bool:
        """Return whether a topic under `B` is a retained topic of a device (`retained_of_devices`)."""
        match relative.split("/"):
            case ["device", _, leaf]:
                return leaf in OWNED_LEAVES
            case _:
                return False

    def command(self, message: Incoming) -> InboundRequest | None:
        """Return the request a message is, None for a message that is no request.

        The filter `B/request/#` also matches `B/request` itself, which has no level: `()`.
        """
        relative = self.relative(message.topic)
        if relative is None:
            return None
        first, *levels = relative.split("/")
        if first != REQUEST:
            return None
        return InboundRequest(
            relative,
            tuple(levels),
            message.payload,
            message.retained,
            self.response_topic(message.response_topic),
            message.correlation,
        )

    def response(self, *levels: str) -> str:
        """Return the topic under `B` that answers the request of these levels: `response/device/read`."""
        return "/".join((RESPONSE, *levels))

    def response_topic(self, asked: str | None) -> str | None:
        """Return a request's Response Topic under `B`, None where it is absent, not ours or no topic name.

        It is ours if it lies under `B/response/`; a topic name has no wildcard and no NUL
        (MQTT 5.0, sections 4.7.1 and 4.7.3).
        """
        relative = None if asked is None else self.relative(asked)
        if asked is None or relative is None or not relative.startswith(f"{RESPONSE}/"):
            return None
        if any(each in relative for each in "+#\0") or len(asked.encode()) > LONGEST_TOPIC:
            return None
        return relative
