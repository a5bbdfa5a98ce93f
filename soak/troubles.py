"""The family of bad lines: what can ail a sensor, its wires and its neighbours, and what the contract calls it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from random import Random
from typing import TypeAlias

from lfs10d.simulator.faults import Window
from lfs10d.simulator.line_faults import babble, stray
from lfs10d.simulator.wire import nanoseconds
from soak.virtual import DaemonInMemory
from tests.support.faulty_sensors import add_fault
from tests.support.second_masters import passing_master

Particulars: TypeAlias = "Mapping[str, float]"
Begin: TypeAlias = "Callable[[DaemonInMemory, float], None]"
"""Lets a trouble of the whole line begin now and last for so long (s)."""

STRANGER = 200
"""A slave id that nobody on the line has, and nobody polls."""
POLLED = 3
"""Whom the second master asks too."""


@dataclass(frozen=True)
class Fault:
    """One fault alone. `first` is the code of the first bad sample, `also` what may follow; no code: all good.

    `faults` are of one sensor, `begin` of the whole line. `must`: codes that have to be seen. `neighbours`: codes
    that the others may show. With `also` there may be good samples besides.
    `in_pieces`: what may come instead where the adapter delivers in pieces, whose pauses look like silence.
    """

    first: frozenset[str] = frozenset()
    also: frozenset[str] = frozenset()
    must: frozenset[str] = frozenset()
    faults: Mapping[str, Particulars] | None = None
    begin: Begin | None = None
    neighbours: frozenset[str] = frozenset()
    in_pieces: frozenset[str] = frozenset()


def _codes(words: str) -> frozenset[str]:
    return frozenset(words.split())


def _ill(first: str = "", also: str = "", must: str = "", neighbours: str = "", **faults: Particulars) -> Fault:
    return Fault(_codes(first), _codes(also), _codes(must or first), faults, neighbours=_codes(neighbours))


def _stray(daemon: DaemonInMemory, seconds: float) -> None:
    now = daemon.clock.now
    window = Window(nanoseconds(now), nanoseconds(now + seconds))
    stray(daemon.line, 0.3, length=2, delay=0.0005, window=window)


def _babble(daemon: DaemonInMemory, seconds: float) -> None:
    babble(daemon.line, daemon.clock.now + 0.01, daemon.clock.now + seconds)


def _second_master(daemon: DaemonInMemory, seconds: float) -> None:
    now = daemon.clock.now
    leave = passing_master(daemon.line, bytes((POLLED, 3, 0, 1, 0, 2)), now + 0.01, 0.37)
    daemon.line.at(now + seconds, lambda _: leave())


def _unplugged(daemon: DaemonInMemory, seconds: float) -> None:
    daemon.line.at(daemon.clock.now + 0.01, lambda _: daemon.port.unplug())
    daemon.line.at(daemon.clock.now + seconds, lambda _: daemon.port.replug())


LATE = "timeout late malformed crc collision"
"""A late answer may run into the next request (a changed echo is a collision) or its answer, and so break it; into
the first too, where a barrier was before it."""
STRUCK = "timeout late malformed crc collision wrong_slave wrong_function"
"""Where two speak at once anything but a wrong value may come of it."""


def _late(delay: float, also: str = "", **faults: Particulars) -> Fault:
    """Return one that is late: whether its polls fail, and how, depends on the time-out, and that is learned."""
    return Fault(
        _codes(LATE + also), _codes(LATE + also), faults={"late": {"delay": delay}, **faults},
        neighbours=_codes(LATE),
    )  # fmt: skip


def _second(kind: str, delay: int) -> Fault:
    """Return one to whose requests a second answer comes after so many ms: it may run into what neighbours are sent."""
    return Fault(_codes(STRUCK), _codes(STRUCK), faults={kind: {"delay": delay / 1000}}, neighbours=_codes(STRUCK))


FAMILY: Mapping[str, Fault] = {
    "silent": _ill("timeout", silent={}),
    "late, in the same shape": _late(1.3),
    "late by a little": _late(0.25),
    "late, in another shape": _late(1.3, " exception", exception={}),
    "byte by byte": _ill(slow_bytes={"delay": 0.004}),
    "a flipped bit": _ill("crc", noisy={}),
    "garbage": _ill("crc", garbage={}),
    "garbage that is too short": _ill("malformed", garbage={"length": 4}),
    # Of so many bytes some may look like another master's request: a collision.
    "garbage that is too long": _ill("crc", "collision", garbage={"length": 60}),
    "cut short": _ill("malformed", truncated={"length": 5}),
    "another slave's id": _ill("wrong_slave", wrong_id={"value": STRANGER}),
    "another function": _ill("wrong_function", wrong_function={}),
    "another count": Fault(_codes("malformed late"), faults={"wrong_count": {}}),  # a barrier's is late
    "noise before the answer": _ill(leading_noise={}),
    "noise behind the answer": _ill(trailing_noise={}),
    "not a number": _ill("not_finite", nan={}),
    "infinity": _ill("not_finite", infinite={}),
    "out of range": _ill("out_of_range", out_of_range={}),
    "subnormal": _ill("out_of_range", subnormal={}),
    **{f"exception {code:02}": _ill("exception", exception={"code": code}) for code in (1, 2, 3, 4, 6, 11)},
    **{f"a twin after {delay} ms": _second("twin", delay) for delay in (5, 37, 100)},
    **{f"a repeater after {delay} ms": _second("repeated", delay) for delay in (5, 37, 100)},
    "a gateway whose target answers late": Fault(
        _codes("exception"), _codes("exception " + LATE), _codes("exception"), {"gateway": {"delay": 0.1}},
        neighbours=_codes(LATE),
    ),
    "stray bytes": Fault(begin=_stray),
    "babble": Fault(_codes("collision"), _codes(LATE), _codes("collision"), begin=_babble, neighbours=_codes(LATE),
                    in_pieces=_codes(STRUCK)),
    "a second master": Fault(_codes(STRUCK), _codes(STRUCK), begin=_second_master, neighbours=_codes(STRUCK)),
    "unplugged": Fault(_codes("port_lost"), must=_codes("port_lost"), begin=_unplugged,
                       neighbours=_codes("port_lost")),
}  # fmt: skip
"""Echo and pieces of 16 ms are the adapter's, for the whole of a life."""

KINDS: Mapping[str, Particulars] = {
    "silent": {},
    "shy": {},
    "late": {"delay": 0.4},
    "slow_bytes": {"delay": 0.003},
    "noisy": {},
    "garbage": {},
    "truncated": {},
    "leading_noise": {},
    "trailing_noise": {},
    "wrong_id": {"value": STRANGER},
    "wrong_function": {},
    "wrong_count": {},
    "exception": {"code": 6},
    "nan": {},
    "infinite": {},
    "out_of_range": {},
    "subnormal": {},
    "hangs": {},
    "twin": {"delay": 0.037},
    "repeated": {"delay": 0.02},
    "gateway": {"delay": 0.1},
}
"""What is mixed. The id of a sensor that is polled is never borrowed: such a frame is right by construction."""

RATES = (0.01, 0.1, 0.3, 0.7)


def mix(daemon: DaemonInMemory, random: Random, seconds: float) -> str:
    """Let anything ail any sensor and the line for so long (s), as drawn; return it in words."""
    words: list[str] = []
    for sensor in daemon.line.sensors:
        for kind in random.sample(sorted(KINDS), random.randint(0, 3)):
            rate = 0.002 if kind == "hangs" else random.choice(RATES)
            particulars = dict(KINDS[kind])
            if kind == "late":
                particulars["delay"] = random.choice((0.02, 0.1, 0.25, 0.6, 1.3))
            elif kind == "exception":
                particulars["code"] = random.choice((2, 3, 6))
            add_fault(sensor, kind, rate, **particulars)
            words.append(f"{sensor.slave} {kind} {rate} {particulars}")
    for trouble, share in ((_stray, 0.3), (_babble, 0.1), (_second_master, 0.15), (_unplugged, 0.05), (_away, 0.2)):
        if random.random() < share:
            trouble(daemon, random.uniform(0.2, 0.8) * seconds)
            words.append(trouble.__name__.strip("_"))
    return ", ".join(words)


def _away(daemon: DaemonInMemory, seconds: float) -> None:
    """Let the broker be away."""
    now = daemon.clock.now
    daemon.loop.call_at(now + 0.1 * seconds, daemon.broker.go)
    daemon.loop.call_at(now + 0.6 * seconds, daemon.broker.come)
