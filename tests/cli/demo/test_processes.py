"""The demo's processes and its folder."""

from __future__ import annotations

import asyncio
import os
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from lfs10d.cli.demo import processes
from lfs10d.cli.demo.parent_guard import ITSELF
from lfs10d.cli.demo.processes import Children, temporary_folder
from lfs10d.errors import FailedError

SLEEPS = (sys.executable, "-S", "-c", "import time; print('awake', flush=True); time.sleep(600)")
STUBBORN = (
    sys.executable,
    "-S",
    "-c",
    "import signal, time; signal.signal(15, signal.SIG_IGN); print('awake', flush=True); time.sleep(600)",
)
ENDS = (sys.executable, "-S", "-c", "print('first'); print('last\\x1b words'); raise SystemExit(1)")


def awake(log: Path) -> Callable[[], bool]:
    return lambda: "awake" in log.read_text()


def test_all_end_even_one_that_ignores_sigterm(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(processes, "OTHERS_END_WITHIN", 0.1)

    async def run() -> list[int | None]:
        family = Children(tmp_path)
        started = [family.start("stubborn", *STUBBORN), family.start("sleeper", *SLEEPS)]
        for child in started:
            assert await family.ready(child, awake(child.log))
        family.check()
        await family.end()
        return [child.process.returncode for child in started]

    assert asyncio.run(run()) == [-signal.SIGKILL, -signal.SIGTERM]


def test_one_that_ends_is_never_ready_and_its_last_words_are_told(tmp_path: Path) -> None:
    async def run() -> None:
        family = Children(tmp_path)
        child = family.start("daemon", *ENDS)
        assert not await family.ready(child, lambda: False)
        with pytest.raises(FailedError, match=r"the demo's daemon has ended: last\\x1b words"):
            family.check()
        await family.discard(child)
        family.check()

    asyncio.run(run())


def test_one_that_takes_too_long_is_not_ready(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(processes, "START_WITHIN", 0.05)

    async def run() -> bool:
        family = Children(tmp_path)
        ready = await family.ready(family.start("sleeper", *SLEEPS), lambda: False)
        await family.end()
        return ready

    assert asyncio.run(run()) is False


def test_a_child_is_led_to_no_file_of_a_real_daemon(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("STATE_DIRECTORY", "XDG_RUNTIME_DIR", "LFS10D_CONFIG", "NOTIFY_SOCKET"):
        monkeypatch.setenv(name, "/elsewhere")

    async def run() -> str:
        family = Children(tmp_path)
        child = family.start("teller", sys.executable, "-S", "-c", "import os; print(dict(os.environ))")
        await family.ready(child, lambda: not child.alive)
        return child.log.read_text()

    told = asyncio.run(run())
    assert "/elsewhere" not in told
    assert str(tmp_path) in told


def test_a_child_whose_parent_is_gone_does_not_begin(tmp_path: Path) -> None:
    trace = tmp_path / "trace"
    guard = [sys.executable, "-I", "-S", str(ITSELF)]
    not_its_parent, program = str(os.getpid() + 1), ["/bin/sh", "-c", f"echo > '{trace}'"]
    assert subprocess.run([*guard, not_its_parent, *program], check=False).returncode == 0
    assert not trace.exists()
    assert subprocess.run([*guard, str(os.getpid()), *program], check=False).returncode == 0
    assert trace.exists()


def test_the_folder_is_gone_afterwards_with_all_that_is_in_it() -> None:
    with temporary_folder() as folder:
        (folder / "deep").mkdir()
        (folder / "deep" / "file").write_text("x")
    assert not folder.exists()
