"""Why there is no connection is said in words, with the broker's place and what to do."""

from __future__ import annotations

import errno
import socket
import ssl

import pytest

from lfs10d.config.models import TlsConfig
from lfs10d.errors import BrokerError
from lfs10d.mqtt.reasons import NOT_FOR_A_MESSAGE, DisconnectReason, NoNodeError, failed, gone, reason_in_words
from lfs10d.mqtt.settings import BrokerSettings

SETTINGS = BrokerSettings("gate.example", 8883, "me", tls=TlsConfig())


def certificate_error() -> ssl.SSLCertVerificationError:
    error = ssl.SSLCertVerificationError(1, "x")
    error.verify_message = "certificate has expired."
    return error


def tls_error(reason: str | None, kind: type[ssl.SSLError] = ssl.SSLError) -> ssl.SSLError:
    error = kind(1, "x")
    error.reason = reason  # type: ignore[assignment]  # None where OpenSSL gives none
    return error


@pytest.mark.parametrize(
    ("error", "words"),
    [
        (BrokerError("mqtt.tls.ca: /x: no such file"), "mqtt.tls.ca: /x: no such file"),
        (socket.gaierror(-2, "Name or service not known"), "the name gate.example cannot be resolved: check"),
        (certificate_error(), "the certificate is not accepted: certificate has expired: check mqtt.host"),
        (tls_error("WRONG_VERSION_NUMBER"), "no TLS: it does not speak TLS on this port: check mqtt.port"),
        (
            tls_error("TLSV1_ALERT_UNKNOWN_CA"),
            "the broker does not accept mqtt.tls.cert: tlsv1 alert unknown ca: check",
        ),
        (tls_error("TLSV1_ALERT_INTERNAL_ERROR"), "no TLS: tlsv1 alert internal error: check"),
        (tls_error(None), "no TLS: tls error: check"),
        (ConnectionRefusedError(errno.ECONNREFUSED, "Connection refused"), "connection refused: is the broker"),
        (TimeoutError("timed out"), "no answer: check mqtt.host, the network and the firewall"),
        (ConnectionResetError(errno.ECONNRESET, "reset"), "closed the connection during TLS: check mqtt.port"),
        (OSError(errno.EHOSTUNREACH, "No route to host"), "no route to host"),
        (PermissionError(errno.EACCES, "Permission denied", "/etc/pw"), "/etc/pw: permission denied"),
        (UnicodeError("label too long"), "UnicodeError: label too long"),
        (OSError("bare"), "OSError: bare"),
    ],
)
def test_a_failed_attempt_names_the_broker_and_the_cause(error: Exception, words: str) -> None:
    ended = failed(error, SETTINGS)
    assert ended.ending in {DisconnectReason.UNREACHABLE, DisconnectReason.CLOSED, DisconnectReason.REFUSED}
    assert ended.message.startswith(f"broker gate.example:8883: {words}")


def test_a_reset_without_tls_is_just_that() -> None:
    plain = BrokerSettings("gate.example", 1883, "me")
    ended = failed(ConnectionResetError(errno.ECONNRESET, "Connection reset by peer"), plain)
    assert ended.message == "broker gate.example:1883: connection reset by peer"


def test_a_reason_code_says_what_to_do() -> None:
    assert reason_in_words(0x86) == "wrong user name or password: check mqtt.username and mqtt.password_file"


def test_an_unknown_reason_code_is_shown_as_the_number_it_is() -> None:
    assert reason_in_words(0xA2) == "reason code 0xA2"


@pytest.mark.parametrize(
    ("error", "ending"),
    [
        (socket.gaierror(-2, "Name or service not known"), DisconnectReason.UNREACHABLE),
        (ConnectionRefusedError(errno.ECONNREFUSED, "Connection refused"), DisconnectReason.UNREACHABLE),
        (TimeoutError("timed out"), DisconnectReason.UNREACHABLE),
        (OSError(errno.EHOSTUNREACH, "No route to host"), DisconnectReason.UNREACHABLE),
        (ConnectionResetError(errno.ECONNRESET, "reset"), DisconnectReason.CLOSED),
        (tls_error("UNEXPECTED_EOF_WHILE_READING", ssl.SSLEOFError), DisconnectReason.CLOSED),
        (tls_error("WRONG_VERSION_NUMBER"), DisconnectReason.REFUSED),
        (certificate_error(), DisconnectReason.REFUSED),
        (BrokerError("mqtt.tls.ca: /x: no such file"), DisconnectReason.REFUSED),
        (UnicodeError("label too long"), DisconnectReason.REFUSED),
    ],
)
def test_a_broker_that_is_not_there_is_distinguished_from_one_that_refuses_us(
    error: Exception, ending: DisconnectReason
) -> None:
    """The first is tried every second, the other with back-off."""
    assert failed(error, SETTINGS).ending is ending


# A connection that was there and is gone


def test_why_it_ended_is_always_reported() -> None:
    causes: list[BaseException | str | None] = [
        None,
        ConnectionResetError(errno.ECONNRESET, "Connection reset by peer"),
        TimeoutError(errno.ETIMEDOUT, "Connection timed out"),
        "no answer to a ping",
        ValueError("Received malformed packet"),
        tls_error("UNEXPECTED_EOF_WHILE_READING"),
    ]
    endings = [gone("broker b:1", left=False, accepted=True, cause=cause) for cause in causes]
    assert {ended.ending for ended in endings} == {DisconnectReason.LOST}
    assert [ended.message.removeprefix("broker b:1: the connection is lost: ") for ended in endings] == [
        "the broker closed it without giving a reason",
        "connection reset by peer",
        "connection timed out",
        "no answer to a ping",
        "ValueError: Received malformed packet",
        "TLS: unexpected eof while reading",
    ]
    assert [ended.by_message for ended in endings] == [True, True, False, False, False, True]


@pytest.mark.parametrize("reason", [0x80, 0x81, 0x83, 0x87, 0x90, 0x95, 0x99, 0xC3])
def test_a_disconnect_may_be_for_a_message_and_is_no_duplicate_client(reason: int) -> None:
    ended = gone("broker b:1", left=False, accepted=True, reason=reason)
    assert (ended.ending, ended.reason, ended.by_message) == (DisconnectReason.LOST, reason, True)
    assert ended.message == f"broker b:1: {reason_in_words(reason)}"


@pytest.mark.parametrize("reason", sorted(NOT_FOR_A_MESSAGE))
def test_a_disconnect_for_another_reason_is_no_message_s_fault(reason: int) -> None:
    ended = gone("broker b:1", left=False, accepted=True, reason=reason)
    assert ended.ending is (DisconnectReason.TAKEN_OVER if reason == 0x8E else DisconnectReason.LOST)
    assert not ended.by_message


@pytest.mark.parametrize("accepted", [True, False])
@pytest.mark.parametrize("alert", ["TLSV13_ALERT_CERTIFICATE_REQUIRED", "SSLV3_ALERT_CERTIFICATE_EXPIRED"])
def test_a_certificate_of_ours_that_is_refused_after_the_handshake_is_named(alert: str, accepted: bool) -> None:  # noqa: FBT001 - both sides of one claim
    ended = gone("broker b:1", left=False, accepted=accepted, cause=tls_error(alert))
    assert ended.ending is DisconnectReason.REFUSED
    assert ended.message.startswith("broker b:1: the broker does not accept mqtt.tls.cert: ")


def test_an_end_before_the_answer_and_one_of_our_own_will() -> None:
    words = "broker b:1: closed the connection without an answer: check mqtt.port and mqtt.tls"
    before = gone("broker b:1", left=False, accepted=False, cause=ConnectionResetError(errno.ECONNRESET, "reset"))
    assert (before.ending, before.message, before.by_message) == (DisconnectReason.WRONG_VERSION, words, False)
    garbage = gone("broker b:1", left=False, accepted=False, cause="Received malformed packet: x")
    assert garbage.message == f"{words} (Received malformed packet: x)"
    ours = gone("broker b:1", left=True, accepted=True)
    assert (ours.ending, ours.by_message) == (DisconnectReason.LEFT, False)


def test_where_no_node_answers_each_is_named_in_the_same_order_whoever_was_first() -> None:
    nodes = BrokerSettings("b", 1, "me", others=(("a", 2),)).nodes
    failures = [(nodes[0], ConnectionRefusedError()), (nodes[1], TimeoutError())]
    told = {failed(NoNodeError(each), nodes[0]) for each in (failures, failures[::-1])}
    (ended,) = told
    assert ended.ending is DisconnectReason.UNREACHABLE
    assert ended.message == (
        "broker a:2: no answer: check mqtt.host, the network and the firewall; "
        "broker b:1: connection refused: is the broker running, and mqtt.port right?"
    )
