"""A daemon as a process on a simulated line, and what it publishes."""

from __future__ import annotations

import json
import os
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any

from lfs10d.daemon.pace import USUAL, Pace
from lfs10d.simulator.builder import LinePlan, build
from lfs10d.simulator.line import SimulatedLine
from lfs10d.simulator.pty import PtyLine
from lfs10d.simulator.wire import Format
from tests.support import forked
from tests.support.brokers import Heard, Listener
from tests.support.forked import Process

PATIENCE = 20.0
"""Seconds after which something awaited counts as not happening; no test waits this long when all is well."""
SPARSE = {"interval": "500ms"}
"""A change waits so that the others keep nine tenths of their polls: the rarer these are, the sooner it is over."""
QUICK = Pace(history_wait=1.0, change_share=1.0)
"""Of a daemon whose history and changes are awaited, where it is not the subject how long they may take."""
ENDS_WITHIN = 2.0
"""Seconds from SIGTERM to the end (contract, section 2)."""


def eventually(claim: Callable[[], Any], what: str, *, within: float = PATIENCE) -> Any:  # noqa: ANN401 - what is found
    """Wait until `claim()` is true and return it; fail with `what` if it is not within `within` seconds."""
    deadline = time.monotonic() + within
    while not (found := claim()):
        assert time.monotonic() < deadline, f"not within {within:g} s: {what}"
        time.sleep(0.01)
    return found


@dataclass
class Manager:
    """The service manager's end of `$NOTIFY_SOCKET`: keeps what it was told, with the time."""

    told: list[tuple[float, str]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._socket.bind(f"\0lfs10d-test-{os.getpid()}-{id(self)}")
        self.address = "@" + self._socket.getsockname()[1:].decode()
        self._thread = threading.Thread(target=self._listen, daemon=True)
        self._thread.start()

    def _listen(self) -> None:
        while message := self._socket.recv(4096).decode():
            self.told += [(time.monotonic(), line) for line in message.split("\n")]

    def all(self, beginning: str) -> list[str]:
        """Return what was told and begins so."""
        return [line for _, line in list(self.told) if line.startswith(beginning)]

    def close(self) -> None:
        """End the thread and close."""
        with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as last:
            last.sendto(b"", self._socket.getsockname())
        self._thread.join()
        self._socket.close()


@dataclass
class Run:
    """One daemon. `process` may be ended by the test; what is left is killed."""

    process: Process
    errors: Path
    manager: Manager
    status: Path

    @property
    def log(self) -> str:
        """What it wrote on standard error so far."""
        return self.errors.read_text(errors="replace")

    def says(self, words: str, count: int = 1) -> None:
        """Wait until its log holds these words so many times."""
        eventually(lambda: self.log.count(words) >= count, f"{words!r} in the log:\n{self.log}")

    def ready(self) -> None:
        """Wait until it has told the service manager that it is ready."""
        eventually(lambda: self.manager.all("READY=1") or self.process.poll() is not None, f"READY\n{self.log}")
        assert self.process.poll() is None, self.log

    def reload(self) -> None:
        """Send SIGHUP and wait until it is over."""
        before = len(self.manager.all("READY=1"))
        self.process.send_signal(signal.SIGHUP)
        eventually(lambda: len(self.manager.all("READY=1")) > before, f"READY after SIGHUP\n{self.log}")

    def ends(self, number: int | None = None, *, within: float = PATIENCE) -> int:
        """Send a signal if one is given, and return the exit code."""
        if number is not None:
            self.process.send_signal(number)
        return self.process.wait(within)

    @property
    def threads(self) -> list[int]:
        """The ids of its threads."""
        return [int(task.name) for task in Path(f"/proc/{self.process.pid}/task").iterdir()]


class View:
    """What an independent subscriber knows of one line: the newest by topic, and every sample."""

    def __init__(self, listener: Listener, base: str = "lfs10d/line0") -> None:
        self.listener = listener
        self.base = base

    @property
    def heard(self) -> list[Heard]:
        """Return all messages below the base, in order."""
        return [each for each in list(self.listener.heard) if each.topic.startswith(f"{self.base}/")]

    def history_of(self, topic: str) -> list[Any]:
        """Return every version of a topic in order; None where it was cleared."""
        return [_parsed(each.payload) for each in self.listener.on(f"{self.base}/{topic}")]

    def newest(self, topic: str) -> Any:  # noqa: ANN401 - any JSON
        """Return the newest version of a topic, None if there is none."""
        versions = self.history_of(topic)
        return versions[-1] if versions else None

    def wait(self, topic: str, claim: Callable[[Any], Any] = bool) -> Any:  # noqa: ANN401 - plain data of any shape
        """Wait until the newest version of a topic is as claimed; return it."""
        deadline = time.monotonic() + PATIENCE
        while (newest := self.newest(topic)) is None or not claim(newest):
            assert time.monotonic() < deadline, f"{topic} is {newest}"
            time.sleep(0.01)
        return newest

    def samples(self, device: str, *, once: bool = True) -> list[dict[str, Any]]:
        """Return the samples of a device, live and historical, in order of arrival; each `seq` once."""
        found: list[dict[str, Any]] = []
        for each in self.heard:
            if each.topic == f"{self.base}/device/{device}/telemetry":
                found.append(_content(each.payload))
            elif each.topic == f"{self.base}/device/{device}/history":
                found += _content(each.payload)
        return list({(one["boot"], one["seq"]): one for one in found}.values()) if once else found

    def wait_samples(
        self, device: str, count: int, claim: Callable[[dict[str, Any]], bool] = lambda _: True
    ) -> list[dict[str, Any]]:
        """Wait until a device has so many samples of a kind; return those."""

        def found() -> list[dict[str, Any]]:
            return [one for one in self.samples(device) if claim(one)]

        eventually(lambda: len(found()) >= count, f"{count} samples of {device}")
        return found()

    def clear(self) -> None:
        """Forget all that was heard."""
        self.listener.heard.clear()


@lru_cache(maxsize=20_000)
def _content(payload: bytes) -> Any:  # noqa: ANN401 - plain data of any shape
    """Parse a message once, however often who waits for something looks at all that was heard; not to be changed."""
    return json.loads(payload)


def _parsed(payload: bytes) -> Any:  # noqa: ANN401 - plain data of any shape
    if not payload:
        return None
    text = payload.decode()
    return json.loads(text) if text[0] in "{[" else text


def good(sample: Mapping[str, Any]) -> bool:
    """Tell whether a sample carries a value."""
    return bool(sample["quality"] == "good")


@dataclass
class Site:
    """A line, the address of a broker, a configuration; starts daemons on them."""

    folder: Path
    port: int
    """Of the broker."""
    config: dict[str, Any] = field(default_factory=dict)
    pace: Pace = USUAL
    """Of the daemons that are forked."""
    lines: list[PtyLine] = field(default_factory=list)
    runs: list[Run] = field(default_factory=list)

    @property
    def tty(self) -> Path:
        """The path of the port."""
        return self.folder / "tty"

    @property
    def file(self) -> Path:
        """The configuration's."""
        return self.folder / "lfs10d.yaml"

    def line(
        self,
        slaves: Sequence[int] = (1, 2),
        *,
        shape: Format | None = None,
        echo: bool = False,
        started: bool = True,
    ) -> PtyLine:
        """Put up a simulated line; with `started`, plugged in. It goes before other programs where permitted."""
        line = build(LinePlan(slaves, shape or Format(19200), turnaround=0.003, unique=True), keep_log=True)
        served = PtyLine(line, link=self.tty, echo=echo, realtime=True)
        self.lines.append(served)
        if started:
            served.start()
        return served

    def write(self, **sections: Any) -> Path:  # noqa: ANN401 - plain data of any shape
        """Write the configuration: the defaults of these tests, and over them what is given, key by key."""
        config: dict[str, Any] = {
            "line": {"port": str(self.tty), "baudrate": 19200},
            "poll": {"interval": "200ms"},
            "slaves": [1, 2],
            "mqtt": {"host": "127.0.0.1", "port": self.port},
        }
        for name, section in sections.items():
            config[name] = {**config.get(name, {}), **section} if isinstance(section, dict) else section
        self.config = config
        self.file.write_text(json.dumps(config, indent=1))  # JSON is YAML too
        return self.file

    def run(
        self,
        *arguments: str,
        environment: Mapping[str, str] | None = None,
        program: Sequence[str] | None = None,
        watchdog: float | None = None,
    ) -> Run:
        """Start a daemon; with `program`, Python with these arguments before those of `run`."""
        number = len(self.runs)
        errors, runtime = self.folder / f"errors-{number}", self.folder / f"run-{number}"
        runtime.mkdir()
        manager = Manager()
        variables = {
            **{name: value for name, value in os.environ.items() if name != "XDG_RUNTIME_DIR"},
            "NOTIFY_SOCKET": manager.address,
            "RUNTIME_DIRECTORY": str(runtime),
            **({} if watchdog is None else {"WATCHDOG_USEC": str(round(watchdog * 1e6))}),
            **(environment or {}),
        }
        verb = ["run", "-c", str(self.file), "--state-dir", str(self.folder / "state"), *arguments]
        with errors.open("wb") as log:
            process: Process
            if program is None:
                process = forked.start(verb, stdout=log.fileno(), stderr=log.fileno(), env=variables, pace=self.pace)
            else:
                command = [sys.executable, *program, *verb]
                process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=log, stderr=log, env=variables)
        run = Run(process, errors, manager, runtime / "status.json")
        self.runs.append(run)
        return run

    def close(self) -> None:
        """End everything; a traceback in a log is a failure, whatever the test was about."""
        for run in self.runs:
            if run.process.poll() is None:
                run.process.kill()
            run.process.wait()
            run.manager.close()
        for line in self.lines:
            line.stop()
        for run in self.runs:
            assert "Traceback" not in run.log
            assert "fault of lfs10d itself" not in run.log
            assert "by a mistake" not in run.log
            assert "internal error" not in run.log


def tell(served: PtyLine, change: Callable[[SimulatedLine], Any]) -> None:
    """Change the line in its own thread and wait until that is done."""
    done = threading.Event()

    def carry_out(line: SimulatedLine) -> None:
        change(line)
        done.set()

    served.tell(carry_out)
    assert done.wait(PATIENCE)
