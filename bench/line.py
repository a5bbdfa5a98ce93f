"""The paced line as the harness sees it: a port, windows of counts, and the log of every value sent."""

from __future__ import annotations

import json
import signal
import struct
import subprocess
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any, Self, cast

from bench.programs import build_line, end


@dataclass(frozen=True)
class Sent:
    """One value a sensor sent; times are CLOCK_MONOTONIC seconds, `value` is the float32."""

    order: int
    slave: int
    value: float
    requested: float
    ended: float
    kind: str

    @property
    def whole(self) -> bool:
        """The answer went over the wire unspoilt and in time."""
        return self.kind == "ok"

    @property
    def believable(self) -> bool:
        """The answer was whole and belonged to the request the master had sent last."""
        return self.kind in ("ok", "late")


def read_log(path: Path) -> list[Sent]:
    """Read what the line sent, in the order in which it ended."""
    sent = []
    for order, text in enumerate(path.read_text().splitlines()):
        slave, bits, requested, ended, kind = text.split()
        (value,) = struct.unpack(">f", bytes.fromhex(bits))
        sent.append(Sent(order, int(slave), value, int(requested) / 1e9, int(ended) / 1e9, kind))
    return sent


class PacedLine:
    """`bench/paced_line.c` running; a context manager."""

    def __init__(self, folder: Path, *options: str) -> None:
        self.port = folder / "line"
        self.log = folder / "line.log"
        self._process = subprocess.Popen(
            [str(build_line()), "--link", str(self.port), "--log", str(self.log), *options],
            stdout=subprocess.PIPE,
            text=True,
        )
        self._output = cast("IO[str]", self._process.stdout)
        if not self._output.readline():
            raise RuntimeError("the paced line did not start")

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        end(self._process)

    def window(self) -> dict[str, Any]:
        """Return the counts since the last call (or the start) and begin anew."""
        self._process.send_signal(signal.SIGUSR1)
        return cast("dict[str, Any]", json.loads(self._output.readline()))

    def close(self) -> dict[str, Any]:
        """End it; return the counts since the last window."""
        return cast("dict[str, Any]", json.loads(end(self._process)))
