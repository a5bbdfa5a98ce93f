"""Random lines on which second answers come, read by one who wakes late, and what was published wrongly of them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from random import Random

from lfs10d.line.device import PollRules
from lfs10d.modbus.bus import Wait
from lfs10d.simulator.burst import MASTER
from lfs10d.simulator.judge import HeardRequest, JudgeReport
from lfs10d.simulator.line_faults import second_master
from tests.support.faulty_sensors import add_fault
from tests.support.lines import Rig, Rigs

KINDS = ("none", "twin", "repeated", "second_master", "gateway", "late", "twin and noise")
"""What is wrong with a line."""
REQUESTS = 300
"""Of each line so many requests are judged, in `LONGEST` virtual seconds at most."""
LONGEST = 60.0


@dataclass
class Count:
    """What came of some lines; `wrong` in words, with the seed to repeat."""

    exchanges: int = 0
    readings: int = 0
    good: int = 0
    spoilt: int = 0
    """Wrong numbers of requests that no slave heard: bytes that an adapter still held back lay on the wire."""
    gaps: int = 0
    """Requests begun too early, where no adapter holds bytes back."""
    wrong: list[str] = field(default_factory=list)
    codes: Counter[str] = field(default_factory=Counter)


def wake_late(rig: Rig, random: Random, share: float, most: float) -> None:
    """Have that share of the turns taken up to `most` s too late, as on a busy machine."""
    turn = rig.poller.turn

    def late(now: float, *, readable: bool = True) -> Wait:
        if random.random() < share:
            rig.clock.now = now = now + random.random() * most
        return turn(now, readable=readable)

    rig.poller.turn = late  # type: ignore[method-assign]  # the rig calls it where the thread would


def tell(seed: int, kind: str | None, count: Count, *, share: float | None = None) -> Rig:
    """Run the line of that seed, with a fault of that `kind` or any, and count what came of it.

    `share` of the turns are late; by default any.
    """
    random = Random(seed)  # noqa: S311 - repeatable lines, no secret
    choose = random.choice
    slaves = choose((1, 1, 2, 3, 4))
    latency = choose((0.0, 0.0, 0.0, 0.004, 0.016))
    kind = choose(KINDS) if kind is None else kind
    rig = Rigs()(
        slaves,
        interval=choose((0.0, 0.0, 0.04, 0.1, 0.25, 0.5)),
        rules=PollRules(retries=choose((0, 1)), offline_after=choose((3, 100))),
        baudrate=choose((9600, 19200, 115200)),
        turnaround=choose((0.002, 0.005, 0.01, 0.02, 0.04)),
        jitter=choose((0.001, 0.003, 0.01, 0.02, 0.05)),
        latency=latency,
        seed=seed,
        in_turn=True,
    )
    rig.port.paced = choose((True, True, False))
    late_share = choose((0.0, 0.02, 0.2, 0.5, 1.0))
    wake_late(rig, random, late_share if share is None else share, choose((0.005, 0.02, 0.05, 0.1)))
    _trouble(rig, kind, random)
    while rig.sent < REQUESTS and rig.clock.now < LONGEST:
        rig.run(rig.clock.now + 0.5)
    _judge(rig, f"seed {seed}, {kind}", count)
    return rig


def _trouble(rig: Rig, kind: str, random: Random) -> None:
    rate, first = random.choice((0.02, 0.1, 0.3, 1.0, 1.0)), random.choice((0.0, 1.0, 2.013, 3.37))
    delay = random.choice((0.005, 0.012, 0.02, 0.037, 0.05, 0.07, 0.1, random.uniform(0.005, 0.1)))
    if kind == "second_master":
        every = random.choice((0.137, 0.25, 0.37, 1.0, random.uniform(0.1, 1.5)))
        second_master(rig.line, bytes((1, 3, 0, 1, 0, 2)), 1.0 + random.random(), every)
        return
    for sensor in rig.line.sensors[: random.randint(1, len(rig.line.sensors))]:
        match kind:
            case "twin" | "repeated":
                add_fault(sensor, kind, rate, delay=delay, first=first)
            case "twin and noise":
                add_fault(sensor, "twin", rate, delay=delay, first=first)
                add_fault(sensor, "noisy", 0.05)
            case "gateway":
                after = random.choice((0.01, 0.05, 0.1, 0.3, 0.6))
                add_fault(sensor, kind, min(rate, 0.3), code=random.choice((5, 10, 11)), delay=after, first=first)
            case "late":
                add_fault(sensor, kind, min(rate, 0.3), delay=random.uniform(0.02, 0.9), first=first)


def _judge(rig: Rig, where: str, count: Count) -> None:
    """Hold every number to the request that it was read by, as the line itself knows it."""
    ours = [request for request in rig.line.log if request.speaker is MASTER]
    seen: set[float] = set()
    count.exchanges += len(ours)
    count.gaps += 0 if rig.port.adapter.latency else rig.line.judge.counts["gap"]
    find = _finder(ours)
    for reading in rig.readings:
        count.readings += 1
        count.codes[reading.fault.code if reading.fault else "good"] += 1
        if reading.values is None or reading.rtt is None:
            continue
        count.good += 1
        request, value = find(reading.at - reading.rtt), float(reading.values["wind_speed"] or 0.0)
        own = [each for each in request.answers if not each.second and each.sensor.slave == request.body[0]]
        if value in seen or not any(value in answer.values for answer in own):
            if rig.port.adapter.latency and request.verdict is not JudgeReport.HEARD:
                count.spoilt += 1
            else:
                count.wrong.append(f"{where}: {value} of {reading.device} at {reading.at:.4f} s")
        seen.add(value)


def _finder(requests: list[HeardRequest]) -> Callable[[float], HeardRequest]:
    begins = [request.begun for request in requests]

    def find(begun: float) -> HeardRequest:
        wanted = begun * 1e9
        return requests[min(range(len(begins)), key=lambda place: abs(begins[place] - wanted))]

    return find
