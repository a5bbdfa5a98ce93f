"""The line that the recipes run on: recorded wind, a mosquitto that keeps sessions, the daemon and its page."""

from __future__ import annotations

import contextlib
import math
import os
import random
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Final, Self

from bench.broker import free_port

ROOT: Final = Path(__file__).parent.parent
FILES: Final = ROOT / "config" / "integrations"
PLACES: Final = os.pathsep.join((os.environ.get("PATH", os.defpath), "/usr/local/sbin", "/usr/sbin", "/sbin"))
LFS10D: Final = (sys.executable, "-m", "lfs10d")
RECORDING_SECONDS: Final = 600


class Missing(Exception):  # noqa: N818  # not an error: the recipe is passed over
    """A program is not installed; the message names it and where it comes from."""


def program(name: str, source: str) -> str:
    """Return the path of a program; raises Missing."""
    found = shutil.which(name, path=PLACES)
    if found is None:
        raise Missing(f"{name} is not installed ({source})")
    return found


def recording() -> str:
    """Return wind of ten minutes with gusts above 20 m/s, and a direction that moves."""
    wind = random.Random(7)  # noqa: S311  # weather, no secret
    rows = ["time,wind_speed,5.wind_direction"]
    for n in range(2 * RECORDING_SECONDS):
        speed = max(0.0, 12 + 5 * math.sin(n / 20) + wind.gauss(0, 2))
        rows.append(f"{n / 2},{speed:.2f},{round(240 + 40 * math.sin(n / 90) + wind.gauss(0, 8)) % 360}")
    return "\n".join(rows) + "\n"


class Rig:
    """Four sensors at 1 Hz (slave 4 is silent, slave 5 a vane) in `folder`; a context manager. Ports are free ones."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.broker_port, self.page_port = free_port(), free_port()
        self._broker: subprocess.Popen[bytes] | None = None
        self._running: list[subprocess.Popen[bytes]] = []

    def __enter__(self) -> Self:
        port = self.folder / "line0"
        profile = ROOT / "config" / "profiles" / "wind-vane.yaml"
        files = {
            "wind.csv": recording(),
            "faults.yaml": f"slaves: {{4: silent, 5: {{profile: {profile}}}}}\n",
            "line0.yaml": f"line: {{port: {port}}}\n"
            f"slaves: [2, {{id: 3, name: mast-top}}, 4, {{id: 5, name: vane, profile: {profile}}}]\n"
            f"mqtt: {{host: 127.0.0.1, port: {self.broker_port}}}\nwind: {{every: 2s, records: 1m}}\n",
            "mosquitto.conf": f"listener {self.broker_port} 127.0.0.1\nallow_anonymous true\npersistence true\n"
            f"persistence_location {self.folder}/\nautosave_interval 5\nmax_queued_messages 0\n"
            + ("user root\n" if os.geteuid() == 0 else ""),
        }
        for name, text in files.items():
            (self.folder / name).write_text(text)
        self.start_broker()
        self.start(
            *(*LFS10D, "simulate", "--link", str(port), "--slaves", "2-5"),
            *("--wind", str(self.folder / "wind.csv"), "--faults", str(self.folder / "faults.yaml")),
        )
        configuration = ("-c", str(self.folder / "line0.yaml"))
        self.until(port.exists, "the simulated line is there")
        self.start(*LFS10D, "run", *configuration, "--state-dir", str(self.folder / "state"))
        self.start(*LFS10D, "web", *configuration, "--listen", f"127.0.0.1:{self.page_port}")
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        for process in reversed(self._running):
            self.end(process)
        self.kill_broker()

    def start(
        self, *command: str, environment: Mapping[str, str] | None = None, log: str | None = None
    ) -> subprocess.Popen[bytes]:
        """Start a program that `end` or the rig's end stops; its output goes to `log` in the folder."""
        with (self.folder / (log or "programs.log")).open("ab") as file:
            process = subprocess.Popen(
                command,
                stdin=subprocess.DEVNULL,
                stdout=file,
                stderr=file,
                cwd=self.folder,
                env={**os.environ, **(environment or {})},
                start_new_session=True,  # weewx ends its whole process group
            )
        self._running.append(process)
        return process

    def end(self, process: subprocess.Popen[bytes], *, kill: bool = False) -> None:
        """End a program, at once where asked."""
        if process in self._running:
            self._running.remove(process)
        if kill:
            process.kill()
        process.terminate()
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(10)
        process.kill()
        process.wait()

    def call(self, *command: str, environment: Mapping[str, str] | None = None) -> str:
        """Run a program to its end and return its output; RuntimeError if it fails."""
        done = subprocess.run(
            command,
            capture_output=True,
            text=True,
            check=False,
            cwd=self.folder,
            env={**os.environ, **(environment or {})},
            timeout=120,
        )
        if done.returncode:
            raise RuntimeError(f"{command[0]}: {(done.stderr or done.stdout).strip()[-400:]}")
        return done.stdout

    def start_broker(self) -> None:
        """Start mosquitto with what it has saved."""
        command: Sequence[str] = (program("mosquitto", "Debian"), "-c", str(self.folder / "mosquitto.conf"))
        self._broker = self.start(*command)

    def kill_broker(self) -> None:
        """Kill mosquitto: what it saved last is what is left."""
        if self._broker is not None:
            self.end(self._broker, kill=True)
            self._broker = None

    def until(self, claim: Callable[[], object], what: str, within: float = 60.0) -> None:
        """Wait until the claim holds; AssertionError after `within` seconds."""
        deadline = time.monotonic() + within
        while not claim():
            assert time.monotonic() < deadline, f"not within {within:g} s: {what}"
            time.sleep(0.5)
