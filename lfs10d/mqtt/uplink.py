"""The daemon's session at the broker: will, bursts, requests, and cleanup of old topics.

After a connect: subscribe to requests and to our own availability; every retained topic; when the broker has them
all, availability `online`; then live samples; then clear the retained topics of devices that are no longer
configured, which are read over a second connection; 10 s later the backlog. Nothing here blocks. `Outbox`,
`Reconnect` and `OrphanSearch` decide.
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Awaitable, Callable, Iterable, Mapping
from collections.abc import Set as AbstractSet
from functools import partial

from lfs10d.mqtt.broker_client import BrokerClient
from lfs10d.mqtt.clean_exit import CleanExit
from lfs10d.mqtt.cleanup import Cleanup
from lfs10d.mqtt.connection import Connection
from lfs10d.mqtt.discovery import Discovery
from lfs10d.mqtt.messages import Accepted, Filter, Incoming, Will
from lfs10d.mqtt.reasons import REFUSED_FROM, Disconnect, reason_in_words
from lfs10d.mqtt.retained_reader import RetainedReader
from lfs10d.mqtt.retained_requests import RetainedRequests
from lfs10d.mqtt.sender import Sender
from lfs10d.mqtt.settings import BrokerSettings, Version
from lfs10d.mqtt.topics import OFFLINE, ONLINE, Topics
from lfs10d.mqtt.uplink_events import OnRequest, OnSpoolTrouble, UplinkEvents
from lfs10d.outbox.backlog import HISTORY_AFTER
from lfs10d.outbox.outbox import Outbox
from lfs10d.outbox.spooler import Spooler
from lfs10d.outbox.store.database import Limits
from lfs10d.outbox.store.store import Store
from lfs10d.system.clock_step import ClockState
from lfs10d.telemetry import publication as telemetry
from lfs10d.telemetry.publication import Publication, PublicationKind

log = logging.getLogger(__name__)

KEEP_WITHIN = 0.6
"""Seconds of a clean exit for the disk to keep what the broker did not take."""

_ONLINE = telemetry.retained(telemetry.AVAILABILITY, ONLINE)
_OFFLINE = telemetry.retained(telemetry.AVAILABILITY, OFFLINE)


class Uplink:
    """Built and called in the thread of the asyncio loop, while it runs.

    `base` is `B`, whose last level is the line's name. `epoch_ms()` is the wall clock; `connect` is as in
    `BrokerClient`. What waits is kept in the `store`, if one is given.
    """

    def __init__(
        self,
        settings: BrokerSettings,
        *,
        base: str,
        epoch_ms: Callable[[], int],
        store: Store | None = None,
        connect: type[Connection] = Connection,
        history_wait: float = HISTORY_AFTER,
    ) -> None:
        self._topics = Topics(base)
        self._events: UplinkEvents  # given at the start
        self._on_request: OnRequest  # given at the start
        self._cleanup: Cleanup  # built at the start
        self._retained_requests = RetainedRequests(self._ask_for_retained_requests)
        self._announcing = self._leaving = self._drop_told = False
        self._client = BrokerClient(
            settings,
            self,
            will=Will(self._topics.availability, OFFLINE.encode()),
            explained=lambda: self._sender.explains_end,
            has_second=lambda: self._cleanup.has_second,
            connect=connect,
        )
        self._outbox = Outbox(detection=2.0 * settings.keepalive, history_wait=history_wait)
        self.discovery = Discovery(self._topics, self.publish, is_out=lambda: self._outbox.retained_out)
        line = base.rpartition("/")[2]
        self._sender = Sender(self._outbox, self._topics, line, epoch_ms=epoch_ms, stuck=self._on_stuck)
        self._subscription: int | None = None
        self._clean_exit = CleanExit(self._client, self._outbox, self._sender.wake)
        self._epoch_ms, self._store = epoch_ms, store
        self._spooler: Spooler | None = None
        self._retained_reader: RetainedReader | None = None
        self.requests_denied = False
        """The broker refused the subscription to requests: none will come over this connection."""

    @property
    def connected(self) -> bool:
        """The broker has accepted us."""
        return self._client.connection is not None

    @property
    def version(self) -> Version | None:
        """The version of MQTT that is spoken; None while not connected."""
        return self._client.version

    @property
    def summary(self) -> str:
        """Whether the broker is connected, in words, with the node where there are several."""
        return self._client.summary

    @property
    def duplicate(self) -> bool:
        """Whether another client uses our client id: `duplicate_client`."""
        return self._client.duplicate

    @property
    def backlog(self) -> telemetry.BacklogStats:
        """The backlog, for `line/stats`."""
        return self._outbox.stats

    async def start(self, events: UplinkEvents, *, on_request: OnRequest, on_spool_trouble: OnSpoolTrouble) -> None:
        """Begin to connect; earlier publications wait."""
        self._events, self._on_request = events, on_request
        self._cleanup = Cleanup(self._topics, self.publish, owned=events.topics, connect=self._client.beside)
        if self._store is not None:
            self._spooler = Spooler(
                self._outbox,
                self._store,
                epoch_ms=self._epoch_ms,
                wake=self._sender.wake,
                on_trouble=on_spool_trouble,
                publish=lambda event: self.publish([event]),
            )
            self._spooler.start()
        self._client.start()

    def read_back(self, wanted: AbstractSet[str], on_found: Callable[[Mapping[str, bytes]], Awaitable[None]]) -> None:
        """Read these retained topics under `B` before the first burst is published over them; before `start`.

        `on_found` is given what was found, and the burst waits for it; at most 5 s for what the broker says.
        """
        self._retained_reader = RetainedReader(self._topics, wanted, on_found)

    def send_samples(self, *, telemetry: bool) -> None:
        """Take whether samples are sent: `telemetry`, and as `history` what waits; the rest is sent in any case."""
        self._outbox.send_samples(telemetry=telemetry)
        self._sender.wake()

    def limit(self, limits: Limits) -> None:
        """Take other limits for what is kept on disk."""
        if self._spooler is not None:
            self._spooler.limit(limits)

    def synchronised(self) -> None:
        """Note that the wall clock is right now: what waits is given the time it should have had."""
        self._correct("synced")

    def stepped(self) -> None:
        """Note that the wall clock was set by hand: what waits from before is corrected, and marked `unsynced`."""
        self._correct("unsynced")

    def _correct(self, clock: ClockState) -> None:
        shift = self._shift(asyncio.get_running_loop().time())
        self._outbox.correct(shift, clock)
        if self._spooler is not None:
            self._spooler.correct(shift, clock)

    def _shift(self, now: float) -> int:
        """Return the wall clock less the monotonic one, in ms."""
        return self._epoch_ms() - round(now * 1000)

    def _poke(self) -> None:
        if self._spooler is not None:
            self._spooler.poke()

    async def stop(self) -> None:
        """Send what waits, say `offline`, disconnect, keep the rest; at most 1.9 s, whatever broker and disk do."""
        self._leaving = True
        await self._clean_exit.run(_OFFLINE)
        if self._spooler is not None:
            await self._spooler.stop(KEEP_WITHIN)

    async def reload(self, settings: BrokerSettings | None = None) -> None:
        """Try again what the broker refused, clear what is no longer ours; connect anew if given settings."""
        refused = self._outbox.reload(asyncio.get_running_loop().time())
        if settings is not None:
            self._leaving = True
            await self._clean_exit.run(_OFFLINE)
            self._leaving = False
            self._cleanup.single = False
            self._client.renew(settings)
            return
        self._cleanup.wanted = True
        if refused:
            self.republish()
        else:
            self._clear_if_out()

    def republish(self) -> None:
        """Send every retained topic again."""
        if self.connected:
            self._outbox.burst(self._events.burst(), _ONLINE)
            self._sender.wake()

    def publish(self, publications: Iterable[Publication]) -> None:
        """Send publications, or keep them while the broker is away."""
        now, backlog = asyncio.get_running_loop().time(), self._outbox.backlog
        shift, dropped = self._shift(now), backlog.losses.total
        for publication in publications:
            self._outbox.add(publication, now, shift=shift)
        if backlog.losses.total > dropped and not self._drop_told:
            self._drop_told = True
            log.warning("more samples wait for the broker than there is room for: the oldest are dropped")
        self._sender.wake()
        if backlog.spill.away or (backlog.history.count and backlog.spill.due() is not None):
            self._poke()

    def respond(self, topic: str, payload: telemetry.Payload, correlation: bytes | None = None) -> None:
        """Answer a request on `topic` (under `B`), by MQTT 5 with its Correlation Data."""
        response = Publication(topic, payload, PublicationKind.RESPONSE, retain=False, qos=1)
        self._outbox.add(response, asyncio.get_running_loop().time(), correlation=correlation)
        self._sender.wake()

    def clear_retained(self, topic: str) -> None:
        """Clear a retained topic under `B`, a retained request for example."""
        self.publish([telemetry.retained(topic, None)])

    # Events of the client

    def accepted(self, accepted: Accepted) -> None:
        """Read our retained topics back, if that is wanted; then subscribe, and send the burst."""
        connection, reader = self._client.connection, self._retained_reader
        if connection is not None and reader is not None and not reader.over:
            reader.begin(connection, partial(self._begin, accepted))
        else:
            self._begin(accepted)

    def _begin(self, accepted: Accepted) -> None:
        if (connection := self._client.connection) is None:
            return
        self._sender.connected(connection, accepted)
        self._subscription = connection.subscribe([Filter(self._topics.requests), Filter(self._topics.availability)])
        self.requests_denied = False
        self._outbox.burst(self._events.burst(), _ONLINE)
        self._announcing = self._cleanup.wanted = True
        self._sender.wake()
        self._poke()
        self._events.on_uplink_change()

    def ended(self, ended: Disconnect) -> None:
        """Keep what is not acknowledged."""
        log.debug("%s", ended.message)
        self._sender.lost(ended)
        if self._retained_reader is not None:
            self._retained_reader.lost()
        self._cleanup.lost(ended)
        self.discovery.lost()
        self._retained_requests.lost()
        self._drop_told = False
        self._clean_exit.on_progress()
        self._poke()
        self._events.on_uplink_change()

    def acknowledged(self, mid: int, reason: int) -> None:
        """Send the messages that may go now."""
        self._sender.acknowledged(mid, reason)
        if self._outbox.backlog.spool.rows:
            self._poke()
        if (self._announcing or self._cleanup.wanted) and self._outbox.announced:
            if self._announcing:
                self._announcing = False
                self._events.on_announced()
                self.discovery.begin(self._client.connection)
            self._clear_if_out()
        if self._leaving:
            self._clean_exit.on_progress()

    def subscribed(self, mid: int, reasons: tuple[int, ...]) -> None:
        """Report a refused subscription."""
        if self._retained_reader is not None:
            self._retained_reader.subscribed(mid, reasons)
        self.discovery.subscribed(mid, reasons)
        self._cleanup.subscribed(mid)
        if mid == self._subscription:
            self.requests_denied = bool(reasons) and reasons[0] >= REFUSED_FROM
            for topic, reason in zip((self._topics.requests, self._topics.availability), reasons, strict=False):
                if reason >= REFUSED_FROM:
                    log.warning("the broker refuses to let us subscribe to %s: %s", topic, reason_in_words(reason))
            self._events.on_uplink_change()

    def arrived(self, message: Incoming) -> None:
        """Take a request, an `offline` about us, or a retained topic."""
        if message.topic == self._topics.availability:
            if message.payload == OFFLINE.encode() and not self._leaving:
                self._on_offline()
            return
        if self._retained_reader is not None:
            self._retained_reader.arrived(message)
        if self._cleanup.on_message(message) or self.discovery.on_message(message):
            return
        if (request := self._topics.command(message)) is not None:
            self._retained_requests.received(request, self.version)
            self._on_request(request)

    def _ask_for_retained_requests(self) -> None:
        if (connection := self._client.connection) is not None:
            connection.subscribe([Filter(self._topics.requests)])

    def _on_offline(self) -> None:
        """Contradict the will of our earlier connection, or another client; the burst will do so by itself."""
        if self._outbox.announced:
            self.publish([_ONLINE])
        else:
            self._client.missed()

    def _on_stuck(self) -> None:
        self._client.drop("no acknowledgement for 60 s")

    def _clear_if_out(self) -> None:
        if self._cleanup.wanted and self._outbox.retained_out:
            self._cleanup.begin(self._client.connection)
