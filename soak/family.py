"""The family of bad lines through the whole daemon, in virtual time: each fault alone, then any mix of them.

`run_family(exchanges, seed)` runs life after life, each with another adapter, rate and time-out, until the simulated
line has heard so many requests. What was published is held to the line's own log; see `soak.attestation`.
"""

from __future__ import annotations

from bisect import bisect_left
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from operator import itemgetter
from pathlib import Path
from random import Random
from random import seed as seed_the_uplink

from lfs10d.config.defaults import resolved
from lfs10d.config.models import Config
from lfs10d.profiles.library import load_profile
from lfs10d.simulator.burst import MASTER
from lfs10d.simulator.judge import JudgeReport
from lfs10d.simulator.line import SimulatedLine
from lfs10d.simulator.wire import SECOND, Format
from soak.attestation import Oracle, Samples, codes, parsed
from soak.troubles import FAMILY, Fault, mix
from soak.virtual import EPOCH, DaemonInMemory
from tests.support.faulty_sensors import add_fault
from tests.support.queued_sensor import QueuedSensor

DEVICES = (1, 2, 3, 4)
ILL = 2
"""The sensor that has the fault, where one has it."""
RATES = (9600, 19200, 115200)
TIMEOUTS = ("auto", "200ms", "auto", "50ms")
LIVES_DIFFER = 4
"""After so many lives every adapter had its turn: with and without echo, at once and in pieces of 16 ms."""
ALONE = 6.0
"""Seconds of one fault alone."""
MIXED = 40.0
"""Seconds of one mix."""
MIXES = 6
"""Of one life."""
PROBED = 2.0
"""`probe_interval_max`: an offline sensor is asked this often (s), some of it less than its share allows."""
CALM = 2.0
"""Seconds of peace after each fault, so that the next begins on a well line; more if a device is not back by then."""
RECOVERY = 60.0
"""Seconds within which every device has a good sample after all faults are gone: some were probed in vain for 1 s at
a twentieth of the line."""
ROUNDING = 1e-6
"""Seconds by which two times may be off that are reckoned from floats."""
SHOWN = 20
"""Findings that are kept in words; all are counted."""


@dataclass
class Account:
    """What a run found; `faults` in words, with the seed and the life to repeat."""

    exchanges: int = 0
    lives: int = 0
    seconds: float = 0.0
    """Virtual."""
    recovery: float = 0.0
    """The longest time until all were well again (s), in steps of `CALM`."""
    samples: int = 0
    good: int = 0
    by_construction: int = 0
    """Numbers of frames that nobody on that line could have told from right ones."""
    repeated: int = 0
    errors: Counter[str] = field(default_factory=Counter)
    alone: dict[str, Counter[str]] = field(default_factory=dict)
    """The codes of the ill sensor by fault."""
    unknowable: int = 0
    """Requests begun into a byte that was not over, or within t3.5 of one that a 16 ms adapter still held back."""
    findings: int = 0
    faults: list[str] = field(default_factory=list)

    def find(self, where: str, words: str) -> None:
        """Note one thing that must not be."""
        self.findings += 1
        if len(self.faults) < SHOWN:
            self.faults.append(f"{where}: {words}")

    def __str__(self) -> str:
        found = "\n".join(self.faults) or "nothing wrong"
        return (
            f"{self.exchanges} exchanges in {self.lives} lives, {self.seconds:.0f} s of the line; "
            f"{self.samples} samples, {self.good} good, {self.by_construction} right by construction, "
            f"{self.repeated} repeated; {dict(self.errors.most_common())}; gaps nobody could keep: {self.unknowable}; "
            f"well again within {self.recovery:.0f} s\n"
            f"{self.findings} findings: {found}"
        )


@dataclass(frozen=True)
class Spell:
    """A fault from `begun` to `ended` (s); None: a mix."""

    words: str
    fault: Fault | None
    begun: float
    ended: float


def run_family(
    exchanges: int, seed: int, progress: Callable[[Account], None] = lambda _: None, *, lives: int = 1
) -> Account:
    """Run until the line has heard so many requests, in so many lives; what is wrong is in the `faults`."""
    account = Account()
    while account.exchanges < exchanges or account.lives < lives:
        Life(account, seed, account.lives).run()
        progress(account)
    return account


class Life:
    """One life of the daemon on a line with four sensors; `number` decides the adapter, the rate, the time-out."""

    def __init__(self, account: Account, seed: int, number: int) -> None:
        self.account = account
        self.where = f"seed {seed}, life {number}"
        self.random = Random(seed * 1_000_003 + number)  # noqa: S311  # repeatable troubles, no secret
        seed_the_uplink(self.random.getrandbits(32))  # it draws when to connect again
        self.echo = number % 2 == 1
        self.latency = 0.016 if number % 4 >= 2 else 0.0  # noqa: PLR2004 - every other pair
        baudrate = RATES[number % len(RATES)]
        profile = load_profile("lfs10", relative_to=Path())
        config = Config.model_validate(
            {
                "line": {"port": "/dev/simulated", "baudrate": baudrate},
                "poll": {
                    "interval": 0.25 if number % 5 else 0.5,
                    "response_timeout": TIMEOUTS[number % len(TIMEOUTS)],
                    "retries": (1, 0, 2)[number % 3],
                    "probe_interval_max": PROBED,
                },
                "slaves": list(DEVICES),
                "mqtt": {"host": "localhost"},
            }
        )
        config = resolved(config, stem="lfs10d", host="soak")
        shape = Format(baudrate)
        sensors = [
            QueuedSensor(slave, format=shape, jitter=0.002, seed=self.random.getrandbits(32)) for slave in DEVICES
        ]
        self.line = SimulatedLine(sensors, format=shape, seed=self.random.getrandbits(32))
        self.daemon = DaemonInMemory(
            self.line,
            config,
            {"lfs10": profile},
            boot=f"{number:08d}",
            echo=self.echo,
            latency=self.latency,
        )
        self.spells: list[Spell] = []

    def run(self) -> None:
        """Let every fault come alone, then mixes, and judge."""
        try:
            self.daemon.go(5.0)
            names = sorted(FAMILY)
            self.random.shuffle(names)
            for name in names:
                self._alone(name, FAMILY[name])
            for _ in range(MIXES):
                words = mix(self.daemon, self.random, MIXED)
                self._spell(words, None, MIXED)
            self.daemon.settle()
        finally:
            self.daemon.close()
        self._judge()

    def _alone(self, name: str, fault: Fault) -> None:
        for kind, particulars in (fault.faults or {}).items():
            add_fault(self.line.sensor(ILL), kind, **particulars)
        if fault.begin is not None:
            fault.begin(self.daemon, ALONE)
        self._spell(name, fault, ALONE)

    def _spell(self, words: str, fault: Fault | None, seconds: float) -> None:
        begun = self.daemon.clock.now
        self.daemon.go(seconds)
        for sensor in self.line.sensors:
            sensor.faults.clear()
            sensor.hung = False  # not by a power cycle: its registers know no 115200 baud
        ended = self.daemon.clock.now
        self.daemon.go(CALM)
        while not self._recovered(ended) and self.daemon.clock.now < ended + RECOVERY:
            self.daemon.go(CALM)
        if not self._recovered(ended):
            self._find(f"not every device recovered within {RECOVERY:g} s from: {words}")
        self.account.recovery = max(self.account.recovery, self.daemon.clock.now - ended)
        self.spells.append(Spell(words, fault, begun, ended))

    def _recovered(self, since: float) -> bool:
        good = self.daemon.good
        return all(good.get(f"slave-{slave}", 0.0) > since for slave in DEVICES)

    # -- what came of it

    def _judge(self) -> None:
        account, daemon = self.account, self.daemon
        oracle = Oracle(self.line.log, daemon.port.handed, epoch=EPOCH)
        devices = parsed(daemon.broker.published)
        for slave in DEVICES:
            name = f"slave-{slave}"
            samples = devices[name]
            found = oracle.judge(name, slave, samples.in_order())
            account.samples += len(samples.by_seq)
            account.good += found.good
            account.by_construction += found.by_construction
            account.repeated += samples.repeated
            account.errors.update(sample["error"] for sample in samples.in_order() if sample["error"])
            for words in (*found.wrong, *samples.judge(daemon.readings[name])):
                self._find(words)
        for spell in self.spells:
            if spell.fault is not None:
                self._judge_spell(spell, spell.fault, devices)
        self._judge_silence()
        for mistake in daemon.mistakes:
            self._find(f"a mistake in the loop: {mistake}")
        account.exchanges += sum(request.speaker is MASTER for request in self.line.log)
        account.lives += 1
        account.seconds += daemon.clock.now

    def _find(self, words: str) -> None:
        self.account.find(self.where, words)

    def _judge_silence(self) -> None:
        """Hold every request to the silence before it, as the line heard it."""
        judge = self.line.judge
        if judge.counts["torn"]:
            self._find(f"{judge.counts['torn']} requests with a pause above t1.5 inside")
        if self.daemon.port.unread:
            self._find(f"{self.daemon.port.unread} requests while bytes lay unread")
        for request in self.line.log:
            if request.speaker is MASTER and request.verdict in (JudgeReport.GAP, JudgeReport.COLLISION):
                # Of a byte that is not over, or that an adapter still holds back, nobody can know.
                hidden = bool(self.latency) or request.verdict is JudgeReport.COLLISION
                if hidden and not self._was_handed_lately(request.begun / SECOND):
                    self.account.unknowable += 1
                else:
                    self._find(f"a request begun at {request.begun} ns after {request.gap} ns: {request.verdict}")

    def _was_handed_lately(self, begun: float) -> bool:
        """Tell whether the master was handed a byte within t3.5 before that: then it knew of it."""
        handed = self.daemon.port.handed
        place = bisect_left(handed, begun, key=itemgetter(0))
        return place > 0 and begun - handed[place - 1][0] < self.line.format.t35 / SECOND - ROUNDING

    def _judge_spell(self, spell: Spell, fault: Fault, devices: dict[str, Samples]) -> None:
        for slave in DEVICES:
            seen = codes(devices[f"slave-{slave}"].in_order(), spell.begun, spell.ended, EPOCH)
            if slave == ILL:
                self.account.alone.setdefault(spell.words, Counter()).update(seen)
                self._judge_ill(spell.words, fault, seen)
            elif not set(seen) <= fault.neighbours | self._in_pieces(fault) | {"good"}:
                self._find(f"{spell.words} of slave {ILL}: slave {slave} showed {Counter(seen)}")

    def _in_pieces(self, fault: Fault) -> frozenset[str]:
        return fault.in_pieces if self.latency else frozenset()

    def _judge_ill(self, words: str, fault: Fault, seen: list[str]) -> None:
        """Hold what was seen from the first bad sample on to what is expected; before it all was still well."""
        pieces = self._in_pieces(fault)
        expected, must = fault.first | pieces, frozenset() if pieces else fault.must
        bad = [place for place, code in enumerate(seen) if code != "good"]
        if not bad:
            if must or not seen:
                self._find(f"{words}: nothing but {Counter(seen)}, expected {sorted(expected)}")
        elif (first := seen[bad[0]]) not in expected:
            self._find(f"{words}: the first code was {first}, expected {sorted(expected) or 'none'}")
        else:
            allowed = expected | fault.also | ({"good"} if fault.also else set())
            shown = set(seen[bad[0] :])
            if not shown <= allowed or not must <= shown:
                self._find(f"{words}: {Counter(seen)}, expected {sorted(allowed)} and certainly {sorted(must)}")
