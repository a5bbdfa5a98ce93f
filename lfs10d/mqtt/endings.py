"""Why a connection to the broker ended or never came to be, in a word for the program and in words for a person."""

from __future__ import annotations

import socket
import ssl
from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING

from lfs10d.errors import Lfs10dError

if TYPE_CHECKING:
    from lfs10d.mqtt.settings import BrokerSettings

NO_MATCHING_SUBSCRIBERS = 0x10
"""The broker took a message that nobody listens to (MQTT 5.0, section 3.4.2.1)."""

UNSUPPORTED_VERSION = 0x84
SESSION_TAKEN_OVER = 0x8E
REFUSED_FROM = 0x80
"""Reason codes from here on are refusals (MQTT 5.0, section 2.4)."""

_REASONS = {
    0x81: "the broker calls our packet malformed",
    0x82: "the broker sees a protocol error",
    UNSUPPORTED_VERSION: "the broker does not speak this version of MQTT: set mqtt.version",
    0x85: "the broker refuses our client id: set mqtt.client_id",
    0x86: "wrong user name or password: check mqtt.username and mqtt.password_file",
    0x87: "not authorized: check mqtt.username and mqtt.password_file, and the ACL of the broker",
    0x88: "the broker is not available",
    0x89: "the broker is busy",
    0x8A: "the broker has banned this client",
    0x8B: "the broker is shutting down",
    0x8D: "the broker heard nothing from us for too long",
    SESSION_TAKEN_OVER: "another client has connected with our client id: give each its own mqtt.client_id",
    0x93: "more messages under way than the broker permits",
    0x95: "a packet was too large for the broker",
    0x96: "the broker calls our rate of messages too high",
    0x97: "a quota of the broker is used up",
    0x98: "an administrator of the broker ended it",
    0x9A: "the broker keeps no retained messages, which lfs10d needs",
    0x9B: "the broker does not offer QoS 1, which lfs10d needs",
    0x9C: "the broker points to another server: set mqtt.host",
    0x9D: "the broker has moved: set mqtt.host",
    0x9F: "the broker limits how often a client may connect",
}
"""What a reason code means for the person who must act (MQTT 5.0, section 2.4)."""


class Ending(StrEnum):
    """What happened, as far as the next attempt depends on it."""

    UNREACHABLE = "unreachable"
    """Nobody is there: no name, no route, no answer, or the port is closed."""
    CLOSED = "closed"
    """The broker closed the connection during TLS, without a word."""
    WRONG_VERSION = "wrong_version"
    """The broker refuses this version of MQTT, or sent no CONNACK at all, which old brokers do instead."""
    REFUSED = "refused"
    """The CONNACK says no for another reason, or there is no TLS, or our own password or certificate is of no use."""
    LOST = "lost"
    """The connection was there and is gone."""
    TAKEN_OVER = "taken_over"
    """Another client uses our client id."""
    LEFT = "left"
    """We went."""


@dataclass(frozen=True, slots=True)
class Ended:
    """One end; `message` is for a person and names the broker."""

    ending: Ending
    message: str
    reason: int | None = None


def reason_in_words(reason: int) -> str:
    """Return what a reason code >= 0x80 says."""
    return _REASONS.get(reason, f"reason code 0x{reason:02X}")


def gone(place: str, *, left: bool, accepted: bool, reason: int | None) -> Ended:
    """Return what the end of a connection to the broker at `place` means.

    `left`: we said so; `accepted`: the broker had accepted us; `reason` is that of its DISCONNECT, None without one.
    """
    if left:
        return Ended(Ending.LEFT, f"{place}: disconnected")
    if not accepted:
        message = f"{place}: closed the connection without an answer: check mqtt.port and mqtt.tls"
        return Ended(Ending.WRONG_VERSION, message)
    if reason is None:
        return Ended(Ending.LOST, f"{place}: the connection is lost")
    ending = Ending.TAKEN_OVER if reason == SESSION_TAKEN_OVER else Ending.LOST
    return Ended(ending, f"{place}: {reason_in_words(reason)}", reason)


def failed(error: BaseException, settings: BrokerSettings) -> Ended:
    """Return why no connection could be made."""
    return Ended(_ending(error), f"{settings.place}: {_words(error, settings)}")


def _ending(error: BaseException) -> Ending:
    match error:
        case ssl.SSLEOFError() | ssl.SSLZeroReturnError() | ConnectionResetError() | BrokenPipeError():
            return Ending.CLOSED
        case OSError() if not isinstance(error, ssl.SSLError):
            return Ending.UNREACHABLE
        case _:
            return Ending.REFUSED


def _words(error: BaseException, settings: BrokerSettings) -> str:
    words = f"{type(error).__name__}: {error}"
    match error:
        case Lfs10dError():
            words = str(error)
        case ssl.SSLError():
            words = _words_of_tls(error)
        case socket.gaierror():
            words = f"the name {settings.host} cannot be resolved: check mqtt.host and the name server"
        case ConnectionRefusedError():
            words = "connection refused: is the broker running, and mqtt.port right?"
        case TimeoutError():
            words = "no answer: check mqtt.host, the network and the firewall"
        case ConnectionResetError() if settings.tls is not None:
            words = "closed the connection during TLS: check mqtt.port, mqtt.tls.cert and mqtt.tls.key"
        case OSError(strerror=str(said), filename=file):
            words = said.lower() if file is None else f"{file}: {said.lower()}"
    return words


def _words_of_tls(error: ssl.SSLError) -> str:
    if isinstance(error, ssl.SSLCertVerificationError):
        cause = error.verify_message.rstrip(".")
        return f"the certificate is not accepted: {cause}: check mqtt.host, mqtt.tls.ca and the clock"
    if error.reason == "WRONG_VERSION_NUMBER":
        return "no TLS: it does not speak TLS on this port: check mqtt.port and mqtt.tls"
    reason = (error.reason or "TLS error").replace("_", " ").lower()
    return f"no TLS: {reason}: check mqtt.port and mqtt.tls"
