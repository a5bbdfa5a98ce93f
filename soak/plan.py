"""What is done to the daemon, its broker and its line, and when: drawn from a seed, known before it begins. Pure.

A *step* is one disturbance with its end; it is made of *acts* at times. Steps follow each other with calm between
them, so that each can be recovered from; smaller ones are laid into larger ones. Rules:

- A subscriber is back within 10 s of the broker: a shorter absence may fall into anything, a longer one needs a
  broker that stays.
- The daemon is killed either in calm, or with a backlog and the subscriber there. What a broker acknowledged and did
  not hand on before it died lives in the daemon's memory alone; two deaths at once are nobody's promise.
- The daemon lives long enough between two ends for its memory to be judged.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from enum import StrEnum
from random import Random

HOUR = 3600.0
FIRST_AFTER = 4.0
"""Seconds of calm at the beginning: the daemon connects and finds its sensors."""


class Act(StrEnum):
    """One thing done at one moment."""

    BROKER_KILL = "broker: SIGKILL"
    BROKER_END = "broker: SIGTERM"
    BROKER_START = "broker: started, without sessions and retained messages"
    BROKER_STOP = "broker: SIGSTOP"
    BROKER_GO_ON = "broker: SIGCONT"
    EAR_AWAY = "subscriber: leaves"
    EAR_BACK = "subscriber: comes back"
    PORT_PULL = "port: pulled"
    PORT_BACK = "port: back as another terminal"
    RELOAD = "daemon: another interval in the file, SIGHUP"
    DAEMON_END = "daemon: SIGTERM"
    DAEMON_KILL = "daemon: SIGKILL"
    DAEMON_START = "daemon: started"


class Kind(StrEnum):
    """One disturbance from its beginning to its end."""

    BROKER_KILLED = "broker killed"
    BROKER_AWAY = "broker away until the backlog is on disk"
    BROKER_RESTARTED = "broker restarted"
    BROKER_STOPPED = "broker stopped"
    BROKER_HUNG = "broker stopped for longer than the keepalive"
    EAR_AWAY = "subscriber away"
    PORT_PULLED = "port pulled"
    RELOAD = "reload"
    DAEMON_ENDED = "daemon ended"
    DAEMON_KILLED = "daemon killed in calm"
    DAEMON_KILLED_WITH_BACKLOG = "daemon killed while the broker is away"
    DAEMON_ENDED_WITH_BACKLOG = "daemon ended while the broker is away"


ENDS_THE_DAEMON = frozenset(
    {Kind.DAEMON_ENDED, Kind.DAEMON_KILLED, Kind.DAEMON_KILLED_WITH_BACKLOG, Kind.DAEMON_ENDED_WITH_BACKLOG}
)
LASTS = {
    Kind.BROKER_KILLED: (0.0, 6.0),
    Kind.BROKER_AWAY: (10.0, 30.0),
    Kind.BROKER_RESTARTED: (0.0, 2.0),
    Kind.BROKER_STOPPED: (1.0, 8.0),
    Kind.BROKER_HUNG: (18.0, 30.0),
    Kind.EAR_AWAY: (1.0, 20.0),
    Kind.PORT_PULLED: (0.2, 8.0),
    Kind.RELOAD: (0.0, 0.0),
    Kind.DAEMON_ENDED: (0.0, 3.0),
    Kind.DAEMON_KILLED: (0.0, 3.0),
    Kind.DAEMON_KILLED_WITH_BACKLOG: (15.0, 30.0),
    Kind.DAEMON_ENDED_WITH_BACKLOG: (6.0, 20.0),
}
"""Shortest and longest (s)."""

LONGEST_ABSENCE = 600.0
"""Seconds the broker is away now and then in a soak of more than an hour."""

SHORTEST_LIFE = 120.0
"""Seconds of a life that is long enough to be judged (`soak.gauges`)."""

CALM_BEFORE_KILL = 35.0
"""Seconds without other steps before the daemon is killed in calm: until the second sending is over."""

_EDGES: dict[Kind, tuple[Act, Act]] = {
    Kind.BROKER_KILLED: (Act.BROKER_KILL, Act.BROKER_START),
    Kind.BROKER_AWAY: (Act.BROKER_KILL, Act.BROKER_START),
    Kind.BROKER_RESTARTED: (Act.BROKER_END, Act.BROKER_START),
    Kind.BROKER_STOPPED: (Act.BROKER_STOP, Act.BROKER_GO_ON),
    Kind.BROKER_HUNG: (Act.BROKER_STOP, Act.BROKER_GO_ON),
    Kind.EAR_AWAY: (Act.EAR_AWAY, Act.EAR_BACK),
    Kind.PORT_PULLED: (Act.PORT_PULL, Act.PORT_BACK),
    Kind.DAEMON_ENDED: (Act.DAEMON_END, Act.DAEMON_START),
    Kind.DAEMON_KILLED: (Act.DAEMON_KILL, Act.DAEMON_START),
    Kind.DAEMON_KILLED_WITH_BACKLOG: (Act.BROKER_KILL, Act.BROKER_START),
    Kind.DAEMON_ENDED_WITH_BACKLOG: (Act.BROKER_KILL, Act.BROKER_START),
}


@dataclass(frozen=True, slots=True)
class Due:
    """An act and its time, seconds from the start of the soak."""

    at: float
    act: Act


@dataclass(frozen=True, slots=True)
class Step:
    """A disturbance; `within` are the acts of smaller ones laid into it. Times are seconds from the start."""

    at: float
    kind: Kind
    lasts: float
    within: tuple[Due, ...] = ()

    @property
    def ends(self) -> float:
        """When all of it is over."""
        return max(self.at + self.lasts, *(due.at for due in self.within), self.at)

    def acts(self) -> list[Due]:
        """Return what is done, in order."""
        if self.kind is Kind.RELOAD:
            return [Due(self.at, Act.RELOAD)]
        first, last = _EDGES[self.kind]
        acts = [Due(self.at, first), *self.within, Due(self.at + self.lasts, last)]
        if self.kind in (Kind.DAEMON_KILLED_WITH_BACKLOG, Kind.DAEMON_ENDED_WITH_BACKLOG):
            killed = self.kind is Kind.DAEMON_KILLED_WITH_BACKLOG
            acts.append(Due(self.at + 0.8 * self.lasts, Act.DAEMON_KILL if killed else Act.DAEMON_END))
            acts.append(Due(self.at + 0.9 * self.lasts, Act.DAEMON_START))
        return sorted(acts, key=lambda due: due.at)

    def __str__(self) -> str:
        """Return one line of the plan."""
        within = "".join(f"; {due.at:.1f} s {due.act.value}" for due in self.within)
        return f"{self.at:9.1f} s  {self.kind.value}, {self.lasts:.1f} s{within}"


def shortest_life(seconds: float) -> float:
    """Return how long the daemon lives at least, in a soak of so many seconds, before it is ended again."""
    return min(max(seconds / 6, SHORTEST_LIFE), 6 * HOUR)


def steps(seed: int, seconds: float) -> Iterator[Step]:
    """Yield the steps of a soak in order; all of them are over by `seconds`. The same seed, the same steps."""
    random = Random(seed)  # noqa: S311  # repeatable, no secret
    at, free_from = FIRST_AFTER, shortest_life(seconds) if seconds > 2 * SHORTEST_LIFE else FIRST_AFTER
    bag: list[Kind] = []
    ends: list[Kind] = []
    while True:
        bag = bag or _shuffled(random, [*(set(Kind) - ENDS_THE_DAEMON), Kind.BROKER_KILLED, Kind.PORT_PULLED])
        ends = ends or _shuffled(random, ENDS_THE_DAEMON)
        kind = (ends if at >= free_from else bag).pop()
        calm = CALM_BEFORE_KILL if kind is Kind.DAEMON_KILLED and at > FIRST_AFTER else 0.0
        step = _step(random, at + calm, kind, seconds)
        if step.ends > seconds:
            if at + 1.0 > seconds or not bag:
                return
            continue
        yield step
        if kind in ENDS_THE_DAEMON:
            free_from = step.ends + shortest_life(seconds)
        at = step.ends + random.uniform(1.0, 12.0 if seconds <= HOUR else 60.0)


def _shuffled(random: Random, kinds: Iterable[Kind]) -> list[Kind]:
    """Return the kinds in an order that the seed alone decides."""
    ordered = sorted(kinds)
    random.shuffle(ordered)
    return ordered


def _step(random: Random, at: float, kind: Kind, seconds: float) -> Step:
    shortest, longest = LASTS[kind]
    if kind is Kind.BROKER_AWAY and seconds > HOUR and random.random() < 0.1:  # noqa: PLR2004  # now and then
        longest = LONGEST_ABSENCE
    lasts = random.uniform(shortest, longest)
    return Step(at, kind, lasts, _within(random, at, kind, lasts))


def _within(random: Random, at: float, kind: Kind, lasts: float) -> tuple[Due, ...]:
    """Lay something small into the step, every other time."""
    if kind in ENDS_THE_DAEMON or kind is Kind.RELOAD or random.random() < 0.5:  # noqa: PLR2004  # every other
        return ()
    begins = at + random.uniform(0.0, lasts)
    ends = begins + random.uniform(0.2, 4.0)
    choices: list[tuple[Act, ...]] = [(Act.RELOAD,)]
    if kind is not Kind.PORT_PULLED:
        choices.append((Act.PORT_PULL, Act.PORT_BACK))
    if kind is not Kind.EAR_AWAY:
        choices.append((Act.EAR_AWAY, Act.EAR_BACK))
    chosen = random.choice(choices)
    return tuple(Due(when, act) for when, act in zip((begins, ends), chosen, strict=False))
