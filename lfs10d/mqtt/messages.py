"""The values that a connection and its users exchange."""

from __future__ import annotations

from typing import Protocol

from lfs10d.mqtt.reasons import Disconnect
from lfs10d.mqtt.settings import Version
from lfs10d.system.dataclass import dataclass

RECEIVE_MAXIMUM_UNSAID = 65_535
"""The broker's Receive Maximum if it names none (MQTT 5.0, section 3.2.2.3.3)."""


@dataclass(frozen=True, slots=True)
class Will:
    """The last will: published by the broker if we are gone without DISCONNECT; retained, QoS 1."""

    topic: str
    payload: bytes


@dataclass(frozen=True, slots=True)
class Accepted:
    """The broker's CONNACK; `maximum_packet_size` is in bytes, None without a limit."""

    version: Version
    receive_maximum: int = RECEIVE_MAXIMUM_UNSAID
    maximum_packet_size: int | None = None


@dataclass(frozen=True, slots=True)
class Filter:
    """One subscription. By 3.1.1 only `topic` and `qos` count."""

    topic: str
    qos: int = 1
    retain_as_published: bool = True
    no_local: bool = False


@dataclass(frozen=True, slots=True)
class Incoming:
    """One message from the broker. By 3.1.1 `retained` is False for all but those kept from before."""

    topic: str
    payload: bytes
    retained: bool
    response_topic: str | None = None
    correlation: bytes | None = None


class Events(Protocol):
    """The events of a connection, always in the thread of the asyncio loop."""

    def accepted(self, accepted: Accepted) -> None:
        """Note that the connection stands."""

    def ended(self, ended: Disconnect) -> None:
        """Note that it is over, or never came to be; nothing follows."""

    def acknowledged(self, mid: int, reason: int) -> None:
        """Note that the broker has a message, or refused it (reason >= 0x80). QoS 0: it was written."""

    def subscribed(self, mid: int, reasons: tuple[int, ...]) -> None:
        """Note the broker's answer to each filter: the QoS, or a reason >= 0x80."""

    def arrived(self, message: Incoming) -> None:
        """Take one message."""
