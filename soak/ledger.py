"""Every sample accounted for by (device, boot, seq): what is lost, wrong, out of order or there twice. Pure.

Memory stays bounded: what arrived is kept as stretches of seq, contents of the last ones only, and a life of the
daemon that has been silent for an hour is judged and forgotten.
"""

from __future__ import annotations

from bisect import bisect_right
from collections import Counter, OrderedDict
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field

REMEMBERED = 12_000
"""Contents kept per device and boot to compare a duplicate with: more than the daemon keeps in memory."""

FOLDED_AFTER = 3600.0
"""Seconds after which a life that says nothing more is judged and forgotten."""

KILLED_MOST = 8.0
"""Seconds of samples that a SIGKILL may cost: 3 s of youth and 5 s between two commits (docs/decisions/0004)."""

SLACK = 1.0
"""Seconds added to that: the hole's neighbours lie outside it."""

EXAMPLES = 20


@dataclass(frozen=True, slots=True)
class Told:
    """One sample as the subscriber heard it; `ts` is epoch ms."""

    device: str
    boot: str
    seq: int
    ts: int
    value: float | None
    error: str | None
    quality: str
    historical: bool


@dataclass(slots=True)
class Stretch:
    """Samples `first` to `last`, all of them heard, with the `ts` of both."""

    first: int
    last: int
    since: int
    until: int


@dataclass(frozen=True, slots=True)
class Hole:
    """Samples `first` to `last` that were not heard; `seconds` between its neighbours."""

    first: int
    last: int
    seconds: float

    @property
    def count(self) -> int:
        """How many they are."""
        return self.last - self.first + 1


@dataclass(slots=True)
class Series:
    """What was heard of one device in one life of the daemon."""

    stretches: list[Stretch] = field(default_factory=list)
    declared: list[tuple[int, int, int]] = field(default_factory=list)
    """From, to and count of the `dropped` events."""
    newest: dict[bool, int] = field(default_factory=dict)
    """The newest new seq of this connection, live and historical."""
    contents: OrderedDict[int, tuple[object, ...]] = field(default_factory=OrderedDict)
    news: float = 0.0

    def holds(self, seq: int) -> bool:
        """Tell whether this sample was heard."""
        place = bisect_right(self.stretches, seq, key=lambda one: one.first) - 1
        return place >= 0 and seq <= self.stretches[place].last

    def add(self, seq: int, ts: int) -> None:
        """Note a sample not heard before."""
        place = bisect_right(self.stretches, seq, key=lambda one: one.first)
        new = Stretch(seq, seq, ts, ts)
        if place and self.stretches[place - 1].last == seq - 1:
            before = self.stretches.pop(place - 1)
            new = Stretch(before.first, seq, before.since, ts)
            place -= 1
        if place < len(self.stretches) and self.stretches[place].first == seq + 1:
            after = self.stretches.pop(place)
            new = Stretch(new.first, after.last, new.since, after.until)
        self.stretches.insert(place, new)

    def holes(self, started: float) -> list[Hole]:
        """Return what is missing between 1 and the last heard; `started` (epoch s) is when seq began."""
        found, last, until = [], 0, started * 1000
        for one in self.stretches:
            if one.first > last + 1:
                found.append(Hole(last + 1, one.first - 1, (one.since - until) / 1000))
            last, until = one.last, one.until
        return found


@dataclass(frozen=True, slots=True)
class Life:
    """One process of the daemon, epoch seconds; `killed` by SIGKILL."""

    started: float
    ended: float | None = None
    killed: bool = False


class Ledger:
    """Takes samples in order of arrival. `counts` by word; `findings` are the first of each, for a person.

    `fault_of(told)` says what is wrong with a sample, None if nothing: the oracle.
    """

    FAULTS = ("lost", "wrong", "changed", "disordered", "unjudged")

    def __init__(self, fault_of: Callable[[Told], str | None]) -> None:
        self.counts: Counter[str] = Counter()
        self.findings: list[str] = []
        self.killed_seconds = 0.0
        """The longest time lost of one device by one SIGKILL, between samples that were heard."""
        self._fault_of = fault_of
        self._series: dict[tuple[str, str], Series] = {}
        self._folded: OrderedDict[tuple[str, str], None] = OrderedDict()

    @property
    def failed(self) -> bool:
        """Whether anything is not as promised."""
        return any(self.counts[word] for word in self.FAULTS)

    def told(self, told: Told, now: float) -> None:
        """Account for one sample; `now` is monotonic seconds."""
        key = (told.device, told.boot)
        if key in self._folded:
            self._find("unjudged", f"{told}: it comes an hour after the last of its life")
            return
        series = self._series.setdefault(key, Series())
        series.news = now
        self.counts["heard"] += 1
        if told.seq < 1:
            self._find("wrong", f"{told}: seq begins at 1")
            return
        if series.holds(told.seq):
            self._again(series, told)
            return
        if told.seq < series.newest.get(told.historical, 0):
            self._find("disordered", f"{told}: after seq {series.newest[told.historical]} on the same connection")
        series.newest[told.historical] = told.seq
        series.add(told.seq, told.ts)
        series.contents[told.seq] = _content(told)
        if len(series.contents) > REMEMBERED:
            series.contents.popitem(last=False)
        self._judge(told)

    def _judge(self, told: Told) -> None:
        self.counts["samples"] += 1
        self.counts["history"] += told.historical
        bad = told.quality == "bad" and told.value is None and bool(told.error)
        if not bad and (told.quality != "good" or told.value is None or told.error is not None):
            self._find("wrong", f"{told}: value, quality and error do not fit each other")
            return
        self.counts["bad" if bad else "good"] += 1
        fault = self._fault_of(told)
        if fault is not None:
            self._find("wrong", f"{told}: {fault}")

    def _again(self, series: Series, told: Told) -> None:
        self.counts["duplicates"] += 1
        content = series.contents.get(told.seq)
        if content is None:
            self._find("unjudged", f"{told}: heard before, too long ago to compare")
        elif content != _content(told):
            self._find("changed", f"{told}: heard before as {content}")

    def dropped(self, device: str, boot: str, first: int, last: int, count: int) -> None:
        """Note a `dropped` event: `count` samples between these seqs will never come."""
        self.counts["dropped events"] += 1
        declared = self._series.setdefault((device, boot), Series()).declared
        if (first, last, count) not in declared:
            declared.append((first, last, count))

    def reconnected(self) -> None:
        """Let the order begin anew: the daemon has a new connection, where it may repeat."""
        for series in self._series.values():
            series.newest.clear()

    def fold(self, lives: Iterable[Life], now: float) -> None:
        """Judge and forget what has said nothing for an hour."""
        silent = [key for key, series in self._series.items() if now - series.news > FOLDED_AFTER]
        self._close(silent, list(lives))

    def close(self, lives: Iterable[Life]) -> None:
        """Judge all that is left: nothing more will come."""
        self._close(list(self._series), list(lives))

    def _close(self, keys: list[tuple[str, str]], lives: list[Life]) -> None:
        for key in keys:
            series = self._series.pop(key)
            self._folded[key] = None
            if len(self._folded) > REMEMBERED:
                self._folded.popitem(last=False)
            self._close_one(key, series, lives)

    def _close_one(self, key: tuple[str, str], series: Series, lives: list[Life]) -> None:
        life = _life_of(series, lives)
        holes = series.holes(life.started if life is not None else 0.0)
        declared = Counter[str]()
        open_holes = []
        for hole in holes:
            room = sum(
                min(count, min(last, hole.last) - max(first, hole.first) + 1)
                for first, last, count in series.declared
                if first <= hole.last and last >= hole.first
            )
            declared["samples"] += min(room, hole.count)
            if room < hole.count:
                open_holes.append(hole)
        self.counts["declared"] += declared["samples"]
        seconds = sum(hole.seconds for hole in open_holes)
        if open_holes and life is not None and life.killed and seconds <= KILLED_MOST + SLACK:
            self.counts["killed with it"] += sum(hole.count for hole in open_holes)
            self.killed_seconds = max(self.killed_seconds, seconds)
            return
        for hole in open_holes:
            self.counts["lost"] += hole.count - 1
            self._find("lost", f"{key[0]}, boot {key[1]}: seq {hole.first} to {hole.last} ({hole.seconds:.1f} s)")

    def _find(self, word: str, text: str) -> None:
        self.counts[word] += 1
        if self.counts[f"{word} told"] < EXAMPLES:
            self.counts[f"{word} told"] += 1
            self.findings.append(f"{word}: {text}")


def _content(told: Told) -> tuple[object, ...]:
    return (told.ts, told.value, told.error, told.quality)


def _life_of(series: Series, lives: list[Life]) -> Life | None:
    """Return the process these samples are of, by their time."""
    if not series.stretches:
        return None
    since = series.stretches[0].since / 1000
    return next((life for life in reversed(lives) if life.started <= since), None)
