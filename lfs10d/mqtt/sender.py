"""Carries items from the outbox to a connection, and the broker's answers back.

Serialising is done here, once per message, in slices: the loop has others to serve.
"""

from __future__ import annotations

import asyncio
import logging
import time
from collections import deque
from collections.abc import Callable

from lfs10d.mqtt.batch_assembly import BatchAssembly, room_for_batch
from lfs10d.mqtt.connection import Connection
from lfs10d.mqtt.encoding import encode, packet_size
from lfs10d.mqtt.messages import Accepted
from lfs10d.mqtt.reasons import NO_MATCHING_SUBSCRIBERS, REFUSED_FROM, Disconnect, reason_in_words
from lfs10d.mqtt.topics import Topics
from lfs10d.outbox.items import HistoryBatch, LiveSample, LossNotice, Message, OutboxItem, Retained
from lfs10d.outbox.outbox import IN_FLIGHT_MOST, Outbox
from lfs10d.outbox.refusals import Refusal, refusal_of
from lfs10d.outbox.suspects import Culprit
from lfs10d.system.dataclass import dataclass
from lfs10d.telemetry import publication

log = logging.getLogger(__name__)

ITEMS_AT_ONCE = 4
"""Items handed to paho in one go of the loop, about 50 us each."""

ACKNOWLEDGED_WITHIN = 60.0
"""Seconds after which a broker that answers pings but acknowledges nothing is given up."""


UNPROVED_MOST = 64
"""Messages of QoS 0 that are remembered until a later message is acknowledged: then the broker has them too."""

NOT_AUTHORIZED = 0x87
"""Reason code of a publication that the broker's rules deny (MQTT 5.0, section 2.4)."""


@dataclass(frozen=True, slots=True)
class _Sent:
    """One message on its way, the `number`th of this connection: `size` bytes of payload, sent `at` (monotonic s)."""

    item: OutboxItem
    at: float
    size: int
    qos: int
    number: int


class Sender:
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
        self._sent: dict[int, _Sent] = {}
        self._number = 0
        self._acknowledged = 0
        self._unproved: deque[_Sent] = deque(maxlen=UNPROVED_MOST)
        self._swallowed: dict[str, int] = {}
        self._assembly: BatchAssembly | None = None
        self._turn: asyncio.Handle | None = None
        self._sending = False
        self._alarm: asyncio.TimerHandle | None = None
        self._encoded: tuple[publication.Payload, bytes] = (None, b"")
        self._now: Callable[[], float] = time.monotonic

    def connected(self, connection: Connection, accepted: Accepted) -> None:
        """Begin to send over this connection; `wake` is to follow."""
        self._connection = connection
        self._accepted = accepted
        self._now = asyncio.get_running_loop().time
        self._outbox.connected(self._now(), window=min(IN_FLIGHT_MOST, accepted.receive_maximum))

    def lost(self, ended: Disconnect) -> None:
        """Put back what is not acknowledged, and stop."""
        outbox, sent = self._outbox, self._swallowed or self.under_way
        culprit = None
        if ended.by_message or self._swallowed:
            culprit = outbox.suspects.ended(sent, certain=ended.reason is not None)
        self._connection = self._accepted = self._assembly = None
        self._sent.clear()
        self._unproved.clear()
        self._swallowed = {}
        self._number = self._acknowledged = 0
        for handle in (self._turn, self._alarm):
            if handle is not None:
                handle.cancel()
        self._turn = self._alarm = None
        outbox.lost(self._now(), culprit, denied=ended.reason == NOT_AUTHORIZED)
        if culprit is not None:
            self._report(culprit, ended)

    @property
    def under_way(self) -> dict[str, int]:
        """Messages under way: topics under `B`, each with the bytes of its largest message."""
        found: dict[str, int] = {}
        for each in (*self._sent.values(), *self._unproved):
            found[each.item.topic] = max(each.size, found.get(each.item.topic, 0))
        return found

    @property
    def explains_end(self) -> bool:
        """Whether a message is under way that was also under way when the previous connection ended."""
        return self._outbox.suspects.explain(self.under_way)

    def _report(self, culprit: Culprit, ended: Disconnect) -> None:
        banned = self._outbox.passes_over(culprit.topic)
        then = "nothing is sent there for an hour" if banned else "it is sent in smaller parts"
        log.warning("%s; again with a message of %d bytes to %s under way: %s",
                    ended.message, culprit.size, self._topics.full(culprit.topic), then)  # fmt: skip

    def wake(self) -> None:
        """Send the queue: some at once, the rest soon."""
        if self._connection is not None and self._turn is None and not self._sending:
            self._send_some()

    def acknowledged(self, mid: int, reason: int) -> None:
        """Note the broker's answer to a message."""
        sent = self._sent.pop(mid, None)
        if sent is None:
            return
        if not sent.qos:
            self._unproved.append(sent)  # it was written, that is all
        elif self._unproved or self._outbox.suspects.sizes:
            self._prove(sent)
        if sent.qos and sent.number > self._acknowledged:
            self._acknowledged = sent.number
        now = self._now()
        if reason < REFUSED_FROM:
            self._outbox.on_ack(sent.item, now, nobody_listens=reason == NO_MATCHING_SUBSCRIBERS)
        else:
            self._refused(sent, reason)
        congested = self._outbox.congested(now)
        if congested is not None:
            log.warning(
                "the connection to the broker carries about %.3g messages a second (round trip %.3g s, %d under way at "
                "most), fewer than are published: states come less often, and samples without room follow as history; "
                "see mqtt.telemetry, mqtt.state_every and poll.interval",
                congested.rate,
                congested.round_trip,
                congested.window,
            )
        if self._outbox.waits:
            self.wake()

    def _prove(self, acknowledged: _Sent) -> None:
        """Note that the broker took this message, and all before it, without ending the connection."""
        suspects = self._outbox.suspects
        suspects.acknowledged(acknowledged.item.topic, acknowledged.size)
        while self._unproved and self._unproved[0].number < acknowledged.number:
            proved = self._unproved.popleft()
            suspects.acknowledged(proved.item.topic, proved.size)

    def _refused(self, sent: _Sent, reason: int) -> None:
        item, refusal = sent.item, refusal_of(reason)
        topic, words = self._topics.full(item.topic), reason_in_words(reason)
        if refusal is Refusal.UNFIT:
            if self._outbox.unfit(item):
                log.warning(
                    "the broker refuses a message of %d bytes to %s: %s; it is dropped", sent.size, topic, words
                )
        elif self._outbox.refused(item, reason, self._now()):
            again = "in a second, then less often" if refusal is Refusal.LATER else "after the next connect or a reload"
            log.warning("the broker refuses %s: %s; it is tried again %s", topic, words, again)

    def _send_some(self) -> None:
        self._turn = None
        self._sending = True
        now = self._now()
        items, emptied = self._take_some(now)
        connection = self._connection if len(items) > 1 else None  # one alone needs no cork
        if connection is not None:
            connection.cork(on=True)
        for item in items:
            self._send_encoded(item, now)
        if connection is not None:
            connection.cork(on=False)
        self._sending = False
        if emptied:
            self._set_alarm()
        else:
            self._turn = asyncio.get_running_loop().call_soon(self._send_some)

    def _take_some(self, now: float) -> tuple[list[Retained | Message | LiveSample | LossNotice], bool]:
        """Take up to `ITEMS_AT_ONCE`; return those to be sent now, and whether nothing more may go then."""
        items: list[Retained | Message | LiveSample | LossNotice] = []
        for _ in range(ITEMS_AT_ONCE):
            item = self._outbox.next(now, batch=self._assembly is None)
            if item is None:
                return items, True
            if isinstance(item, HistoryBatch):
                room = room_for_batch(self._topics.full(item.topic), self._accepted)
                self._assembly = BatchAssembly(item, room)
                asyncio.get_running_loop().call_soon(self._assemble, self._assembly)
            else:
                items.append(item)
        return items, False

    def _send_encoded(self, item: Retained | Message | LiveSample | LossNotice, now: float) -> None:
        if isinstance(item, LossNotice):
            loss = item.loss
            payload = publication.dropped(
                loss.source, loss.boot, loss.from_seq, loss.to_seq, count=loss.count, ts=self._epoch_ms()
            ).payload
        else:
            payload = item.publication.payload
        try:
            encoded = self._encode(payload)
        except (TypeError, ValueError) as error:
            self._unfit(item, f"cannot be written as JSON: {error}")
        else:
            self._send(item, encoded, now)

    def _encode(self, payload: publication.Payload) -> bytes:
        """Return the bytes of a payload: a sample and the state that shows it are one object, and encoded once."""
        if payload is not self._encoded[0]:
            self._encoded = payload, encode(payload)
        return self._encoded[1]

    def _assemble(self, assembly: BatchAssembly) -> None:
        if assembly is not self._assembly:
            return  # the connection is another one now, and the samples wait again
        count = assembly.serialise_some(self._line)
        if count is not None:
            assembly.batch = self._outbox.shorten(assembly.batch, count)
        if assembly.complete:
            self._assembly = None
            self._send(assembly.batch, assembly.payload, self._now())
        else:
            asyncio.get_running_loop().call_soon(self._assemble, assembly)

    def _send(self, item: OutboxItem, payload: bytes, now: float) -> None:
        if self._connection is None or self._accepted is None:
            return
        topic = self._topics.full(item.topic)
        retain, qos, correlation = False, 1, None
        if not isinstance(item, (HistoryBatch, LossNotice)):
            retain, qos = item.publication.retain, item.publication.qos
        if isinstance(item, Message):
            correlation = item.correlation
        if self._outbox.suspects.alone and self._outbox.suspects.goes_alone(item.topic):
            qos = 1  # its acknowledgement clears it
        limit = self._accepted.maximum_packet_size
        if limit is not None:
            size = packet_size(topic, payload, version=self._accepted.version, qos=qos, correlation=correlation)
            if size > limit:
                self._unfit(item, f"{size} bytes are more than the {limit} that the broker takes")
                return
        mid = self._connection.publish(topic, payload, qos=qos, retain=retain, correlation=correlation)
        if mid is not None:  # else it is under way until `lost`, which follows
            self._number += 1
            self._sent[mid] = _Sent(item, now, len(payload), qos, self._number)

    def _unfit(self, item: OutboxItem, why: str) -> None:
        if self._outbox.unfit(item):
            log.warning("not sent to %s: %s", self._topics.full(item.topic), why)
        self.wake()

    def _set_alarm(self) -> None:
        """Set a timer for the next message that is due by time, or for a broker that is stuck."""
        due, oldest = self._outbox.due(), next(iter(self._sent.values()), None)
        if oldest is not None and (due is None or oldest.at + ACKNOWLEDGED_WITHIN < due):
            due = oldest.at + ACKNOWLEDGED_WITHIN
        if due is None:
            return
        # One that comes too soon finds that out and is set anew: cheaper than to move it with every message.
        if self._alarm is not None:
            if self._alarm.when() <= due:
                return
            self._alarm.cancel()
        self._alarm = asyncio.get_running_loop().call_at(due, self._alarmed)

    def _alarmed(self) -> None:
        self._alarm = None
        oldest = next(iter(self._sent.values()), None)
        if oldest is not None and self._now() - oldest.at >= ACKNOWLEDGED_WITHIN:
            # A broker acknowledges in order: what it acknowledged something later than, it has swallowed.
            swallowed = (sent for sent in self._sent.values() if sent.number < self._acknowledged)
            self._swallowed = {sent.item.topic: sent.size for sent in swallowed}
            self._stuck()
        else:
            self.wake()
