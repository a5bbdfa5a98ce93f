"""`python -m bench.page`: what viewers of the page cost the page's server and the daemon.

A simulated line of eight sensors polled twice a second, a mosquitto, the daemon and `lfs10d web`, each a process of its
own; viewers that read the stream are in one more. Spans without and with viewers alternate. Printed are the share of a
core of both processes, polls per second and memory.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import re
import select
import socket
import subprocess
import sys
import tempfile
import time
import urllib.request
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import Final

from bench.broker import Broker
from bench.programs import weigh

SENSORS: Final = 8
INTERVAL: Final = "500ms"
SETTLE: Final = 10.0
"""s before the first span, and 1 s of it after each change."""


@dataclass(frozen=True, slots=True)
class Span:
    """One span: shares of a core, and polls per second."""

    viewers: int
    web: float
    daemon: float
    polls: float


def watch(address: tuple[str, int], viewers: int) -> None:
    """Read so many streams until killed."""
    head = f"GET /api/events HTTP/1.1\r\nHost: {address[0]}:{address[1]}\r\n\r\n".encode()
    streams = [socket.create_connection(address) for _ in range(viewers)]
    for stream in streams:
        stream.sendall(head)
    while True:
        for stream in select.select(streams, [], [])[0]:
            if not stream.recv(2**18):
                raise RuntimeError("the server ended a stream")


@contextmanager
def program(log: Path, *arguments: str) -> Iterator[subprocess.Popen[bytes]]:
    """Run a verb of lfs10d until the end of the block."""
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    with log.open("wb") as file:
        process = subprocess.Popen(
            [sys.executable, "-m", "lfs10d", *arguments], stdin=subprocess.DEVNULL, stdout=file, stderr=file,
            env=environment,
        )  # fmt: skip
    try:
        yield process
    finally:
        process.terminate()
        process.wait()


def polls(address: str) -> int:
    """Return how many polls the page has seen: the sum of all sequence numbers."""
    with urllib.request.urlopen(f"{address}/api/state") as answer:  # noqa: S310  # of our own
        lines = json.load(answer)["lines"]
    return sum(device["seq"] or 0 for line in lines.values() for device in line["devices"].values())


def span(address: str, web: int, daemon: int, viewers: int, seconds: float) -> Span:
    """Measure one span."""
    host, port = address.removeprefix("http://").split(":")
    watching = multiprocessing.Process(target=watch, args=((host, int(port)), viewers), daemon=True)
    if viewers:
        watching.start()
    time.sleep(SETTLE / 10)
    before, seen, since = (weigh(web).cpu, weigh(daemon).cpu), polls(address), time.monotonic()
    time.sleep(seconds)
    after, took = (weigh(web).cpu, weigh(daemon).cpu), time.monotonic() - since
    found = Span(viewers, (after[0] - before[0]) / took, (after[1] - before[1]) / took, (polls(address) - seen) / took)
    if viewers:
        watching.kill()
        watching.join()
    return found


def measure(viewers: int, seconds: float, rounds: int) -> None:
    """Measure and print."""
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        broker = stack.enter_context(Broker(folder))
        slaves = ", ".join(str(each) for each in range(2, SENSORS + 2))
        file = folder / "lfs10d.yaml"
        file.write_text(
            f"line: {{port: {folder}/tty, baudrate: 19200}}\npoll: {{interval: {INTERVAL}}}\nslaves: [{slaves}]\n"
            f"mqtt: {{host: 127.0.0.1, port: {broker.port}}}\n"
        )
        link = ("simulate", "--link", str(folder / "tty"), "--slaves", f"2-{SENSORS + 1}", "--baudrate", "19200")
        stack.enter_context(program(folder / "line.log", *link))
        time.sleep(SETTLE / 2)
        verb = ("run", "-c", str(file), "--state-dir", str(folder / "state"))
        daemon = stack.enter_context(program(folder / "run.log", *verb))
        log = folder / "web.log"
        web = stack.enter_context(program(log, "web", "-c", str(file), "--listen", "127.0.0.1:0"))
        while not (found := re.search(r"http://127\.0\.0\.1:\d+", log.read_text())):
            time.sleep(0.1)
        address = found[0]
        time.sleep(SETTLE)
        spans = [span(address, web.pid, daemon.pid, each, seconds) for _ in range(rounds) for each in (0, viewers)]
        for each in spans:
            print(_row(each))
        without, with_viewers = ([one for one in spans if bool(one.viewers) is seen] for seen in (False, True))
        for name in ("web", "daemon"):
            shares = [median(getattr(one, name) for one in group) for group in (without, with_viewers)]
            words = f"{name}: {shares[0]:.2%} -> {shares[1]:.2%} of a core, {shares[1] - shares[0]:+.2%}"
            print(f"{words} by {viewers} viewers")
        print(f"memory: web {weigh(web.pid).rss:.1f} MB, daemon {weigh(daemon.pid).rss:.1f} MB")


def _row(each: Span) -> str:
    return f"{each.viewers:2} viewers: web {each.web:.2%}, daemon {each.daemon:.2%}, {each.polls:.2f} polls/s"


def main() -> None:
    """Measure as asked."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--viewers", type=int, default=20)
    parser.add_argument("--seconds", type=float, default=30.0, help="of a span")
    parser.add_argument("--rounds", type=int, default=4)
    arguments = parser.parse_args()
    measure(arguments.viewers, arguments.seconds, arguments.rounds)


if __name__ == "__main__":
    main()
