"""One soak: the plan carried out, everything heard and sent accounted for, until all is calm and complete again."""

from __future__ import annotations

import json
import time
from collections import Counter, deque
from collections.abc import Callable
from pathlib import Path
from signal import SIGCONT, SIGSTOP

from bench.broker import Broker
from soak.daemon import Daemon
from soak.ear import Ear
from soak.heard import Message, samples_of
from soak.ledger import Ledger
from soak.line import Line
from soak.oracle import KEPT_FOR, Excuse, Oracle
from soak.plan import Act, Step, steps
from soak.shown import Shown

BASE = "lfs10d/line0"

TICK = 0.2
LOOK_EVERY = 1.0
"""Seconds between two looks at the daemon's figures and at the retained topics."""

RECOVERED_AFTER = 10.0
"""Seconds after which a broker that was stopped or restarted is expected to show what is true."""

COMPLETE_AFTER = 16.0
"""Seconds after the last disturbance from which on all may be there: the past is opened 10 s after a connect."""

COMPLETE_WITHIN = 90.0
QUIET = 2.0
"""Seconds without anything new of the past after which all of it has come."""

SETTLED = 4.0
"""Seconds that a sample may be under way in calm."""

BEFORE_PULL = 1.0
AROUND_END = 1.0
PULLED, ENDED, KILLED = "a pulled port", "SIGTERM", "SIGKILL"
BEFORE_KILL = 9.0
"""Seconds before the port is pulled, the daemon is ended or killed with a backlog: answers nobody may tell of."""


class Soak:
    """Everything of one soak, in `folder`. `tell` is handed each line for a person."""

    def __init__(self, folder: Path, seed: int, seconds: float, tell: Callable[[str], None]) -> None:
        self.folder = folder
        self.seed = seed
        self.seconds = seconds
        self.broker = Broker(folder)
        self.line = Line(folder / "tty", seed)
        self.daemon = Daemon(folder, folder / "tty", self.broker.port)
        self.ear = Ear(self.broker.port, BASE)
        self.oracle = Oracle()
        self.ledger = Ledger(self.oracle.fault_of)
        self.shown = Shown()
        self.steps: Counter[str] = Counter()
        self.stale: list[str] = []
        self.incomplete: list[str] = []
        self._tell = tell
        self._began = time.monotonic()
        self._waiting: deque[Message] = deque()
        self._stopped = False
        self._broker_well_from = 0.0
        self._looked = 0.0
        self._line_in = False

    def run(self) -> None:
        """Do all of it; RuntimeError if a part of the soak itself fails."""
        try:
            self._change_port(plugged=True)
            self.ear.come()
            self.daemon.start()
            self._began = time.monotonic()
            for step in steps(self.seed, self.seconds):
                self._carry_out(step)
                if self.daemon.faults:
                    break
            self._pass_until(self.seconds)
            self._calm_down()
        finally:
            self.close()

    def close(self) -> None:
        """End every process and account for what is left."""
        self.broker.signal(SIGCONT)
        self.daemon.kill()
        self.ear.leave()
        self.line.close()
        self.broker.end()

    @property
    def elapsed(self) -> float:
        """Seconds since the beginning."""
        return time.monotonic() - self._began

    @property
    def failures(self) -> list[str]:
        """What is not as promised, each in one line."""
        missed = [f"untold: {one.device} sent number {one.number} at {one.at:.3f}" for one in self.oracle.examples]
        if self.oracle.failed and not missed:
            missed = [f"{self.oracle.missed} of {self.oracle.heard} good answers were not accepted"]
        grown = [
            f"life {number}: {what}" for number, gauge in enumerate(self.daemon.gauges, 1) for what in gauge.grown()
        ]
        return [*self.ledger.findings, *missed, *self.stale[:20], *self.daemon.faults[:20], *grown, *self.incomplete]

    # Time

    def _pass_until(self, at: float) -> None:
        """Listen and look until that time, seconds from the start."""
        while self.elapsed < at and not self.daemon.faults:
            time.sleep(max(0.0, min(TICK, at - self.elapsed)))
            self._tick()

    def _tick(self) -> None:
        self._hear()
        for sent in self.line.answers():
            self.oracle.sent(sent)
        self._account()
        now = time.monotonic()
        if now - self._looked >= LOOK_EVERY:
            self._looked = now
            self.daemon.look()
            self._look_at_shown(now)
            self.ledger.fold(self.daemon.lives, now)
            self.oracle.fold(time.time() - KEPT_FOR)

    # What is heard

    def _hear(self) -> None:
        while not self.ear.heard.empty():
            message = self.ear.heard.get()
            self._waiting.append(message)
            self.shown.note(message.topic, message.payload)

    def _account(self, *, all_of_it: bool = False) -> None:
        """Hand on what was heard before everything that was sent is known."""
        behind = time.time() - time.monotonic()
        while self._waiting and (all_of_it or self._waiting[0].at + behind < self.line.settled_until):
            message = self._waiting.popleft()
            if message.topic == "availability" and message.payload == b"online":
                self.ledger.reconnected()
            elif message.topic == "event":
                event = json.loads(message.payload)
                if event["type"] == "dropped":
                    places = (event["from_seq"], event["to_seq"], event["count"])
                    self.ledger.dropped(event["device"], event["boot"], *places)
            else:
                for told in samples_of(message):
                    self.ledger.told(told, message.at)

    def _look_at_shown(self, now: float) -> None:
        """See that nothing stale looks live, where broker and subscriber are there and have been for a while."""
        since = self.ear.connected_since
        heard = self.broker.runs and not self._stopped and now > self._broker_well_from
        if heard and since is not None and now - since > RECOVERED_AFTER:
            self.stale += self.shown.stale(time.time())

    # What is done

    def _carry_out(self, step: Step) -> None:
        self._pass_until(step.at)
        if self.daemon.faults:
            return
        self._tell(str(step))
        self.steps[step.kind.value] += 1
        for due in step.acts():
            self._pass_until(due.at)
            if not self.daemon.faults:
                self._do(due.act)

    def _do(self, act: Act) -> None:  # noqa: C901, PLR0912  # one line per act
        now = time.time()
        match act:
            case Act.BROKER_KILL:
                self.broker.kill()
            case Act.BROKER_END:
                self.broker.end()
            case Act.BROKER_START:
                self.broker.start()
                self._broker_well_from = time.monotonic() + RECOVERED_AFTER
            case Act.BROKER_STOP:
                self._stopped = True
                self.broker.signal(SIGSTOP)
            case Act.BROKER_GO_ON:
                self.broker.signal(SIGCONT)
                self._stopped = False
                self._broker_well_from = time.monotonic() + RECOVERED_AFTER
            case Act.EAR_AWAY:
                self.ear.leave()
            case Act.EAR_BACK:
                self.ear.come()
            case Act.PORT_PULL:
                self._change_port(plugged=False)
                self._excuse(PULLED, now, BEFORE_PULL)
            case Act.PORT_BACK:
                self._change_port(plugged=True)
            case Act.RELOAD:
                self.daemon.reload()
            case Act.DAEMON_END:
                self.daemon.end()
                self._excuse(ENDED, now, AROUND_END)
            case Act.DAEMON_KILL:
                self.daemon.kill()
                self._excuse(KILLED, now, AROUND_END if self.broker.runs else BEFORE_KILL)
            case Act.DAEMON_START:
                self.daemon.start()

    def _excuse(self, why: str, at: float, before: float) -> None:
        """Expect nothing of answers from so long before that moment until it is over."""
        self.oracle.excuse(Excuse(why, at - before, at, time.time() + AROUND_END))

    def _change_port(self, *, plugged: bool) -> None:
        if plugged and not self._line_in:
            self.line.plug()
        elif not plugged and self._line_in:
            self.line.pull()
        self._line_in = plugged

    # The end

    def _calm_down(self) -> None:
        """Wait until everything is there, end the daemon in order, and close the books."""
        calm_since = self.elapsed
        while not self.daemon.faults:
            past = self.ledger.counts["history"]
            self._pass_until(self.elapsed + QUIET)
            calm = self.elapsed - calm_since
            missing = self.oracle.waiting(min(time.time() - SETTLED, self.line.settled_until))
            if calm >= COMPLETE_AFTER and not missing and self.ledger.counts["history"] == past:
                break
            if calm >= COMPLETE_WITHIN:
                self.incomplete.append(f"not complete {calm:.0f} s after the last disturbance")
                break
        ended = time.time()
        self.daemon.end()
        self._excuse(ENDED, ended, AROUND_END)
        until = self.elapsed + SETTLED
        while self.elapsed < until and self.line.settled_until < ended + AROUND_END:
            time.sleep(TICK)
            self._tick()
        self._account(all_of_it=True)
        self.daemon.look()
        self.ledger.close(self.daemon.lives)
        self.oracle.fold(ended + SETTLED)
