"""Keeps one connection to the broker: the shell around `Reconnect`.

It does not know what is sent: the daemon's uplink and the verbs of the command line are above it.
"""

from __future__ import annotations

import asyncio
import logging
import random
from collections.abc import Callable
from dataclasses import replace

from lfs10d.errors import BrokerError
from lfs10d.mqtt.connection import Connection
from lfs10d.mqtt.messages import Accepted, Events, Incoming, Will
from lfs10d.mqtt.reasons import Disconnect, DisconnectReason
from lfs10d.mqtt.reconnect import Reconnect
from lfs10d.mqtt.settings import BrokerSettings, Version

log = logging.getLogger(__name__)


class BrokerClient:
    """`events.accepted` and `events.ended` come in turn, once for each connection that stood.

    `explained()` tells whether a message of ours may be why the broker ends the connection that stands;
    `has_second()` whether there is one made by `beside`, for which the broker may do so. `connect` begins a
    connection; in virtual time it is one to a broker in memory.
    """

    def __init__(
        self,
        settings: BrokerSettings,
        events: Events,
        *,
        will: Will | None = None,
        chance: Callable[[], float] = random.random,
        explained: Callable[[], bool] = lambda: False,
        has_second: Callable[[], bool] = lambda: False,
        connect: type[Connection] = Connection,
    ) -> None:
        self._settings = settings
        self._nodes = settings.nodes
        self._events = events
        self._will = will
        self._chance = chance
        self._explained = explained
        self._has_second = has_second
        self._connect = connect
        self._reconnect = Reconnect(settings.version, chance, len(self._nodes))
        self._connection: Connection | None = None
        self._accepted: Accepted | None = None
        self._timer: asyncio.TimerHandle | None = None
        self._wanted = False
        self._logged: dict[str, str] = {}
        self._beside: tuple[int, ...] = ()
        """The nodes that are tried together with the first, until one answers."""
        self._warned_version = False
        self._waiters: list[asyncio.Future[Accepted]] = []
        self._over: asyncio.Event = asyncio.Event()

    @property
    def settings(self) -> BrokerSettings:
        """The settings in use: of several nodes those of the one that is connected or tried next."""
        return self._nodes[self._reconnect.node]

    @property
    def connection(self) -> Connection | None:
        """The connection that the broker has accepted; None where there is none."""
        return self._connection if self._accepted is not None else None

    @property
    def version(self) -> Version | None:
        """The version of MQTT in use; None without a connection."""
        return None if self._accepted is None else self._accepted.version

    @property
    def summary(self) -> str:
        """Whether the broker is connected, in words, with the node where there are several."""
        broker = self.settings.place if len(self._nodes) > 1 else "broker"
        return f"{broker} {'away' if self.connection is None else 'connected'}"

    @property
    def duplicate(self) -> bool:
        """Another client uses our id; False again once a connection has held for longer than we would have waited."""
        self._reconnect.held(self._now())
        return self._reconnect.duplicate

    def start(self) -> None:
        """Begin to connect, and again whenever the connection is lost."""
        self._wanted = True
        self._try()

    async def opened(self, within: float) -> Accepted:
        """Wait for the connection; raise BrokerError when no node accepts us or `within` seconds are over."""
        if self._accepted is not None:
            return self._accepted
        waiter = asyncio.get_running_loop().create_future()
        self._waiters.append(waiter)
        try:
            return await asyncio.wait_for(waiter, within)
        except TimeoutError:
            raise BrokerError(f"{self.settings.place}: no answer within {within:g} s") from None
        finally:
            self._waiters.remove(waiter)

    async def leave(self, within: float, *, will: bool = False) -> None:
        """Disconnect in order if the broker answers `within` seconds, else at once; stay away.

        `will`: close the connection without DISCONNECT, so that the broker publishes the will.
        """
        self._wanted = False
        if self._timer is not None:
            self._timer.cancel()
        connection = self.connection
        if will:
            self.drop("left without DISCONNECT")
        elif connection is not None:
            self._over.clear()
            connection.leave()
            try:
                await asyncio.wait_for(self._over.wait(), within)
            except TimeoutError:
                self.drop("the connection did not end in time")
        if self._connection is not None:
            self._connection.abandon()
            self._connection = None

    def drop(self, why: str) -> None:
        """Close the connection without DISCONNECT, as if it were lost."""
        if self._connection is not None:
            self._connection.abandon()
            self.ended(Disconnect(DisconnectReason.LOST, f"{self.settings.place}: {why}"))

    def missed(self) -> None:
        """Note that the broker had published our will before we came back."""
        self._reconnect.missed()

    def beside(self, events: Events, suffix: str) -> Connection:
        """Begin a second connection to the same node, without a will; its client id is ours with the suffix."""
        settings = replace(self.settings, client_id=f"{self.settings.client_id}{suffix}")
        return self._connect(settings, self._reconnect.version, events)

    def renew(self, settings: BrokerSettings) -> None:
        """Begin anew with other settings, after `leave`."""
        self._settings = settings
        self._nodes = settings.nodes
        self._reconnect = Reconnect(settings.version, self._chance, len(self._nodes))
        self._warned_version = False
        self.start()

    def _now(self) -> float:
        return asyncio.get_running_loop().time()

    def _try(self) -> None:
        self._timer = None
        now = self._now()
        self._reconnect.begun(now)
        beside = self._reconnect.beside(now)
        self._beside = tuple(number for number, _ in beside)
        others = tuple((node.host, node.port) for node in map(self._nodes.__getitem__, self._beside))
        settings = replace(self.settings, others=others, waits=tuple(wait for _, wait in beside))
        self._connection = self._connect(settings, self._reconnect.version, self, will=self._will)

    def _learn_node(self) -> tuple[str, ...]:
        """Note which of the nodes tried together answered; return those that failed with the first."""
        beside, self._beside = self._beside, ()
        race = None if self._connection is None or not beside else self._connection.race
        if race is None:
            return ()
        if race.node is None:
            self._reconnect.unreached(beside, self._now())
            return tuple(self._nodes[each].place for each in beside)
        self._reconnect.opened(self._nodes.index(race.node))
        for place, message in race.failures:
            self._log_once(place, message, f"{message}; trying {race.node.place} next")
        return ()

    # Events of the connection

    def accepted(self, accepted: Accepted) -> None:
        """Report that the connection is accepted."""
        self._accepted = accepted
        self._learn_node()
        self._reconnect.accepted(self._now())
        place = self.settings.place
        if accepted.version is not self._settings.version and not self._warned_version:
            self._warned_version = True
            log.warning("%s: refuses MQTT 5; connected by MQTT %s, which hides reason codes", place, accepted.version)
        else:
            log.info("%s: connected by MQTT %s", place, accepted.version)
        self._logged.clear()
        self._answer_waiters(accepted)
        self._events.accepted(accepted)

    def ended(self, ended: Disconnect) -> None:
        """Report that the connection ended, and try again when `Reconnect` says."""
        stood, self._accepted = self._accepted is not None, None
        beside = self._learn_node()
        self._connection = None
        self._over.set()
        now, place = self._now(), self.settings.place
        second = stood and self._has_second()
        explained = stood and ended.by_message and (second or self._explained())
        if second and ended.ending is DisconnectReason.TAKEN_OVER:  # by ourselves
            self._reconnect.ended(replace(ended, ending=DisconnectReason.LOST), now, explained=True)
        else:
            self._reconnect.ended(ended, now, explained=explained)
        if self._wanted:
            self._log_end(ended, place, self._reconnect.due - now, beside=beside)
            self._timer = asyncio.get_running_loop().call_at(self._reconnect.due, self._try)
        if stood:
            self._events.ended(ended)

    def _log_end(self, ended: Disconnect, place: str, delay: float, *, beside: tuple[str, ...]) -> None:
        if self._reconnect.version is not self._settings.version:
            log.debug("%s; trying MQTT %s", ended.message, self._reconnect.version)
            return
        others = "trying again until it works"
        if self._reconnect.duplicate:
            others = f"is another client using our id {self._settings.client_id}? trying again in {delay:.0f} s"
        elif self.settings.place != place and not beside:
            others = f"trying {self.settings.place} next"
        self._log_once(place, ended.message, f"{ended.message}; {others}")
        self._logged.update(dict.fromkeys(beside, ended.message))
        if len(self._logged) < len(self._nodes):
            return  # the others have not been tried
        self._answer_waiters(BrokerError(ended.message))

    def _log_once(self, place: str, message: str, words: str) -> None:
        """Log a warning about a node, unless it is the same as before."""
        log.log(logging.DEBUG if message == self._logged.get(place) else logging.WARNING, "%s", words)
        self._logged[place] = message

    def _answer_waiters(self, answer: Accepted | BrokerError) -> None:
        for waiter in self._waiters:
            if waiter.done():
                continue
            if isinstance(answer, BrokerError):
                waiter.set_exception(answer)
            else:
                waiter.set_result(answer)

    def acknowledged(self, mid: int, reason: int) -> None:
        """Pass it on."""
        self._events.acknowledged(mid, reason)

    def subscribed(self, mid: int, reasons: tuple[int, ...]) -> None:
        """Pass it on."""
        self._events.subscribed(mid, reasons)

    def arrived(self, message: Incoming) -> None:
        """Pass it on."""
        self._events.arrived(message)
