"""Examines the broker: name, port, TLS, login, permissions, limits and round-trip time."""

from __future__ import annotations

import asyncio
import secrets
import socket
import ssl
import statistics
import time
from collections.abc import AsyncIterator, Callable, Iterator
from typing import Final

from lfs10d.cli.client import Acknowledgements
from lfs10d.cli.doctor.finding import Area, Finding
from lfs10d.cli.login import Login
from lfs10d.config.credentials import reason
from lfs10d.errors import BrokerError
from lfs10d.mqtt.broker_client import BrokerClient
from lfs10d.mqtt.connection import Connection
from lfs10d.mqtt.messages import Accepted, Filter, Incoming
from lfs10d.mqtt.reasons import REFUSED_FROM, reason_in_words
from lfs10d.mqtt.settings import BrokerSettings
from lfs10d.mqtt.tls import tls_context
from lfs10d.telemetry.homeassistant.gateway import config_topic, object_id

BROKER, INTEGRATIONS = Area("broker"), Area("integrations")

REACHED_WITHIN: Final = 5.0
"""s for name, TCP and TLS of one node."""
ACCEPTED_WITHIN: Final = 12.0
ANSWERED_WITHIN: Final = 5.0
LEFT_WITHIN: Final = 0.3
ROUND_TRIPS: Final = 5
RETAINED_WITHIN: Final = 1.0
SOON: Final = 30 * 86400
"""s before the end of a certificate from which on there is a warning."""
SMALLEST_PACKET: Final = 8192 + 512
"""Bytes; an array of history has up to 8 KB (contract of the topics), and its topic."""


class _Trial(Acknowledgements):
    """The findings of one connection of ours."""

    def __init__(self) -> None:
        super().__init__()
        self.heard: set[bytes] = set()
        self.topics: set[str] = set()

    def accepted(self, accepted: Accepted) -> None:
        """Do nothing: `BrokerClient.opened` returns it."""

    def arrived(self, message: Incoming) -> None:
        """Note a message that came back."""
        self.heard.add(message.payload)
        self.topics.add(message.topic)
        self.changed.set()

    async def refusal(self, mid: int | None) -> str | None:
        """Return in words why a packet is refused, or that no acknowledgement comes; None where it is accepted."""
        if mid is None or not await self.until(lambda: mid in self.settled):
            return self.ended_by or "no answer"
        reason = self.settled[mid][0]
        return None if reason < REFUSED_FROM else self.ended_by or reason_in_words(reason)

    async def until(self, condition: Callable[[], bool], within: float = ANSWERED_WITHIN) -> bool:
        """Wait until the condition holds; False where it does not in time, or the connection ends."""
        try:
            return await self.wait_until(condition, within)
        except BrokerError:
            return False


async def look(login: Login, messages_a_second: float) -> list[Finding]:
    """Return the findings about the broker; the polls of this line need `messages_a_second`."""
    findings = []
    reached = False
    for node in login.settings.nodes:
        found = await asyncio.to_thread(list, reach(node))
        findings += found
        reached = reached or all(each.level != "fail" for each in found)
    if reached:
        findings += await _log_in(login, messages_a_second)
    return findings


def reach(node: BrokerSettings, now: float | None = None) -> Iterator[Finding]:
    """Yield the findings about reaching one node: name, TCP, TLS with the dates of its certificate. Blocks."""
    try:
        socket.getaddrinfo(node.host, node.port, type=socket.SOCK_STREAM)
    except OSError as error:
        yield BROKER.fail(f"the name {node.host} is not known ({error.strerror})", "is mqtt.host right? does DNS work?")
        return
    try:
        connection = socket.create_connection((node.host, node.port), REACHED_WITHIN)
    except OSError as error:
        yield BROKER.fail(
            f"{node.place}: {reason(error)}", "does the broker run, and listen there? is a firewall between?"
        )
        return
    with connection:
        if node.tls is None:
            yield BROKER.ok(f"{node.place} accepts connections")
            return
        try:
            with tls_context(node.tls).wrap_socket(connection, server_hostname=node.host) as secured:
                certificate = secured.getpeercert() or {}
        except (OSError, BrokerError) as error:
            yield BROKER.fail(f"{node.place}: TLS: {_tls_words(error)}", _tls_advice(error))
            return
        yield from _dates(node, certificate, time.time() if now is None else now)


def _tls_words(error: OSError | BrokerError) -> str:
    if isinstance(error, ssl.SSLCertVerificationError):
        return error.verify_message
    if isinstance(error, ssl.SSLError):
        return (error.reason or str(error)).replace("_", " ").lower()
    return str(error)


def _tls_advice(error: OSError | BrokerError) -> str:
    words = _tls_words(error)
    if "expired" in words:
        return "renew the broker's certificate; is this machine's clock right?"
    if "not yet valid" in words:
        return "is this machine's clock right? timedatectl"
    if "match" in words:
        return "set mqtt.host to a name that is in the broker's certificate"
    if isinstance(error, ssl.SSLCertVerificationError):
        return "set mqtt.tls.ca to the authority that signed the broker's certificate"
    return "is this the broker's TLS port (8883), and are mqtt.tls.ca, cert and key right?"


def _dates(node: BrokerSettings, certificate: object, now: float) -> Iterator[Finding]:
    until = certificate.get("notAfter") if isinstance(certificate, dict) else None
    if not isinstance(until, str):
        yield BROKER.ok(f"{node.place}: TLS")
        return
    left = ssl.cert_time_to_seconds(until) - now
    day = time.strftime("%Y-%m-%d", time.gmtime(now + left))
    if left < SOON:
        yield BROKER.warn(f"{node.place}: its certificate ends on {day}", "renew it before that day")
    else:
        yield BROKER.ok(f"{node.place}: TLS, certificate until {day}")


async def _log_in(login: Login, needed: float) -> list[Finding]:
    trial = _Trial()
    client = BrokerClient(login.settings, trial)
    client.start()
    try:
        try:
            accepted = await client.opened(ACCEPTED_WITHIN)
        except BrokerError as error:
            missing = f"; {login.missing_password}" if login.missing_password else ""
            return [BROKER.fail(f"{error}{missing}", "check mqtt.username, the password and the broker's log")]
        who = login.settings.username or "no name"
        return [
            BROKER.ok(f"logged in as {who} by MQTT {accepted.version}"),
            *[finding async for finding in _try_out(client, trial, login, accepted, needed)],
        ]
    finally:
        await client.leave(LEFT_WITHIN)


async def _try_out(
    client: BrokerClient, trial: _Trial, login: Login, accepted: Accepted, needed: float
) -> AsyncIterator[Finding]:
    connection = client.connection
    base = login.topics.base
    topic = login.topics.full(login.topics.response(f"doctor-{secrets.token_hex(6)}"))
    if connection is None:
        return
    advice = f"the broker's ACL must let this login publish and subscribe below {base}: docs/mqtt-security.md"
    if (refused := await trial.refusal(connection.subscribe([Filter(topic)]))) is not None:
        yield BROKER.fail(f"it refuses the subscription to {topic}: {refused}", advice)
        return
    times = []
    for _ in range(ROUND_TRIPS):
        took = await _round_trip(connection, trial, topic)
        if isinstance(took, str):
            yield BROKER.fail(f"below {base}: {took}", advice)
            return
        times.append(took)
    for finding in limits(accepted, statistics.median(times), needed):
        yield finding
    if login.config.homeassistant.discovery:
        yield await _discovery(connection, trial, login.config.homeassistant.prefix, base)


async def _round_trip(connection: Connection, trial: _Trial, topic: str) -> float | str:
    """Publish once; return the s until the acknowledgement, or in words why it did not come back."""
    payload, began = secrets.token_hex(8).encode(), time.monotonic()
    if (refused := await trial.refusal(connection.publish(topic, payload))) is not None:
        return f"it refuses to publish: {refused}"
    took = time.monotonic() - began
    return took if await trial.until(lambda: payload in trial.heard) else "what is published does not arrive"


async def _discovery(connection: Connection, trial: _Trial, prefix: str, base: str) -> Finding:
    """Return whether the line was announced to Home Assistant, and whether that runs."""
    own, birth = config_topic(prefix, object_id(base)), f"{prefix}/status"
    refused = await trial.refusal(connection.subscribe([Filter(own), Filter(birth)]))
    advice = f"the broker's ACL must let this login publish below {prefix}: docs/mqtt-security.md"
    if refused is not None:
        return INTEGRATIONS.warn(f"it cannot be seen whether {own} was published", advice)
    if not await trial.until(lambda: own in trial.topics, RETAINED_WITHIN):
        return INTEGRATIONS.fail(f"discovery is on, and nothing is at {own}", f"does the daemon run? {advice}")
    if birth not in trial.topics:
        return INTEGRATIONS.ok(f"announced to Home Assistant at {own}; its own birth message is not retained")
    return INTEGRATIONS.ok(f"announced to Home Assistant at {own}")


def limits(accepted: Accepted, round_trip: float, needed: float) -> Iterator[Finding]:
    """Yield the findings about the broker's limits; `round_trip` in s, `needed` in messages a second."""
    carried = accepted.receive_maximum / max(round_trip, 1e-4)
    text = (
        f"publishing below the base topic works; round trip {round_trip * 1e3:.0f} ms, window "
        f"{accepted.receive_maximum}: {carried:.0f} messages/s, needed {needed:.1f}"
    )
    if carried < needed:
        yield BROKER.warn(
            text,
            "samples will go in arrays of history; a nearer broker, a greater Receive Maximum, mqtt.state_every: 10s "
            "or mqtt.telemetry: false",
        )
    else:
        yield BROKER.ok(text)
    most = accepted.maximum_packet_size
    if most is not None and most < SMALLEST_PACKET:
        yield BROKER.warn(
            f"it takes messages of at most {most} bytes",
            "history goes in smaller arrays; better raise its limit (mosquitto: max_packet_size)",
        )
