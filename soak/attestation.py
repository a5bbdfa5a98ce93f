"""Holds what was published to what was on the line: each number is what that sensor sent in answer to that request.

The line's own log is the oracle; it shares no code with the daemon. A number is

- *attested*, if every byte of an answer that carries it came onto the line, from that device's sensor, to the request
  of ours that was the last one when it was believed;
- *right by construction*, if nobody on that line could have told: after it had asked, the master was handed a whole
  frame of that sensor with that number, though troubles made it so (two speakers at once whose bytes happen to fit,
  an answer to another master, or our own that comes late because such a one had come in its place: RTU has no
  transaction id);
- *wrong* otherwise.
"""

from __future__ import annotations

import json
import struct
import time
from bisect import bisect_left, bisect_right
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from operator import itemgetter
from typing import Any

from lfs10d.simulator.burst import MASTER
from lfs10d.simulator.judge import HeardRequest
from lfs10d.simulator.sensor import Reply
from lfs10d.simulator.wire import SECOND, unseal
from tests.support.faulty_sensors import believable

ANSWER = 9
"""Bytes of an answer with one number."""
ROUNDED = 1_000_000
"""`ts` is in whole ms; in ns."""
HELD = 20_000_000
"""An adapter holds bytes back for up to 16 ms: what ended so long before a request may be handed over after it (ns)."""


LOOKS = 50


def epoch_of(now: Callable[[], float], wall: Callable[[], float] = time.time) -> float:
    """Return the wall clock at the time 0 of another clock, both in s; on a busy machine one look may take long."""
    looks = []
    for _ in range(LOOKS):
        before, there, after = wall(), now(), wall()
        looks.append((after - before, (before + after) / 2 - there))
    return min(looks)[1]


@dataclass
class Samples:
    """What was published about one device: each sample by `seq`, and what contradicts itself."""

    by_seq: dict[int, dict[str, Any]] = field(default_factory=dict)
    states: list[dict[str, Any]] = field(default_factory=list)
    repeated: int = 0
    """Samples sent once more, as the contract has it after a reconnect."""
    faults: list[str] = field(default_factory=list)

    def add(self, sample: dict[str, Any]) -> None:
        """Take one sample, live or historical."""
        plain = {key: value for key, value in sample.items() if key != "historical"}
        before = self.by_seq.setdefault(plain["seq"], plain)
        if before is not plain:
            self.repeated += 1
            if before != plain:
                self.faults.append(f"seq {plain['seq']} was published with two contents: {before} and {plain}")

    def in_order(self) -> list[dict[str, Any]]:
        """Return the samples by `seq`."""
        return [self.by_seq[seq] for seq in sorted(self.by_seq)]

    def judge(self, told: int) -> list[str]:
        """Return what is wrong with the numbering and with the states; `told` readings were told by the line."""
        faults = list(self.faults)
        if sorted(self.by_seq) != list(range(1, told + 1)):
            missing = sorted(set(range(1, told + 1)) - set(self.by_seq))
            faults.append(f"{told} readings, {len(self.by_seq)} samples; missing seq: {missing[:10]}")
        times = [sample["ts"] for sample in self.in_order()]
        if any(later < earlier for earlier, later in pairwise(times)):
            faults.append("ts goes back while seq goes on")
        for state in self.states:
            sample = self.by_seq.get(state["seq"])
            if state["wind_speed"] is not None and (sample is None or sample["wind_speed"] != state["wind_speed"]):
                faults.append(f"a state that is no sample: {state}")
        return faults


def parsed(published: Iterable[tuple[str, bytes]]) -> dict[str, Samples]:
    """Return by device what was published on telemetry, history and state; raises ValueError for what is no JSON."""
    devices: dict[str, Samples] = {}
    for topic, payload in published:
        _, _, rest = topic.partition("/device/")
        name, _, leaf = rest.partition("/")
        if leaf not in ("telemetry", "history", "state") or not payload:
            continue
        content = json.loads(payload, parse_constant=_refuse)
        samples = devices.setdefault(name, Samples())
        if leaf == "state":
            samples.states.append(content)
        else:
            for sample in content if leaf == "history" else [content]:
                samples.add(sample)
    return devices


def _refuse(word: str) -> None:
    raise ValueError(f"{word} is no JSON")


@dataclass
class Attested:
    """How many numbers are what, and those that are wrong."""

    good: int = 0
    by_construction: int = 0
    wrong: list[str] = field(default_factory=list)


class Oracle:
    """Knows the log of one line, and what the master's port handed over when (s).

    The numbers in the log are unique; `epoch` is the wall clock at the line's time 0 (s).
    """

    def __init__(self, log: Sequence[HeardRequest], handed: Sequence[tuple[float, bytes]], *, epoch: float) -> None:
        self._epoch = epoch
        self._handed = handed
        self._requests = [request for request in log if request.speaker is MASTER]
        self._begun = [request.begun for request in self._requests]
        self._replies = [(request, answer) for request in log for answer in request.answers if believable(answer)]
        self._answers: dict[float, tuple[HeardRequest, Reply]] = {}
        self._published: set[float] = set()
        for request in log:
            for answer in request.answers:
                self._answers.update(dict.fromkeys(answer.values, (request, answer)))

    def judge(self, device: str, slave: int, samples: Iterable[Mapping[str, Any]]) -> Attested:
        """Hold the numbers of one device's samples to the log."""
        found = Attested()
        for sample in samples:
            value = sample["wind_speed"]
            good = (
                value is not None,
                sample["error"] is None,
                sample["quality"] == "good",
                sample["rtt_ms"] is not None,
            )
            if any(good) and not all(good):
                found.wrong.append(f"{device}: number, error, quality and rtt_ms contradict each other: {sample}")
            elif value is not None:
                wrong = self._attest(found, slave, sample)
                if wrong is not None:
                    found.wrong.append(f"{device}: {wrong}: {sample}")
                self._published.add(value)
        return found

    def _attest(self, found: Attested, slave: int, sample: Mapping[str, Any]) -> str | None:
        """Count one number as what it is; return what is wrong with it."""
        value = sample["wind_speed"]
        request, answer = self._answers.get(value, (None, None))
        last = self._last_asked(round((sample["ts"] / 1000 - self._epoch) * SECOND))
        wrong = None
        if value in self._published:
            wrong = "a number published twice"
        elif last is None or last.frame[0] != slave:
            wrong = "a number of a device that was not asked"
        elif answer is None or request is None or request.speaker is not MASTER or not believable(answer):
            if self._was_handed(last, sample, slave):
                found.by_construction += 1
            else:
                wrong = "a number nobody sent so"
        elif answer.sensor.slave != slave:
            wrong = f"the number of slave {answer.sensor.slave}"
        elif answer.second and any(believable(first) for first in request.answers if not first.second):
            wrong = "a second answer to a request"
        elif request is not last and self._displaced(request, last):
            found.by_construction += 1
        elif request is not last:
            wrong = f"the answer to an earlier request, begun at {request.begun} ns"
        else:
            found.good += 1
        return wrong

    def _last_asked(self, at: int) -> HeardRequest | None:
        """Return our last request that had ended by then, by a `ts` in whole ms."""
        place = bisect_right(self._begun, at + ROUNDED)
        while place and self._requests[place - 1].ended > at + ROUNDED:
            place -= 1
        return self._requests[place - 1] if place else None

    def _displaced(self, asked: HeardRequest, last: HeardRequest) -> bool:
        """Tell whether, before `last`, an answer to another master came in the place of the answer to `asked`.

        Nothing tells it from ours, so ours comes in the place of the next, and so on until one is missing.
        """
        slave = asked.frame[0]
        for request, answer in self._replies:
            came = answer.sensor.slave == slave and asked.begun - HELD <= answer.burst.ends[-1] and request is not asked
            if (
                came
                and answer.burst.start < last.begun
                and (request.speaker is not MASTER or (request.begun < asked.begun and self._displaced(request, asked)))
            ):
                return True
        return False

    def _was_handed(self, last: HeardRequest, sample: Mapping[str, Any], slave: int) -> bool:
        """Tell whether the master was handed, after it had asked, a whole frame of that slave with that number."""
        since, until = last.begun / SECOND, sample["ts"] / 1000 - self._epoch + 0.001
        place = bisect_left(self._handed, since, key=itemgetter(0))
        data = b""
        while place < len(self._handed) and self._handed[place][0] <= until:
            data += self._handed[place][1]
            place += 1
        wanted = bytes((slave, 3, 4)) + struct.pack(">f", sample["wind_speed"])
        return any(unseal(data[at : at + ANSWER]) == wanted for at in range(len(data) - ANSWER + 1))


def codes(samples: Iterable[Mapping[str, Any]], since: float, until: float, epoch: int) -> list[str]:
    """Return what was published between two times of the line (s), in order: each sample's code, or `good`."""
    return [sample["error"] or "good" for sample in samples if since <= sample["ts"] / 1000 - epoch < until]
