"""`python -m docs.generate.record`: walk through all requests at a running daemon; keep its answers for the page.

It needs mosquitto on the PATH, and takes about a minute.
"""

from __future__ import annotations

import json
import os
import shutil
import socket
import subprocess
import sys
import tempfile
import time
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from docs.generate.commands import BAUDRATE, CONFIG, RECORDED, SLAVES, WALK
from lfs10d.simulator.builder import LinePlan, build
from lfs10d.simulator.pty import PtyLine
from lfs10d.simulator.sensor import Sensor
from lfs10d.simulator.wire import Format

PROGRAM = [sys.executable, "-m", "lfs10d"]


def main() -> None:
    """Record; CalledProcessError where a request has no answer."""
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        line = build(LinePlan(SLAVES, Format(BAUDRATE)))
        line.add(Sensor(1, format=Format(9600)))
        served = PtyLine(line, link=folder / "ttyUSB0")
        served.start()
        stack.callback(served.stop)
        with socket.socket() as probe:
            probe.bind(("127.0.0.1", 0))
            port = probe.getsockname()[1]
        file = folder / "lfs10d.yaml"
        own = {"line": {"port": str(served.link), "baudrate": BAUDRATE}, "mqtt": {"host": "127.0.0.1", "port": port}}
        file.write_text(json.dumps({**own, **CONFIG}))
        broker = shutil.which("mosquitto", path=f"{os.environ['PATH']}:/usr/sbin")
        for command in (
            [str(broker), "-p", str(port)],
            [*PROGRAM, "run", "-c", str(file), "--state-dir", str(folder / "state")],
        ):
            process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)  # noqa: S603  # ours
            stack.callback(process.wait)
            stack.callback(process.terminate)
            time.sleep(3.0)
        answers = [_asked(file, number, step.arguments) for number, step in enumerate(WALK, 1)]
        text = json.dumps(answers, indent=1, ensure_ascii=False).replace(str(folder), "/dev")
    RECORDED.write_text(f"{text}\n", encoding="utf-8")


def _asked(file: Path, number: int, arguments: list[str]) -> Any:  # noqa: ANN401  # any JSON
    command = [*PROGRAM, "request", *arguments, f"id=a{number}", "--json", "-c", str(file)]
    done = subprocess.run(command, stdout=subprocess.PIPE, check=False, timeout=120)  # noqa: S603  # ours
    return json.loads(done.stdout)


if __name__ == "__main__":
    main()
