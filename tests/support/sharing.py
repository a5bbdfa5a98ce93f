"""How the tests are shared among the workers of pytest-xdist: those that wait, and those that compute.

Tests of folders that wait for other programs go to most workers, the others to one of them, whose priority is low: so a
processor is always busy, and an answer that is due within milliseconds is still in time. The worker that computes ends
when nothing is left to compute; those that wait take that too when nothing else is left.

A file is one piece, for one worker; in folders whose tests share nothing a test is. Of both kinds the longest begin
first, so that none is waited for in the end.
"""

from __future__ import annotations

import contextlib
import os
import re
import signal
import sys
from collections.abc import Iterable
from hashlib import sha256
from typing import Any

import pytest
from xdist.scheduler import LoadScopeScheduling  # type: ignore[import-untyped]

WAITING = frozenset({"bench", "cli", "daemon", "devices", "modbus", "mqtt", "simulator", "soak", "system", "web"})
"""The folders whose tests wait for other programs, or for bytes on a line in real time, rather than compute."""
APART = frozenset({"cli", "daemon", "mqtt"})
"""The folders whose tests share nothing, and may each go to another worker."""
TOGETHER = frozenset({"tests/cli/test_demo.py"})
"""Files of these whose tests need something that there is once: the usual port of a broker."""
FEWEST = 3
"""With fewer workers none is set apart."""
HELD = 2
"""A worker begins a test when it knows the next one too: so many it has at least."""
LOWER = 10
"""How much lower the priority of those that compute is (nice)."""
SWITCH_INTERVAL = 1e-4
"""Seconds after which a thread lets another run: a simulated line is one of a worker's, and has to answer in time."""


def waits(nodeid: str) -> bool:
    """Whether a test waits."""
    return nodeid.split("/")[1] in WAITING


def piece_of(nodeid: str) -> str:
    """Return what goes to one worker with this test: its file, or the test alone."""
    file = nodeid.split("::", maxsplit=1)[0]
    return nodeid if file.split("/")[1] in APART and file not in TOGETHER else file


def computing(number: int, workers: int) -> bool:
    """Whether of so many workers the one of this number, from 0 on, computes: the last does, of eight the last two."""
    return workers >= FEWEST and workers - max(1, workers // 4) <= number < workers


def this_worker() -> tuple[int, int] | None:
    """Return the number of this worker and how many there are; None in no worker, or one for one that died."""
    number = re.fullmatch(r"gw(\d+)", os.environ.get("PYTEST_XDIST_WORKER", ""))
    return None if number is None else (int(number[1]), int(os.environ["PYTEST_XDIST_WORKER_COUNT"]))


def take_place(number: int, workers: int) -> None:
    """Let this worker answer in time, or stand back behind those that must.

    Linux shares the processors among sessions first (sched(7), autogroup): in one of its own a worker that waits is
    served before all that compute. The first terminal that it opens may become its own, and hang up.
    """
    sys.setswitchinterval(SWITCH_INTERVAL)
    signal.signal(signal.SIGHUP, lambda *_: None)
    with contextlib.suppress(OSError):  # it leads its session already
        os.setsid()
    if computing(number, workers):
        os.nice(LOWER)


def ordered(items: Iterable[pytest.Item]) -> list[pytest.Item]:
    """Return the tests piece by piece, the longest first and the others mixed: the same in every worker."""
    seconds: dict[str, float] = {}
    listed = list(items)
    for item in listed:
        mark = item.get_closest_marker("long")
        piece = piece_of(item.nodeid)
        seconds[piece] = max(seconds.get(piece, 0.0), 0.0 if mark is None else float(mark.args[0]))
    return sorted(listed, key=lambda item: _rank(piece_of(item.nodeid), seconds))


def _rank(piece: str, seconds: dict[str, float]) -> tuple[float, bytes, str]:
    return -seconds[piece], sha256(piece.encode()).digest(), piece


class Sharing(LoadScopeScheduling):  # type: ignore[misc]  # xdist is not typed
    """Gives each worker the next piece of its kind, one before it is through with what it has."""

    def _split_scope(self, nodeid: str) -> str:
        return piece_of(nodeid)

    def _assign_work_unit(self, node: Any) -> None:  # noqa: ANN401 - xdist's WorkerController
        if (piece := self._next(node)) is None:
            node.shutdown()
            return
        self.workqueue.move_to_end(piece, last=False)
        super()._assign_work_unit(node)

    # xdist's own gives more ahead, which then waits behind a long one.
    def _reschedule(self, node: Any) -> None:  # noqa: ANN401 - xdist's WorkerController
        if not node.shutting_down and self._pending_of(self.assigned_work[node]) < HELD:
            self._assign_work_unit(node)

    def _next(self, node: Any) -> str | None:  # noqa: ANN401 - as above
        """Return the next piece for a worker, None if there is none."""
        number = int(node.gateway.id.removeprefix("gw"))
        computes = computing(number, self.numnodes)
        first = next((piece for piece in self.workqueue if waits(piece) is not computes), None)
        return first if first is not None or computes else next(iter(self.workqueue), None)
