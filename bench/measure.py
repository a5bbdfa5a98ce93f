"""One run of one master on one line: what the line counted, what the subscriber heard, what it cost."""

from __future__ import annotations

import bisect
import statistics
import struct
import time
from collections import defaultdict
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from bench import backlog
from bench.broker import Heard, Subscriber, missing_seqs
from bench.line import PacedLine, Sent, read_log
from bench.masters import BASE, command, scratch, start
from bench.programs import end, weigh
from bench.rows import Master, Row

TAIL = 0.5
"""Seconds given to the last samples to arrive."""


@dataclass
class Run:
    """What one run showed; None where it does not apply. Times in ms, memory in MB."""

    row: str
    master: Master
    rate: float
    """Whole answers a second of the healthy sensors."""
    slowest: float
    """The same of the slowest healthy sensor, times their number."""
    share: float
    violations: int
    excused: int
    """Requests that collided with an answer nobody could foresee."""
    gap_us: dict[str, float | None]
    pace_p99_us: float
    cpu_per_1000: float
    """CPU milliseconds per 1000 polls."""
    rss: float
    rss_anon: float
    jitter: float | None = None
    """99th percentile of how far two polls of a sensor are off its interval."""
    latency: dict[str, float] = field(default_factory=dict)
    first_sample: float | None = None
    published: int = 0
    wrong: int = 0
    lost: int = 0
    holes: int = 0
    core: float = 0.0
    """CPU seconds per second."""


@dataclass(frozen=True)
class Judgement:
    """Whether what was published is what the sensors sent."""

    wrong: int
    lost: int
    latencies: list[float]


def percentile(values: list[float], share: float) -> float:
    """Return the value at a share (0..1) of the sorted values."""
    ordered = sorted(values)
    return ordered[int((len(ordered) - 1) * share)]


def judge_samples(sent: list[Sent], samples: list[Heard], begun: float, ended: float) -> Judgement:
    """Compare: each good sample is one whole answer of its own sensor, in order, and none is lost.

    Answers are looked for and latencies taken between `begun` and `ended`; wrong values in the whole run.
    """
    by_value = {each.value: each for each in sent}
    wrong, latencies, last, found = 0, [], defaultdict[int, int](lambda: -1), set[int]()
    for heard in samples:
        if heard.value is None:
            continue
        origin = by_value.get(float32(heard.value))
        if origin is None or not origin.believable or origin.slave != heard.slave or origin.order <= last[heard.slave]:
            wrong += 1
            continue
        last[heard.slave] = origin.order
        found.add(origin.order)
        if begun <= origin.ended < ended:
            latencies.append((heard.at - origin.ended) * 1e3)
    lost = sum(each.whole and begun <= each.ended < ended and each.order not in found for each in sent)
    return Judgement(wrong, lost, latencies)


def float32(value: float) -> float:
    """Return the float32 nearest to a published decimal."""
    return float(struct.unpack(">f", struct.pack(">f", value))[0])


def interval_seconds(row: Row) -> float:
    """Return the row's interval; 0 = as fast as the line allows."""
    text = row.interval
    return float(text.removesuffix("ms")) / 1e3 if text.endswith("ms") else float(text.removesuffix("s"))


def jitter(sent: list[Sent], interval: float) -> float | None:
    """Return the 99th percentile of |time between two polls of a sensor - interval| in ms."""
    last: dict[int, float] = {}
    off = []
    for each in sent:
        if each.slave in last:
            off.append(abs(each.requested - last[each.slave] - interval) * 1e3)
        last[each.slave] = each.requested
    return percentile(off, 0.99) if off and interval else None


def rates(sent: list[Sent], healthy: tuple[int, ...], seconds: float, interval: float = 0.0) -> tuple[float, float]:
    """Return whole answers a second of the healthy sensors, and that of the slowest times their number.

    Flat out the time is taken from the first to the last answer, for a window's ends fall between two; polls at
    an interval come in groups, and are counted in the whole window.
    """
    counts = dict.fromkeys(healthy, 0)
    ends = []
    for each in sent:
        if each.whole and each.slave in counts:
            counts[each.slave] += 1
            ends.append(each.ended)
    if len(ends) < 2:  # noqa: PLR2004 - a rate needs two
        return 0.0, 0.0
    rate = len(ends) / seconds if interval else (len(ends) - 1) / (ends[-1] - ends[0])
    return rate, min(counts.values()) / seconds * len(healthy)


def spend(row: Row, subscriber: Subscriber) -> None:
    """Let the row's time pass, asking of the daemon what the row asks."""
    asked = 0.0
    while asked < row.seconds:
        if row.request is not None:
            subscriber.ask(*row.request)
        pause = row.every or row.seconds
        time.sleep(min(pause, row.seconds - asked))
        asked += pause


def measure(row: Row, master: Master, broker: int, daemon: tuple[str, ...]) -> Run:
    """Let one master poll the row's line for its time; return what was seen."""
    options = ["--baudrate", str(row.baudrate), "--sensors", str(row.sensors)]
    options += ["--turnaround", str(row.turnaround_ms), *row.line]
    with scratch() as name, Subscriber(broker, f"{BASE}/line0") as subscriber:
        folder = Path(name)
        with PacedLine(folder, *options) as line:
            if row.backlog:
                backlog.leave(folder / "state", row.backlog)
            words = command(master, row, folder, line.port, broker, daemon)
            started = time.monotonic()
            process = start(words, folder / "errors")
            try:
                time.sleep(row.warm)
                if process.poll() is not None:
                    raise RuntimeError(f"{words[0]} ended: {(folder / 'errors').read_text().strip()}")
                line.window()
                begun, before = time.monotonic(), weigh(process.pid)
                spend(row, subscriber)
                window: dict[str, Any] = line.window()
                ended, after = time.monotonic(), weigh(process.pid)
                time.sleep(TAIL)
            finally:
                end(process)
            line.close()
            log = read_log(line.log)
        samples = [heard for heard in subscriber.samples() if heard.boot != backlog.BOOT]
    ends = [each.ended for each in log]
    within = log[bisect.bisect_left(ends, begun) : bisect.bisect_left(ends, ended)]
    rate, slowest = rates(within, row.healthy, ended - begun, interval_seconds(row))
    run = Run(
        row=row.name,
        master=master,
        rate=rate,
        slowest=slowest,
        share=rate / row.limit,
        violations=window["too_early"] + window["pauses"] + window["bad_frames"] + window["wrong_rate"],
        excused=window["last_look"] + window["collided"],
        gap_us=window["gap_us"],
        pace_p99_us=window["pace_us"]["p99"] or 0.0,
        cpu_per_1000=(after.cpu - before.cpu) * 1e6 / max(1, window["requests"]),
        rss=after.rss,
        rss_anon=after.rss_anon,
        jitter=jitter(within, interval_seconds(row)),
        core=(after.cpu - before.cpu) / (ended - begun),
    )
    if master == "daemon":
        add_samples(run, log, samples, (started, begun, ended))
    return run


def add_samples(run: Run, log: list[Sent], samples: list[Heard], moments: tuple[float, float, float]) -> None:
    """Add what the subscriber heard."""
    started, begun, ended = moments
    judgement = judge_samples(log, samples, begun, ended)
    run.published = len(samples)
    run.wrong, run.lost, run.holes = judgement.wrong, judgement.lost, missing_seqs(samples)
    if judgement.latencies:
        run.latency = {
            "p50": statistics.median(judgement.latencies),
            "p99": percentile(judgement.latencies, 0.99),
        }
    good = [heard.at for heard in samples if heard.value is not None]
    run.first_sample = (good[0] - started) * 1e3 if good else None
