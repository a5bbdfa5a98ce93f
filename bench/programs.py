"""The bench's programs: built with gcc, started, weighed and ended."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
from dataclasses import dataclass
from pathlib import Path

HERE = Path(__file__).parent
BUILD = HERE / "build"
FLAGS = ("-std=c11", "-O2", "-Wall", "-Wextra", "-Werror", "-D_GNU_SOURCE")
LINE_SOURCES = ("paced_line.c", "options.c", "wire.c", "judge.c")
MASTER_SOURCES = ("reference_master.c",)
HEADERS = ("rtu.h", "options.h", "wire.h", "judge.h")
MOSQUITTO_HEADER = Path("/usr/include/mosquitto.h")
PATIENCE = 5.0
"""Seconds given to a program to end by itself."""


def build_program(name: str, sources: tuple[str, ...], *libraries: str) -> Path:
    """Compile a program if its sources are newer; return its path."""
    target = BUILD / name
    newest = max((HERE / source).stat().st_mtime for source in (*sources, *HEADERS))
    if not target.exists() or target.stat().st_mtime < newest:
        BUILD.mkdir(exist_ok=True)
        fresh = BUILD / f"{name}.{os.getpid()}"
        files = [str(HERE / source) for source in sources]
        subprocess.run(["gcc", *FLAGS, "-o", str(fresh), *files, *libraries], check=True)
        fresh.replace(target)
    return target


def build_line() -> Path:
    """Build the paced line."""
    return build_program("paced_line", LINE_SOURCES)


def build_reference() -> Path:
    """Build the reference master; it can publish where libmosquitto's header is installed."""
    publishing = ("-DHAVE_MOSQUITTO", "-lmosquitto") if MOSQUITTO_HEADER.exists() else ()
    return build_program("reference_master", MASTER_SOURCES, *publishing)


@dataclass(frozen=True)
class Weight:
    """What a process has used so far: CPU seconds of all its threads, and resident memory in MB."""

    cpu: float
    rss: float
    rss_anon: float


def weigh(pid: int) -> Weight:
    """Read a process's use from /proc."""
    nanoseconds = 0
    for task in Path(f"/proc/{pid}/task").iterdir():
        with contextlib.suppress(FileNotFoundError, ProcessLookupError):  # a thread that ends meanwhile
            nanoseconds += int((task / "schedstat").read_text().split()[0])
    status = dict(line.split(":", 1) for line in Path(f"/proc/{pid}/status").read_text().splitlines() if ":" in line)
    return Weight(nanoseconds / 1e9, _megabytes(status["VmRSS"]), _megabytes(status["RssAnon"]))


def _megabytes(text: str) -> float:
    return int(text.split(maxsplit=1)[0]) * 1024 / 1e6


def end(process: subprocess.Popen[str]) -> str:
    """Ask a process to end, see that it does, and return what it still printed."""
    if process.poll() is None:
        process.send_signal(signal.SIGTERM)
    try:
        printed, _ = process.communicate(timeout=PATIENCE)
    except subprocess.TimeoutExpired:
        process.kill()
        printed, _ = process.communicate()
    return printed or ""
