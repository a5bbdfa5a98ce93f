"""What waits for the broker, in which order it goes, and what becomes of it. Pure: time is an argument.

The rules (contract, section 3):

1. Classes in order: retained topics; responses and events, and live samples, in turn where both wait, so that a flood
   of requests delays no sample; traces; the past. Within a class the oldest goes first.
2. Of a retained topic only the newest version waits, and no second version goes while the first is under way.
   After a connect the whole burst goes first; its `last` (availability) only when all of it is settled, and
   everything else only after that.
3. A sample that is older than 3 s when its turn comes belongs to the past, whose rules are in `past`; live samples
   never wait behind more than one array of it.
4. A letter leaves for ever when it is settled (PUBACK). A connection lost puts all that was under way back.
5. At most `capacity` samples wait in memory. Beyond that those go first that are only repeated, then the oldest,
   which are declared.
6. A refused letter is dead, and so is its topic until `reload()`. What does not fit the broker's limits is dead
   alone; an array is first cut smaller. A dead sample is declared like an evicted one.

====================  =========================  ============================  =========================
letter                settled                    connection lost               refused or too large
====================  =========================  ============================  =========================
`Retained`            gone                       gone (the burst renews it),   gone
                                                 a clearing one waits again
`Message`             gone                       waits again (QoS 0: gone)     gone
`Live`, `Array`       kept 10 s for a second     waits again                   declared
                      sending
`Declaration`         gone                       waits again                   waits for `reload()`
====================  =========================  ============================  =========================
"""

from __future__ import annotations

from collections import deque
from dataclasses import replace
from typing import TYPE_CHECKING

from lfs10d import telemetry
from lfs10d.mqtt.history import Kept
from lfs10d.mqtt.letters import Array, Letter, Live, Message, Retained, samples_of
from lfs10d.mqtt.past import Past
from lfs10d.mqtt.retention import Retention
from lfs10d.telemetry import Kind, Publication

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

CAPACITY = 10_000
"""Samples that wait in memory (contract, section 3)."""

LIVE_FOR = 3.0
"""Seconds after which a sample is history (contract, section 3)."""

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
        self._window = 0  # 0: not connected
        self._under_way: dict[Letter, None] = {}
        self._retention = Retention()
        self._messages: deque[Message] = deque(maxlen=MESSAGES_MOST)
        self._live: deque[Live] = deque()
        self._traces: deque[Message] = deque(maxlen=MESSAGES_MOST)
        self._message_went = False
        self._refused: set[str] = set()
        self._unfit: set[str] = set()
        self.past = Past(capacity=capacity, detection=detection)
        """What is no longer live."""

    # What comes in

    def add(
        self, publication: Publication, now: float, *, correlation: bytes | None = None, shift: int | None = None
    ) -> None:
        """Take one publication; while the broker is away only samples, events, responses and clearings stay.

        `shift` is the wall clock less the monotonic one now, in ms.
        """
        if publication.sample is not None:
            self._live.append(Live(publication, Kept(publication.sample, now, shift=shift)))
            self.age(now)
            self._make_room()
        elif publication.kind is Kind.RETAINED:
            if self._window or publication.payload is None:
                self._retention.add(publication)
        elif publication.kind is Kind.TRACE:
            if self._window:
                self._traces.append(Message(publication))
        else:
            self._messages.append(Message(publication, correlation))

    def burst(self, publications: Iterable[Publication], last: Publication) -> None:
        """Send all retained topics, then `last`, then everything else."""
        self._retention.burst(publications, last)

    # What happens to the connection

    def connected(self, now: float, *, window: int = IN_FLIGHT_MOST) -> None:
        """Begin to send: at most `window` letters under way at once. `burst` is to follow."""
        self._window = window
        self.past.connected(now)

    def lost(self, now: float) -> None:
        """Put back what was under way (rule 4), and remember to repeat what was acknowledged lately."""
        self._window = 0
        self._traces.clear()
        self._retention.lost()
        self.past.lost(now)
        under_way, self._under_way = list(self._under_way), {}
        for letter in reversed(under_way):
            self._put_back(letter)
        self._make_room()

    def _put_back(self, letter: Letter) -> None:
        match letter:
            case Retained():
                self._retention.put_back(letter)
            case Message(publication=publication):
                if publication.qos and len(self._messages) < MESSAGES_MOST:
                    self._messages.appendleft(letter)
            case Live():
                self._live.appendleft(letter)
            case _:
                self.past.put_back(letter)

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
        retained = self._retention.next(self._refused)
        if retained is not None or self._retention.first:
            return retained
        self.age(now)
        in_turn = (self._live, self._messages) if self._message_went else (self._messages, self._live)
        queues: tuple[deque[Message] | deque[Live], ...] = (*in_turn, self._traces)
        for queue in queues:
            while queue:
                letter = queue.popleft()
                if letter.topic not in self._refused:
                    self._message_went = queue is self._messages
                    return letter
                self.past.dead(letter)
        self._repeat(now)
        return self.past.next(now, self._refused, self.past.dead)

    @property
    def waits(self) -> bool:
        """Something may go, now or later; False: nothing before something is added."""
        return bool(self._retention or self._messages or self._live or self._traces) or self.due() is not None

    def due(self) -> float | None:
        """Return when `next` may have something though nothing happens before; None: not by time alone."""
        return self.past.due(self._refused) if self._window else None

    # What became of it

    def settled(self, letter: Letter, now: float, *, heard: bool = True) -> None:
        """Note that the broker has it; `heard`: it did not say that nobody listens."""
        self._over(letter)
        self._repeat(now)
        self.past.settled(letter, now, heard=heard)

    def refused(self, letter: Letter, reason: int) -> bool:
        """Note that the broker refused it with reason code >= 0x80; return True if its topic is to be reported."""
        self._over(letter)
        self.past.dead(letter)
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
            self.past.cut(letter)
            return False
        self.past.dead(letter)
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
            self._retention.over(letter)
        self.past.over(letter)

    def _repeat(self, now: float) -> None:
        """Let what may have been lost at the broker wait once more, from the moment the past is opened."""
        if self.past.repeat(now):
            self._make_room()

    # What waits

    @property
    def announced(self) -> bool:
        """We are connected, and the burst and its `last` are settled."""
        return self._window > 0 and self._retention.announced

    @property
    def retained_out(self) -> bool:
        """We are `announced`, and no version of a retained topic waits: who asks the broker now finds the newest."""
        return self.announced and not self._retention

    @property
    def idle(self) -> bool:
        """Nothing is under way, and nothing but the past waits."""
        return not (self._under_way or self._retention or self._messages or self._live)

    @property
    def under_way(self) -> tuple[Letter, ...]:
        """What is under way, in the order in which it was taken."""
        return tuple(self._under_way)

    @property
    def depth(self) -> int:
        """Samples that wait or are under way, those in the store included."""
        return self._in_memory() + self.past.stored.depth

    @property
    def dropped(self) -> int:
        """Samples that were lost since the start, declared or not."""
        return self.past.losses.total

    @property
    def backlog(self) -> telemetry.Backlog:
        """What `line/stats` says of it."""
        oldest_ts = self.past.stored.oldest()
        if oldest_ts is None:
            waiting = [*self._under_way_alone(), *self.past.waiting(), *(live.kept for live in list(self._live)[:1])]
            first = min(waiting, key=lambda kept: kept.since, default=None)
            oldest_ts = first.sample.ts if first else None
        return telemetry.Backlog(self.depth, oldest_ts, self.dropped)

    def _in_memory(self) -> int:
        """Return how many samples are in memory alone."""
        return len(self._live) + len(self.past) + sum(1 for _ in self._under_way_alone())

    def _under_way_alone(self) -> Iterator[Kept]:
        """Return the samples under way that are not in the store."""
        for letter in self._under_way:
            yield from (kept for kept in samples_of(letter) if kept.row is None)

    def next_old(self) -> float | None:
        """Return when the oldest live sample becomes history; None: there is none."""
        return self._live[0].kept.since + LIVE_FOR if self._live else None

    def age(self, now: float) -> None:
        """Let live samples that are too old for it wait with the past."""
        while self._live and now - self._live[0].kept.since > LIVE_FOR:
            self.past.history.add(self._live.popleft().kept)

    def _make_room(self) -> None:
        history = self.past.history
        while self._in_memory() > self._capacity and (history or self._live):
            kept = history.evict() if history else self._live.popleft().kept
            if kept is not None:
                self.past.losses.add(kept.sample)

    def not_spilled(self, now: float) -> None:
        """Let what the store could not take wait in memory, as far as there is room."""
        self.past.not_spilled(now)
        self._make_room()

    # The clock

    def correct(self, shift: int) -> None:
        """Give what waits the time that the clock tells now that it is synchronised; `shift` as in `add`."""
        self._live = deque(_corrected(live, shift) for live in self._live)
        self.past.correct(shift)


def _corrected(live: Live, shift: int) -> Live:
    kept = live.kept.at(shift)
    payload = live.publication.payload
    if kept is live.kept or not isinstance(payload, dict):
        return live
    sample = kept.sample
    told = {**payload, "ts": sample.ts, "time": telemetry.iso_time(sample.ts), "clock": sample.clock}
    return Live(replace(live.publication, payload=told, sample=sample), kept)
