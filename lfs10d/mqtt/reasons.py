"""Why a connection to the broker ended or failed, as a value and in words."""

from __future__ import annotations

import socket
import ssl
from collections.abc import Sequence
from enum import StrEnum

from lfs10d.errors import BrokerError, Lfs10dError
from lfs10d.mqtt.settings import BrokerSettings
from lfs10d.system.dataclass import dataclass

NO_MATCHING_SUBSCRIBERS = 0x10
"""The broker took a message that nobody listens to (MQTT 5.0, section 3.4.2.1)."""

UNSUPPORTED_VERSION = 0x84
KEEP_ALIVE_TIMEOUT = 0x8D
SESSION_TAKEN_OVER = 0x8E
REFUSED_FROM = 0x80
"""Reason codes from here on are refusals (MQTT 5.0, section 2.4)."""

NOT_FOR_A_MESSAGE = frozenset(
    {0x04, *range(0x88, 0x8C), KEEP_ALIVE_TIMEOUT, SESSION_TAKEN_OVER}
    | {0x93, 0x96, 0x97, 0x98, 0x9A, 0x9B, 0x9C, 0x9D, 0x9F, 0xA0}
)
"""Reasons of a DISCONNECT that speak of the broker or of the connection, never of one message (section 3.14.2.1)."""

CERTIFICATE_ALERTS = ("certificate", "unknown ca", "access denied", "handshake failure")
"""Alerts that a broker sends which does not accept our certificate, or misses it (RFC 8446, section 6.2)."""

_REASONS = {
    0x81: "the broker calls our packet malformed",
    0x82: "the broker sees a protocol error",
    UNSUPPORTED_VERSION: "the broker does not support this version of MQTT: set mqtt.version",
    0x85: "the broker refuses our client id: set mqtt.client_id",
    0x86: "wrong user name or password: check mqtt.username and mqtt.password_file",
    0x87: "not authorized: check mqtt.username and mqtt.password_file, and the ACL of the broker",
    0x88: "the broker is not available",
    0x89: "the broker is busy",
    0x8A: "the broker has banned this client",
    0x8B: "the broker is shutting down",
    KEEP_ALIVE_TIMEOUT: "the broker received nothing from us for too long",
    SESSION_TAKEN_OVER: "another client has connected with our client id: give each its own mqtt.client_id",
    0x83: "a reason of the broker's own, see its log",
    0x90: "the broker does not take this topic",
    0x93: "more messages under way than the broker permits",
    0x95: "a packet was too large for the broker",
    0x96: "the broker calls our rate of messages too high",
    0x97: "a quota of the broker is used up",
    0x99: "the broker does not take this payload",
    0x98: "an administrator of the broker ended it",
    0x9A: "the broker keeps no retained messages, which lfs10d needs",
    0x9B: "the broker does not offer QoS 1, which lfs10d needs",
    0x9C: "the broker points to another server: set mqtt.host",
    0x9D: "the broker has moved: set mqtt.host",
    0x9F: "the broker limits how often a client may connect",
}
"""What a reason code means for the person who must act (MQTT 5.0, section 2.4)."""


class NoNodeError(BrokerError):
    """None of several nodes can be reached; `failures` are the nodes with their errors, in turn."""

    def __init__(self, failures: Sequence[tuple[BrokerSettings, Exception]]) -> None:
        super().__init__("no node can be reached")
        self.failures = tuple(failures)


class DisconnectReason(StrEnum):
    """What happened, as far as the next attempt depends on it."""

    UNREACHABLE = "unreachable"
    """The broker is unreachable: no name, no route, no answer, or the port is closed."""
    CLOSED = "closed"
    """The broker closed the connection during TLS without an alert."""
    WRONG_VERSION = "wrong_version"
    """The broker refuses this version of MQTT, or sent no CONNACK at all, which old brokers do instead."""
    REFUSED = "refused"
    """The CONNACK says no for another reason, or there is no TLS, or our own password or certificate is of no use."""
    LOST = "lost"
    """The connection was made and is lost."""
    TAKEN_OVER = "taken_over"
    """Another client uses our client id."""
    LEFT = "left"
    """We went."""


@dataclass(frozen=True, slots=True)
class Disconnect:
    """One end; `message` is for a person and names the broker."""

    ending: DisconnectReason
    message: str
    reason: int | None = None
    by_message: bool = False
    """The broker ended it, perhaps because of a message of ours."""


def reason_in_words(reason: int) -> str:
    """Return the meaning of a reason code >= 0x80."""
    return _REASONS.get(reason, f"reason code 0x{reason:02X}")


def gone(
    place: str, *, left: bool, accepted: bool, reason: int | None = None, cause: BaseException | str | None = None
) -> Disconnect:
    """Return the end of a connection to the broker at `place`.

    `left`: we said so; `accepted`: the broker had accepted us; `reason` is that of its DISCONNECT, None without one;
    `cause` is why we ended it or could not go on, None: the broker closed it without a word.
    """
    if left:
        return Disconnect(DisconnectReason.LEFT, f"{place}: disconnected")
    refused = _refused_certificate(cause)
    if refused is not None:
        return Disconnect(DisconnectReason.REFUSED, f"{place}: {refused}")
    if not accepted:
        message = f"{place}: closed the connection without an answer: check mqtt.port and mqtt.tls"
        if cause is not None and not isinstance(cause, ConnectionResetError):
            message += f" ({_words_of_loss(cause)})"
        return Disconnect(DisconnectReason.WRONG_VERSION, message)
    if reason is None:
        by_broker = cause is None or isinstance(cause, ConnectionResetError | BrokenPipeError | ssl.SSLError)
        return Disconnect(
            DisconnectReason.LOST, f"{place}: the connection is lost: {_words_of_loss(cause)}", by_message=by_broker
        )
    ending = DisconnectReason.TAKEN_OVER if reason == SESSION_TAKEN_OVER else DisconnectReason.LOST
    by_message = reason not in NOT_FOR_A_MESSAGE
    return Disconnect(ending, f"{place}: {reason_in_words(reason)}", reason, by_message=by_message)


def _words_of_loss(cause: BaseException | str | None) -> str:
    match cause:
        case None:
            return "the broker closed it without giving a reason"
        case ssl.SSLError():
            return f"TLS: {_reason_of_tls(cause)}"
        case OSError(strerror=str(said)):
            return said.lower()
        case BaseException():
            return f"{type(cause).__name__}: {cause}"
        case _:
            return cause


def failed(error: BaseException, settings: BrokerSettings) -> Disconnect:
    """Return why no connection could be made, to any of the nodes."""
    if isinstance(error, NoNodeError):
        each = sorted(failed(caught, node).message for node, caught in error.failures)  # alike whoever is first in turn
        return Disconnect(DisconnectReason.UNREACHABLE, "; ".join(each))
    return Disconnect(_ending(error), f"{settings.place}: {_words(error, settings)}")


def _ending(error: BaseException) -> DisconnectReason:
    match error:
        case ssl.SSLEOFError() | ssl.SSLZeroReturnError() | ConnectionResetError() | BrokenPipeError():
            return DisconnectReason.CLOSED
        case OSError() if not isinstance(error, ssl.SSLError):
            return DisconnectReason.UNREACHABLE
        case _:
            return DisconnectReason.REFUSED


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
    return _refused_certificate(error) or f"no TLS: {_reason_of_tls(error)}: check mqtt.port and mqtt.tls"


def _reason_of_tls(error: ssl.SSLError) -> str:
    return (error.reason or "TLS error").replace("_", " ").lower()


def _refused_certificate(cause: object) -> str | None:
    """Return what to do if the broker's alert says that it does not accept our certificate, else None.

    By TLS 1.3 such an alert comes when the handshake is over for us (RFC 8446, section 4.4.2.4).
    """
    if not isinstance(cause, ssl.SSLError):
        return None
    reason = _reason_of_tls(cause)
    if "alert" not in reason or not any(word in reason for word in CERTIFICATE_ALERTS):
        return None
    return f"the broker does not accept mqtt.tls.cert: {reason}: check mqtt.tls.cert and mqtt.tls.key"
