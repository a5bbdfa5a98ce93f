"""A plan of connections and how they end."""

from __future__ import annotations

from lfs10d.mqtt.reasons import Disconnect, DisconnectReason
from lfs10d.mqtt.reconnect import (
    Reconnect,
)
from lfs10d.mqtt.settings import Version

UNREACHABLE = Disconnect(DisconnectReason.UNREACHABLE, "")
WRONG_VERSION = Disconnect(DisconnectReason.WRONG_VERSION, "")
REFUSED = Disconnect(DisconnectReason.REFUSED, "", 0x87)
LOST = Disconnect(DisconnectReason.LOST, "")
TAKEN_OVER = Disconnect(DisconnectReason.TAKEN_OVER, "")


def fresh(version: Version = Version.V5, nodes: int = 1) -> Reconnect:
    return Reconnect(version, lambda: 0.0, nodes)


def live(policy: Reconnect, start: float, seconds: float, ended: Disconnect = LOST) -> None:
    policy.accepted(start)
    policy.ended(ended, start + seconds)
