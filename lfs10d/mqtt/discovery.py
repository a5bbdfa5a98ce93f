"""Home Assistant's discovery at the broker: announced after each connect, at each change and at its birth message.

After a connect the broker is first asked what we announced before, so that what is no longer there is taken back: under
every prefix where something may be left, and nowhere else. What to publish is decided in
`lfs10d.telemetry.homeassistant`.
"""

from __future__ import annotations

import asyncio
import logging
import random
from collections.abc import Callable, Iterable, Mapping

from lfs10d.mqtt.connection import Connection
from lfs10d.mqtt.messages import Filter, Incoming
from lfs10d.mqtt.reasons import REFUSED_FROM, reason_in_words
from lfs10d.mqtt.topics import Topics
from lfs10d.telemetry.homeassistant.discovery import Announced, Platforms, Transition, platforms, transition
from lfs10d.telemetry.homeassistant.search import DiscoverySearch
from lfs10d.telemetry.publication import ELSEWHERE, Publication, retained

log = logging.getLogger(__name__)

BIRTH = b"online"
AFTER_BIRTH = 5.0
"""Seconds within which all is announced anew when Home Assistant has started: not by every gateway at once."""
TAKEN_IN = 2.0
"""Seconds that Home Assistant is given to remove an entity before the payload without it follows."""


class Discovery:
    """Used in the thread of the asyncio loop. `publish` sends; `is_out()`: nothing retained waits to be sent."""

    def __init__(
        self,
        topics: Topics,
        publish: Callable[[Iterable[Publication]], None],
        *,
        is_out: Callable[[], bool],
        chance: Callable[[], float] = random.random,
    ) -> None:
        self._topics = topics
        self._publish = publish
        self._is_out = is_out
        self._chance = chance
        self._prefix = ""
        self._prefixes: frozenset[str] = frozenset()
        self._on_prefixes: Callable[[frozenset[str]], None] = lambda _: None
        self._wanted: Mapping[str, Announced] = {}
        self._then: dict[str, Announced] = {}
        self._known: dict[str, Platforms] | None = None
        """The announced payloads, by full topic; None while unknown."""
        self._connection: Connection | None = None
        self._search: DiscoverySearch | None = None
        self._to_search: list[tuple[str, bool]] = []
        """Prefixes, and whether to look for all devices or for the line alone."""
        self._found: dict[str, Platforms] = {}
        self._searched: set[str] = set()
        """Prefixes that were searched and had nothing of ours."""
        self._subscription: int | None = None
        self._birth: asyncio.TimerHandle | None = None
        self._taken_in: asyncio.TimerHandle | None = None

    @property
    def _status(self) -> str:
        return f"{self._prefix}/status"

    def remember(self, prefixes: frozenset[str], on_change: Callable[[frozenset[str]], None]) -> None:
        """Take the prefixes that earlier runs used; `on_change` gets those to remember for later runs.

        Before `configure`.
        """
        self._prefixes, self._on_prefixes = prefixes, on_change

    def configure(self, prefix: str, wanted: Mapping[str, Announced]) -> None:
        """Take the payloads by full topic, none if discovery is off; publish those that changed."""
        before, self._wanted = self._wanted, wanted
        moved = prefix != self._prefix or bool(wanted) is not bool(before)
        left, self._prefix = self._status, prefix
        if wanted:
            self._know(self._prefixes | {prefix})
        known = {topic: platforms(each) for topic, each in before.items()} if self._known is None else self._known
        gone = {topic: known[topic] for topic in known if topic not in wanted}
        if self._known is None or moved:
            self._perform(transition(gone, {}))
            if moved and self._connection is not None:
                self._connection.unsubscribe([left])
                self.begin(self._connection)
        else:
            changed = {topic: payload for topic, payload in wanted.items() if before.get(topic) != payload}
            stay = {topic: known[topic] for topic in known if topic in changed}
            self._perform(transition({**stay, **gone}, changed))

    def republish(self) -> int:
        """Announce everything again; return the number of payloads."""
        if self._known is not None:
            self._send({topic: payload for topic, payload in self._wanted.items() if topic not in self._then})
        return len(self._wanted)

    # -- events of the connection

    def begin(self, connection: Connection | None) -> None:
        """Read earlier announcements over this connection, then announce the wanted ones."""
        self.lost()
        if connection is None:
            return
        self._connection = connection
        announced = {self._prefix} if self._wanted else set()
        others = sorted(self._prefixes - announced)
        self._to_search = [(self._prefix, True)] * len(announced) + [(each, False) for each in others]
        self._ask_next(connection)

    def lost(self) -> None:
        """Note that the connection is lost: everything begins again with the next."""
        self._connection = self._search = self._subscription = self._known = None
        self._then, self._found, self._searched = {}, {}, set()
        for timer in (self._birth, self._taken_in):
            if timer is not None:
                timer.cancel()
        self._birth = self._taken_in = None

    def subscribed(self, mid: int, reasons: tuple[int, ...]) -> None:
        """Take the broker's answer to a subscription."""
        if self._search is None or mid != self._subscription:
            return
        for topic, reason in zip((self._search.filter, self._status), reasons, strict=False):
            if reason >= REFUSED_FROM and self._wanted:
                log.warning("the broker refuses to let us subscribe to %s: %s", topic, reason_in_words(reason))
        if reasons and reasons[0] >= REFUSED_FROM:
            self._search.is_refused = True
            self._end(self._search)

    def on_message(self, message: Incoming) -> bool:
        """Take a message; return whether it was for discovery."""
        if self._wanted and message.topic == self._status:
            if message.payload == BIRTH and self._birth is None:
                self._birth = self._loop.call_later(AFTER_BIRTH * self._chance(), self._on_birth)
            return True
        if self._search is None or not message.retained:
            return False
        return self._search.on_message(message.topic, message.payload, self._loop.time())

    # -- what follows

    def _ask_next(self, connection: Connection) -> None:
        """Read the next prefix at the broker; after the last one announce the wanted payloads."""
        if not self._to_search:
            self._search, self._known = None, {}
            gone = self._found.keys() - self._wanted.keys()
            if gone:
                log.info("clearing %d devices from Home Assistant", len(gone))
            announced = {self._prefix} if self._wanted else set()
            self._know(self._prefixes - (self._searched - announced))
            self._perform(transition(self._found, self._wanted))
            return
        prefix, wide = self._to_search.pop(0)
        search = self._search = DiscoverySearch(prefix, self._topics.base, self._loop.time(), wide)
        # Without retain_as_published the flag tells what was retained before, and nothing else.
        filters = [Filter(search.filter, qos=0, retain_as_published=False, no_local=True)]
        if self._wanted and prefix == self._prefix:
            filters.append(Filter(self._status))
        self._subscription = connection.subscribe(filters)
        self._loop.call_at(search.due, self._end, search)

    def _end(self, search: DiscoverySearch) -> None:
        connection = self._connection
        if connection is None or search is not self._search:
            return
        if self._loop.time() < search.due:
            self._loop.call_at(search.due, self._end, search)
            return
        connection.unsubscribe([search.filter])
        self._found.update(search.found)
        if search.found and not search.wide:
            self._to_search.insert(0, (search.prefix, True))
        elif not (search.found or search.is_refused):
            self._searched.add(search.prefix)
        self._ask_next(connection)

    def _know(self, prefixes: frozenset[str]) -> None:
        """Remember the prefixes under which something of ours may be retained."""
        if prefixes != self._prefixes:
            self._prefixes = prefixes
            self._on_prefixes(prefixes)

    def _perform(self, steps: Transition) -> None:
        for topic in steps.first:
            self._then.pop(topic, None)
        self._then.update(steps.then)
        self._send(steps.first)
        if steps.then and self._taken_in is None:
            self._taken_in = self._loop.call_later(TAKEN_IN, self._on_taken_in)

    def _on_taken_in(self) -> None:
        """Publish the payloads without the removed entities, once their removal has been sent."""
        self._taken_in = None
        if not self._is_out():
            self._taken_in = self._loop.call_later(TAKEN_IN, self._on_taken_in)
            return
        then, self._then = self._then, {}
        self._send(then)

    def _on_birth(self) -> None:
        self._birth = None
        self.republish()

    def _send(self, payloads: Mapping[str, Announced | None]) -> None:
        if self._known is not None:
            others = {topic: each for topic, each in self._known.items() if topic not in payloads}
            self._known = others | {topic: platforms(each) for topic, each in payloads.items() if each is not None}
        self._publish([retained(f"{ELSEWHERE}{topic}", payload) for topic, payload in payloads.items()])

    @property
    def _loop(self) -> asyncio.AbstractEventLoop:
        return asyncio.get_running_loop()
