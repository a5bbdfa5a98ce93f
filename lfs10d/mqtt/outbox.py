"""What waits for the broker, in which order it goes, and what becomes of it. Pure: time is an argument.

The rules (contract, section 3):

1. Classes in order: retained topics; responses and events; live samples; traces; the past. Within a class the
   oldest goes first.
2. Of a retained topic only the newest version waits, and no second version goes while the first is under way.
   After a connect the whole burst goes first; its `last` (availability) only when all of it is settled, and
   everything else only after that.
3. A sample that is older than 3 s when its turn comes goes on `history` instead: one device and one boot per
   array, in order of seq, one array under way at a time and at most ten a second, so that live samples never
   wait behind more than one array.
4. The past is opened 10 s after a connect: subscribers come back later than we do. First what was lost is
   declared, then the backlog goes. What was acknowledged from 10 s before a loss of the connection until then
   goes once more, because an acknowledgement of a broker that dies is not durable.
5. A letter leaves for ever when it is settled (PUBACK). A connection lost puts all that was under way back.
6. At most `capacity` samples wait. Beyond that those go first that are only repeated, then the oldest, which
   are declared.
7. A refused letter is dead, and so is its topic until `reload()`. What does not fit the broker's limits is dead
   alone; an array is first cut smaller. A dead sample is declared like an evicted one.

====================  =========================  ============================  =========================
letter                settled                    connection lost               refused or too large
====================  =========================  ============================  =========================
`Retained`            gone                       gone (the burst renews it),   gone
                                                 a clearing one waits again
`Message`             gone                       waits again (QoS 0: gone)     gone
`Live`, `Array`       kept 10 s for rule 4       waits again                   declared
`Declaration`         gone                       waits again                   waits for `reload()`
====================  =========================  ============================  =========================
"""

from __future__ import annotations

from collections import deque
from dataclasses import replace
from typing import TYPE_CHECKING

from lfs10d import telemetry
from lfs10d.mqtt.history import History, Kept
from lfs10d.mqtt.letters import Array, Declaration, Letter, Live, Message, Retained, samples_of
from lfs10d.mqtt.losses import Losses
from lfs10d.telemetry import Kind, Publication

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

CAPACITY = 10_000
"""Samples that wait in memory (contract, section 3)."""

LIVE_FOR = 3.0
"""Seconds after which a sample is history (contract, section 3)."""

ARRAY_MOST = 100
"""Samples in one history array (contract, section 3)."""

ARRAY_EVERY = 0.1
"""Seconds from one history array to the next: the bounded rate of the contract, 1000 samples a second."""

PAST_AFTER = 10.0
"""Seconds after a connect at which the past is opened; also how far back of a loss is sent again."""

MESSAGES_MOST = 1000
"""Responses and events that wait while the broker is away; and traces while it is slow."""

IN_FLIGHT_MOST = 20
"""Letters under way; mosquitto's own default for `max_inflight_messages`."""

TRANSIENT_REASONS = frozenset({0x91, 0x97})
"""Packet identifier in use, quota exceeded (MQTT 5.0, section 3.4.2.1): say nothing about the topic."""


class Outbox:
    """The rules above. `detection`: seconds in which a dead connection is noticed at the latest."""

    def __init__(self, *, capacity: int = CAPACITY, detection: float = 40.0) -> None:
        self._capacity = capacity
        self._detection = detection
        self._window = 0  # 0: not connected
        self._under_way: dict[Letter, None] = {}
        self._retained: dict[str, Retained] = {}
        self._messages: deque[Message] = deque(maxlen=MESSAGES_MOST)
        self._live: deque[Live] = deque()
        self._traces: deque[Message] = deque(maxlen=MESSAGES_MOST)
        self._history = History()
        self._losses = Losses()
        self._burst: set[str] = set()
        self._last: Retained | None = None
        self._closing: Retained | None = None  # the `last` that is not settled yet
        self._past_from = 0.0
        self._array_at = 0.0
        self._array_most = ARRAY_MOST
        self._acknowledged: deque[tuple[float, Kept]] = deque(maxlen=capacity)
        self._repeat = False
        self._refused: set[str] = set()
        self._unfit: set[str] = set()

    # What comes in

    def add(self, publication: Publication, now: float, *, correlation: bytes | None = None) -> None:
        """Take one publication; while the broker is away only samples, events, responses and clearings stay."""
        if publication.sample is not None:
            self._live.append(Live(publication, Kept(publication.sample, now)))
            self._age(now)
            self._make_room()
        elif publication.kind is Kind.RETAINED:
            if self._window or publication.payload is None:
                self._retained[publication.topic] = Retained(publication)
        elif publication.kind is Kind.TRACE:
            if self._window:
                self._traces.append(Message(publication))
        else:
            self._messages.append(Message(publication, correlation))

    def burst(self, publications: Iterable[Publication], last: Publication) -> None:
        """Send all retained topics, then `last`, then everything else."""
        for publication in publications:
            self._retained[publication.topic] = Retained(publication)
            self._burst.add(publication.topic)
        self._last = self._closing = Retained(last)

    # What happens to the connection

    def connected(self, now: float, *, window: int = IN_FLIGHT_MOST) -> None:
        """Begin to send: at most `window` letters under way at once. `burst` is to follow."""
        self._window = window
        self._past_from = now + PAST_AFTER
        self._array_at = self._past_from
        self._array_most = ARRAY_MOST
        self._losses.connected()

    def lost(self, now: float) -> None:
        """Put back what was under way (rule 5), and remember to repeat what was acknowledged lately (rule 4)."""
        self._window = 0
        if not self._repeat:
            self._forget(now - PAST_AFTER - self._detection)
        self._repeat = True
        self._traces.clear()
        self._burst.clear()
        self._last = self._closing = None
        self._retained = {topic: each for topic, each in self._retained.items() if each.publication.payload is None}
        under_way, self._under_way = list(self._under_way), {}
        for letter in reversed(under_way):
            self._put_back(letter)

    def _put_back(self, letter: Letter) -> None:
        match letter:
            case Retained(publication=publication):
                if publication.payload is None:
                    self._retained.setdefault(letter.topic, letter)
            case Message(publication=publication):
                if publication.qos and len(self._messages) < MESSAGES_MOST:
                    self._messages.appendleft(letter)
            case Live():
                self._live.appendleft(letter)
            case Array(samples=samples):
                self._history.extend(samples)
            case _:
                self._losses.restore(letter.loss)

    # What goes out

    def next(self, now: float) -> Letter | None:
        """Take what goes next; it is under way until settled, refused, unfit or lost. None: nothing goes now."""
        if len(self._under_way) >= self._window:
            return None
        letter = self._next(now)
        if letter is not None:
            self._under_way[letter] = None
        return letter

    def _next(self, now: float) -> Letter | None:
        retained = self._next_retained()
        if retained is not None or self._last is not None:
            return retained
        self._age(now)
        for queue in (self._messages, self._live, self._traces):
            while queue:
                letter = queue.popleft()
                if letter.topic not in self._refused:
                    return letter
                self._dead(letter)
        return self._next_past(now)

    def _next_retained(self) -> Retained | None:
        busy = {each.topic for each in self._under_way if isinstance(each, Retained)}
        for topic in list(self._retained):
            if topic in self._refused:
                del self._retained[topic]
                self._burst.discard(topic)
            elif topic not in busy:
                return self._retained.pop(topic)
        if self._burst or self._last is None or self._last.topic in busy:
            return None
        last, self._last = self._last, None
        if last.topic not in self._refused:
            return last
        self._closing = None
        return None

    def _next_past(self, now: float) -> Array | Declaration | None:
        if now < self._past_from or any(isinstance(each, Array | Declaration) for each in self._under_way):
            return None
        if self._repeat:
            self._repeat = False
            self._history.extend(replace(kept, repeated=True) for _, kept in self._acknowledged)
            self._acknowledged.clear()
            self._make_room()
        if telemetry.EVENT not in self._refused:
            loss = self._losses.take(now)
            if loss is not None:
                return Declaration(loss)
        if now < self._array_at:
            return None
        while samples := self._history.take(self._array_most):
            array = Array(samples)
            if array.topic not in self._refused:
                self._array_at = now + ARRAY_EVERY
                return array
            self._dead(array)
        return None

    def due(self) -> float | None:
        """Return when `next` may have something though nothing happens before; None: not by time alone."""
        if not self._window or any(isinstance(each, Array | Declaration) for each in self._under_way):
            return None
        declared = self._losses.due() if telemetry.EVENT not in self._refused else None
        times = [] if declared is None else [declared]
        if self._history or (self._repeat and self._acknowledged):
            times.append(self._array_at)
        return max(self._past_from, min(times)) if times else None

    # What became of it

    def settled(self, letter: Letter, now: float) -> None:
        """Note that the broker has it."""
        self._over(letter)
        if not self._repeat:
            self._forget(now - PAST_AFTER)
        self._acknowledged.extend((now, kept) for kept in samples_of(letter))

    def refused(self, letter: Letter, reason: int) -> bool:
        """Note that the broker refused it with reason code >= 0x80; return True if its topic is to be reported."""
        self._over(letter)
        self._dead(letter)
        if reason in TRANSIENT_REASONS or letter.topic in self._refused:
            return False
        self._refused.add(letter.topic)
        return True

    def unfit(self, letter: Letter) -> bool:
        """Note that it can never be sent as it is; return True if its topic is to be reported.

        An array is cut in two and waits again, and so do the arrays after it on this connection.
        """
        self._over(letter)
        if isinstance(letter, Array) and len(letter.samples) > 1:
            self._array_most = len(letter.samples) // 2
            self._array_at = 0.0
            self._history.extend(letter.samples)
            return False
        self._dead(letter)
        if letter.topic in self._unfit:
            return False
        self._unfit.add(letter.topic)
        return True

    def reload(self) -> bool:
        """Try again what was refused before, and report anew; return True if a topic was refused."""
        refused = bool(self._refused)
        self._refused.clear()
        self._unfit.clear()
        return refused

    def _over(self, letter: Letter) -> None:
        del self._under_way[letter]
        if isinstance(letter, Retained):
            self._burst.discard(letter.topic)
        if letter is self._closing:
            self._closing = None

    def _dead(self, letter: Letter) -> None:
        if isinstance(letter, Declaration):
            self._losses.restore(letter.loss)
        for kept in samples_of(letter):
            if not kept.repeated:
                self._losses.add(kept.sample)

    # What waits

    @property
    def announced(self) -> bool:
        """We are connected, and the burst and its `last` are settled."""
        return self._window > 0 and self._closing is None

    @property
    def idle(self) -> bool:
        """Nothing is under way, and nothing but the past waits."""
        waiting = self._retained or self._messages or self._live or self._last
        return not self._under_way and not waiting

    @property
    def under_way(self) -> tuple[Letter, ...]:
        """What is under way, in the order in which it was taken."""
        return tuple(self._under_way)

    @property
    def depth(self) -> int:
        """Samples that wait or are under way."""
        return len(self._live) + len(self._history) + sum(1 for _ in self._samples_under_way())

    @property
    def dropped(self) -> int:
        """Samples that were lost since the start, declared or not."""
        return self._losses.total

    @property
    def backlog(self) -> telemetry.Backlog:
        """What `line/stats` says of it."""
        oldest = self._history.oldest()
        waiting = [*self._samples_under_way(), *([oldest] if oldest else [])]
        if self._live:
            waiting.append(self._live[0].kept)
        first = min(waiting, key=lambda kept: kept.since, default=None)
        return telemetry.Backlog(self.depth, first.sample.ts if first else None, self.dropped)

    def _samples_under_way(self) -> Iterator[Kept]:
        for letter in self._under_way:
            yield from samples_of(letter)

    def _age(self, now: float) -> None:
        while self._live and now - self._live[0].kept.since > LIVE_FOR:
            self._history.add(self._live.popleft().kept)

    def _make_room(self) -> None:
        while self.depth > self._capacity and (self._history or self._live):
            kept = self._history.evict() if self._history else self._live.popleft().kept
            if kept is not None:
                self._losses.add(kept.sample)

    def _forget(self, before: float) -> None:
        while self._acknowledged and self._acknowledged[0][0] < before:
            self._acknowledged.popleft()
