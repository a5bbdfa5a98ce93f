"""The daemon under test, a process of its own, and its lives."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from pathlib import Path
from signal import SIGHUP, SIGKILL, SIGTERM

from soak.gauges import Gauge, read
from soak.ledger import Life
from soak.line import BAUDRATE, SLAVES

STARTS_WITHIN = 30.0
ENDS_WITHIN = 5.0
"""Seconds; the contract's 2 s (section 2), and what a busy machine adds."""

INTERVALS = ("200ms", "250ms")
NEVER_IN_A_LOG = ("Traceback", "fault of lfs10d itself", "internal error", "by a mistake")
READ_SIZE = 1 << 20


class Daemon:
    """Starts and ends it in `folder`. `lives` are all of them, `faults` what it did that it must not do."""

    def __init__(self, folder: Path, port: Path, broker: int) -> None:
        self.lives: list[Life] = []
        self.gauges: list[Gauge] = []
        self.faults: list[str] = []
        self.log = folder / "daemon.log"
        self._folder = folder
        self._port = port
        self._broker = broker
        self._reloads = 0
        self._process: subprocess.Popen[bytes] | None = None
        self._log_read = 0

    def start(self) -> None:
        """Start it and wait until it is at work; RuntimeError if it is not within 30 s."""
        self._configure()
        runtime = self._folder / "run"
        runtime.mkdir(exist_ok=True)
        status = runtime / "status.json"
        status.unlink(missing_ok=True)
        command = [sys.executable, "-m", "lfs10d", "run", "-c", str(self._folder / "lfs10d.yaml")]
        command += ["--state-dir", str(self._folder / "state")]
        started = time.time()
        with self.log.open("ab") as log:
            self._process = subprocess.Popen(
                command,
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=log,
                env={**os.environ, "RUNTIME_DIRECTORY": str(runtime)},
            )
        self.lives.append(Life(started))
        self.gauges.append(Gauge())
        while not status.exists():
            if self._process.poll() is not None or time.time() - started > STARTS_WITHIN:
                raise RuntimeError(f"the daemon does not start; see {self.log}")
            time.sleep(0.05)

    def reload(self) -> None:
        """Let it read another interval of one device."""
        self._reloads += 1
        self._configure()
        self._signal(SIGHUP)

    def end(self) -> None:
        """End it in order."""
        if self._process is None:
            return
        began = time.monotonic()
        self._signal(SIGTERM)
        try:
            code = self._process.wait(ENDS_WITHIN)
        except subprocess.TimeoutExpired:
            self.faults.append(f"SIGTERM: it has not ended after {ENDS_WITHIN:g} s")
            self.kill()
            return
        if code != 0:
            self.faults.append(f"SIGTERM: exit code {code} after {time.monotonic() - began:.1f} s")
        self._over(killed=False)

    def kill(self) -> None:
        """End it at once; a second time does nothing."""
        if self._process is not None:
            self._signal(SIGKILL)
            self._process.wait()
            self._over(killed=True)

    def look(self) -> None:
        """Take its figures; note if it has ended by itself, or has logged what it must never."""
        self._read_log()
        if self._process is None:
            return
        code = self._process.poll()
        if code is not None:
            self.faults.append(f"it ended by itself with exit code {code}")
            self._over(killed=True)
            return
        self.gauges[-1].add(read(self._process.pid, time.time() - self.lives[-1].started))

    @property
    def alive(self) -> bool:
        """Whether it runs."""
        return self._process is not None

    def _signal(self, number: int) -> None:
        if self._process is not None:
            self._process.send_signal(number)

    def _over(self, *, killed: bool) -> None:
        self._process = None
        self.lives[-1] = Life(self.lives[-1].started, time.time(), killed)

    def _read_log(self) -> None:
        with self.log.open("rb") as log:
            log.seek(self._log_read)
            text = log.read(READ_SIZE)
        self._log_read += len(text)
        self.faults += [
            f"it logged {line.strip()!r}"
            for line in text.decode(errors="replace").splitlines()
            if any(word in line for word in NEVER_IN_A_LOG)
        ]

    def _configure(self) -> None:
        first = {"id": SLAVES[0], "interval": INTERVALS[self._reloads % len(INTERVALS)]}
        settings = {
            "line": {"port": str(self._port), "baudrate": BAUDRATE},
            "poll": {"interval": "200ms"},
            "slaves": [first, *SLAVES[1:]],
            "mqtt": {"host": "127.0.0.1", "port": self._broker, "keepalive": "10s", "client_id": "lfs10d-soak-daemon"},
        }
        (self._folder / "lfs10d.yaml").write_text(json.dumps(settings, indent=1))  # JSON is YAML too
