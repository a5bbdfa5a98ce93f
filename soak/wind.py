"""`python -m soak.wind --for 1h`: `wind` and `record` of a recorded wind, compared from outside with a naive reference.

A simulated line plays a recording (CSV), the daemon polls it at 1 to 4 Hz, mosquitto carries what it publishes, and
mosquitto_sub writes it down; then every figure of every message is computed again from the samples published.
"""

from __future__ import annotations

import argparse
import json
import math
import random
import shutil
import subprocess
import sys
import tempfile
import time
from collections import Counter, defaultdict
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from bench.broker import Broker, await_claim
from bench.programs import end
from lfs10d.schema.quantities import seconds as duration
from soak.wind_pandas import RollingGusts
from soak.wind_reference import Comparison, Measured, compare_record, compare_wind

INTERVALS = {"mast-250ms": 0.25, "mast-500ms": 0.5, "mast-1s": 1.0, "mast-2s": 2.0}
"""Seconds by device; above 1 s there are no gusts."""

HOLD_LEAST = 2000
ROWS_EVERY = 0.25
SILENCES = {2: ((900, 95),), 3: ((400, 5),), 4: ((1500, 400), (2800, 3))}
"""Sensors, by slave id, that fall silent: at second, for seconds."""

FRONT = (1100, 1700)
"""Seconds within which the wind is 8 m/s stronger: two discontinuities."""

FIRST_SLAVE = 2
SHOWN = 20
"""So many differences are printed."""


def recording(seconds: float, seed: int) -> Iterable[str]:
    """Yield the lines of a recording: gusts of some seconds about a mean that drifts, and a front."""
    drawn = random.Random(seed)  # noqa: S311 - a wind, no secret
    names = [f"{FIRST_SLAVE + place}.wind_speed" for place in range(len(INTERVALS))]
    yield ",".join(["time", *names])
    gusts = [0.0] * len(names)
    for row in range(round(seconds / ROWS_EVERY)):
        at = row * ROWS_EVERY
        mean = 7 + 3 * math.sin(at / 600) + (8 if FRONT[0] <= at < FRONT[1] else 0)
        gusts = [0.93 * gust + drawn.gauss(0, 0.55) for gust in gusts]
        yield ",".join([f"{at:g}", *(f"{max(0.0, mean + gust):.2f}" for gust in gusts)])


class Rig:
    """A line, a broker, a daemon and a subscriber in `folder`."""

    def __init__(self, folder: Path, seconds: float, seed: int) -> None:
        self.heard = folder / "heard.txt"
        self._folder = folder
        (folder / "wind.csv").write_text("\n".join(recording(seconds + 60, seed)) + "\n")
        faults = {
            slave: [{"fault": "silent", "after": f"{at}s", "for": f"{long}s"} for at, long in silences]
            for slave, silences in SILENCES.items()
        }
        (folder / "faults.yaml").write_text(
            "slaves:\n" + "".join(f"  {key}: {json.dumps(faults[key])}\n" for key in faults)
        )
        slaves = [
            f"{{id: {FIRST_SLAVE + place}, name: {name}, interval: {interval}}}"
            for place, (name, interval) in enumerate(INTERVALS.items())
        ]
        self._slaves = ", ".join(slaves)
        self._programs: list[subprocess.Popen[str]] = []

    def run(self, seconds: float) -> None:
        """Let it run."""
        with Broker(self._folder) as broker:
            try:
                self._start(broker.port)
                time.sleep(seconds)
                gone = [each.args for each in self._programs if each.poll() is not None]
                if gone:
                    raise RuntimeError(f"ended by itself: {gone}; logs are in {self._folder}")
            finally:
                for each in reversed(self._programs):
                    end(each)

    def _start(self, port: int) -> None:
        link, last = self._folder / "line", FIRST_SLAVE + len(INTERVALS) - 1
        configuration = self._folder / "line0.yaml"
        configuration.write_text(
            f"line: {{port: {link}, baudrate: 19200}}\n"
            f"slaves: [{self._slaves}]\n"
            f"mqtt: {{host: 127.0.0.1, port: {port}}}\n"
        )
        topic = "lfs10d/line0/device/+/"
        leaves = [word for leaf in ("telemetry", "history", "wind", "record") for word in ("-t", topic + leaf)]
        self._program(
            "sub", "mosquitto_sub", "-p", str(port), "-V", "5", "-q", "1", *leaves, "-F", "%t %p", out="heard.txt"
        )
        lfs10d = (sys.executable, "-m", "lfs10d")
        files = ("--wind", str(self._folder / "wind.csv"), "--faults", str(self._folder / "faults.yaml"))
        line = ("simulate", "--link", str(link), "--slaves", f"{FIRST_SLAVE}-{last}", "--baudrate", "19200", *files)
        self._program("simulate", *lfs10d, *line)
        await_claim(link.exists, "the simulated line is there")
        self._program("daemon", *lfs10d, "run", "-c", str(configuration), "--state-dir", str(self._folder / "state"))

    def _program(self, name: str, *command: str, out: str | None = None) -> None:
        with (self._folder / (out or f"{name}.log")).open("wb") as log:
            error = subprocess.STDOUT if out is None else subprocess.DEVNULL
            self._programs.append(
                subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=log, stderr=error, text=True)
            )


def compared(heard: Iterable[str], *, pandas: bool = False) -> tuple[Comparison, dict[str, int]]:
    """Compare all that was heard, `topic payload` in each line; return how many messages of each kind there were.

    `pandas`: with its gusts, in place of the naive reference.
    """
    samples: defaultdict[str, dict[int, dict[str, Any]]] = defaultdict(dict)
    messages: list[tuple[str, dict[str, Any]]] = []
    for line in heard:
        topic, _, payload = line.partition(" ")
        leaf, content = topic.rsplit("/", 1)[1], json.loads(payload)
        if leaf in ("wind", "record"):
            messages.append((leaf, content))
        else:
            for sample in content if isinstance(content, list) else [content]:
                samples[sample["device"]][sample["seq"]] = sample
    counts = Counter(leaf for leaf, _ in messages)
    measured = {}
    for device, found in samples.items():
        hold = max(HOLD_LEAST, round(2000 * INTERVALS[device]))
        good = [(each["ts"], each["wind_speed"], hold) for each in found.values() if each["quality"] == "good"]
        counts.update(samples=len(found), good=len(good))
        measured[device] = Measured(good)
    made = Comparison()
    rolling = {device: RollingGusts(each) for device, each in measured.items()} if pandas else {}
    for leaf, message in messages:
        device = message["device"]
        undersampled = INTERVALS[device] > 1
        match leaf, rolling.get(device):
            case "wind", None:
                compare_wind(made, message, measured[device], undersampled=undersampled)
            case "record", None:
                compare_record(made, message, measured[device], undersampled=undersampled)
            case "wind", RollingGusts() as second:
                second.compare_wind(made, message)
            case "record", RollingGusts() as second if not undersampled:
                second.compare_record(made, message)
            case _:
                pass
    return made, dict(counts)


def main() -> int:
    """Run, compare, print; 1 where a figure differs."""
    parser = argparse.ArgumentParser(prog="python -m soak.wind", description=__doc__)
    parser.add_argument("--for", dest="length", type=duration, default=3600.0, metavar="TIME", help="(1h)")
    parser.add_argument("--seed", type=int, default=1, help="of the recording (1)")
    parser.add_argument("--heard", type=Path, help="compare what an earlier run heard")
    parser.add_argument("--pandas", action="store_true", help="with gusts by pandas, which is to be installed")
    options = parser.parse_args()
    folder = Path(tempfile.mkdtemp(prefix="lfs10d-wind-"))
    heard = options.heard or folder / "heard.txt"
    if options.heard is None:
        print(f"{options.length:g} s; everything is in {folder}", flush=True)
        Rig(folder, options.length, options.seed).run(options.length)
    with heard.open() as lines:
        made, counts = compared(lines, pandas=options.pandas)
    print(f"{counts}: {made.figures} figures compared, {len(made.differences)} differences")
    for each in made.differences[:SHOWN]:
        print(each)
    if made.differences or not made.figures:
        return 1
    shutil.rmtree(folder)
    return 0


if __name__ == "__main__":
    sys.exit(main())
