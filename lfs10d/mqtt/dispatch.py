"""Carries letters from the outbox to a connection, and the broker's answers back.

Serialising is done here, once per message, in slices: the loop has others to serve.
"""

from __future__ import annotations

import asyncio
import logging
from typing import TYPE_CHECKING

from lfs10d import telemetry
from lfs10d.mqtt.encoding import array, encode, packet_size
from lfs10d.mqtt.endings import NO_MATCHING_SUBSCRIBERS, REFUSED_FROM, reason_in_words
from lfs10d.mqtt.letters import Array, Declaration, Message
from lfs10d.mqtt.outbox import IN_FLIGHT_MOST

if TYPE_CHECKING:
    from collections.abc import Callable

    from lfs10d.mqtt.connection import Connection
    from lfs10d.mqtt.letters import Letter, Live, Retained
    from lfs10d.mqtt.messages import Accepted
    from lfs10d.mqtt.outbox import Outbox
    from lfs10d.mqtt.topics import Topics

log = logging.getLogger(__name__)

LETTERS_AT_ONCE = 4
"""Letters handed to paho in one go of the loop, about 50 us each."""

SAMPLES_AT_ONCE = 16
"""Samples of a history array serialised in one go; a whole array would take a millisecond."""

ACKNOWLEDGED_WITHIN = 60.0
"""Seconds after which a broker that answers pings but acknowledges nothing is given up."""


class Dispatch:
    """`epoch_ms()` is the wall clock; `stuck()` is called when the connection is of no use."""

    def __init__(
        self,
        outbox: Outbox,
        topics: Topics,
        line: str,
        *,
        epoch_ms: Callable[[], int],
        stuck: Callable[[], None],
    ) -> None:
        self._outbox = outbox
        self._topics = topics
        self._line = line
        self._epoch_ms = epoch_ms
        self._stuck = stuck
        self._connection: Connection | None = None
        self._accepted: Accepted | None = None
        self._sent: dict[int, tuple[Letter, float]] = {}
        self._assembly: tuple[Array, list[bytes]] | None = None
        self._turn: asyncio.Handle | None = None
        self._sending = False
        self._alarm: asyncio.TimerHandle | None = None
        self._encoded: tuple[telemetry.Payload, bytes] = (None, b"")

    def connected(self, connection: Connection, accepted: Accepted) -> None:
        """Begin to send over this connection; `wake` is to follow."""
        self._connection = connection
        self._accepted = accepted
        self._outbox.connected(self._now(), window=min(IN_FLIGHT_MOST, accepted.receive_maximum))

    def lost(self) -> None:
        """Put back what is not acknowledged, and stop."""
        self._connection = self._accepted = self._assembly = None
        self._sent.clear()
        for handle in (self._turn, self._alarm):
            if handle is not None:
                handle.cancel()
        self._turn = self._alarm = None
        self._outbox.lost(self._now())

    def wake(self) -> None:
        """Send what there is to send: some at once, the rest soon."""
        if self._connection is not None and self._turn is None and not self._sending:
            self._send_some()

    def acknowledged(self, mid: int, reason: int) -> None:
        """Note the broker's answer to a message."""
        letter, _ = self._sent.pop(mid, (None, 0.0))
        if letter is None:
            return
        if reason < REFUSED_FROM:
            self._outbox.settled(letter, self._now(), heard=reason != NO_MATCHING_SUBSCRIBERS)
        elif self._outbox.refused(letter, reason):
            log.warning(
                "the broker refuses %s: %s; nothing more is sent there until a reload",
                self._topics.full(letter.topic),
                reason_in_words(reason),
            )
        if self._outbox.waits:
            self.wake()

    def _now(self) -> float:
        return asyncio.get_running_loop().time()

    def _send_some(self) -> None:
        self._turn = None
        self._sending = True
        if self._connection is not None:
            self._connection.cork(on=True)
        emptied = self._send_a_few()
        if self._connection is not None:
            self._connection.cork(on=False)
        self._sending = False
        if emptied:
            self._set_alarm()
        else:
            self._turn = asyncio.get_running_loop().call_soon(self._send_some)

    def _send_a_few(self) -> bool:
        """Send up to `LETTERS_AT_ONCE`; return whether nothing more may go now."""
        for _ in range(LETTERS_AT_ONCE):
            letter = self._outbox.next(self._now())
            if letter is None:
                return True
            if isinstance(letter, Array):
                self._assembly = (letter, [])
                asyncio.get_running_loop().call_soon(self._assemble, letter)
            else:
                self._send_encoded(letter)
        return False

    def _send_encoded(self, letter: Retained | Message | Live | Declaration) -> None:
        if isinstance(letter, Declaration):
            loss = letter.loss
            payload = telemetry.dropped(
                loss.device, loss.boot, loss.from_seq, loss.to_seq, count=loss.count, ts=self._epoch_ms()
            ).payload
        else:
            payload = letter.publication.payload
        try:
            encoded = self._encode(payload)
        except (TypeError, ValueError) as error:
            self._unfit(letter, f"cannot be written as JSON: {error}")
        else:
            self._send(letter, encoded)

    def _encode(self, payload: telemetry.Payload) -> bytes:
        """Return the bytes of a payload: a sample and the state that shows it are one object, and encoded once."""
        if payload is not self._encoded[0]:
            self._encoded = payload, encode(payload)
        return self._encoded[1]

    def _assemble(self, letter: Array) -> None:
        if self._assembly is None or self._assembly[0] is not letter:
            return  # the connection is another one now, and the samples wait again
        parts = self._assembly[1]
        for kept in letter.samples[len(parts) : len(parts) + SAMPLES_AT_ONCE]:
            parts.append(encode(kept.sample.payload(self._line, historical=True)))
        if len(parts) < len(letter.samples):
            asyncio.get_running_loop().call_soon(self._assemble, letter)
        else:
            self._assembly = None
            self._send(letter, array(parts))

    def _send(self, letter: Letter, payload: bytes) -> None:
        if self._connection is None or self._accepted is None:
            return
        topic = self._topics.full(letter.topic)
        retain, qos, correlation = False, 1, None
        if not isinstance(letter, Array | Declaration):
            retain, qos = letter.publication.retain, letter.publication.qos
        if isinstance(letter, Message):
            correlation = letter.correlation
        limit = self._accepted.maximum_packet_size
        if limit is not None:
            size = packet_size(topic, payload, version=self._accepted.version, qos=qos, correlation=correlation)
            if size > limit:
                self._unfit(letter, f"{size} bytes are more than the {limit} that the broker takes")
                return
        mid = self._connection.publish(topic, payload, qos=qos, retain=retain, correlation=correlation)
        if mid is not None:  # else it is under way until `lost`, which follows
            self._sent[mid] = (letter, self._now())

    def _unfit(self, letter: Letter, why: str) -> None:
        if self._outbox.unfit(letter):
            log.warning("not sent to %s: %s", self._topics.full(letter.topic), why)
        self.wake()

    def _set_alarm(self) -> None:
        """Come back when time alone brings something to send, or shows that the broker is stuck."""
        times = [at + ACKNOWLEDGED_WITHIN for _, at in list(self._sent.values())[:1]]
        due = self._outbox.due()
        if due is not None:
            times.append(due)
        if not times:
            return
        # One that comes too soon finds that out and is set anew: cheaper than to move it with every message.
        if self._alarm is not None:
            if self._alarm.when() <= min(times):
                return
            self._alarm.cancel()
        self._alarm = asyncio.get_running_loop().call_at(min(times), self._alarmed)

    def _alarmed(self) -> None:
        self._alarm = None
        oldest = next((at for _, at in self._sent.values()), None)
        if oldest is not None and self._now() - oldest >= ACKNOWLEDGED_WITHIN:
            self._stuck()
        else:
            self.wake()
