"""Locks a port for one owner, and finds the process that holds it instead.

flock keeps out every program that asks by flock, root's too. TIOCEXCL keeps out those that ask nothing, but lets
root pass; so root looks whether the flag was there already. On a pty TIOCEXCL is not set: there the flag lives as
long as the other end, and a killed daemon would lock itself out.
"""

from __future__ import annotations

import errno
import fcntl
import os
import struct
import termios
from pathlib import Path

from lfs10d.system.dataclass import dataclass
from lfs10d.system.logs import escape

PROC = Path("/proc")

TIOCGEXCL = 0x80045440
"""_IOR('T', 0x40, int) of asm-generic/ioctls.h: is the terminal exclusive?"""

PTY_MAJORS = range(136, 144)
"""Slaves of Unix98 ptys (kernel document devices.txt)."""


@dataclass(frozen=True, slots=True)
class Holder:
    """A process that holds a port; `program` is safe to print and "" where it cannot be seen."""

    pid: int
    program: str

    def __str__(self) -> str:
        """Return `mbpoll (process 4711)`."""
        return f"{self.program} (process {self.pid})" if self.program else f"process {self.pid}"


def is_pty(fd: int) -> bool:
    """Return whether the open device is the slave of a pty, not a UART."""
    return os.major(os.fstat(fd).st_rdev) in PTY_MAJORS


def claim(fd: int, *, proc: Path = PROC) -> bool:
    """Lock the open port; False if another process has it. Raises OSError for other failures."""
    try:
        fcntl.flock(fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        if error.errno in {errno.EWOULDBLOCK, errno.EACCES}:
            return False
        raise
    pty = is_pty(fd)
    # Only root gets this far on an exclusive port. On a pty the flag may be left over from a dead process.
    if _exclusive(fd) and (not pty or _opener(os.fstat(fd), proc) is not None):
        return False
    if not pty:
        fcntl.ioctl(fd, termios.TIOCEXCL)
    return True


def release(fd: int) -> None:
    """Undo `claim` before closing: the flag would stay while another process has the port open. Never fails."""
    try:
        if not is_pty(fd):
            fcntl.ioctl(fd, termios.TIOCNXCL)
        fcntl.flock(fd, fcntl.LOCK_UN)
    except OSError:
        return  # hung up: the locks went with it


def holder(path: str, *, proc: Path = PROC) -> Holder | None:
    """Return the process that holds the port, by its lock or else its open file; None where /proc does not show it."""
    try:
        status = Path(path).stat()
    except (OSError, ValueError):
        return None
    try:
        locks = (proc / "locks").read_text("ascii", "replace")
    except OSError:
        locks = ""
    pid = locked_by(locks, status.st_dev, status.st_ino)
    if pid is None or pid == os.getpid():
        pid = _opener(status, proc)
    return None if pid is None else Holder(pid, escape(_program(proc / str(pid))))


def locked_by(locks: str, device: int, inode: int) -> int | None:
    """Return the process that holds the flock of a file, by the text of /proc/locks (proc_locks(5)).

    A line reads `1: FLOCK  ADVISORY  WRITE 4711 00:05:94 0 EOF`, device in hex; `->` marks who only waits.
    """
    wanted = f"{os.major(device):02x}:{os.minor(device):02x}:{inode}"
    for line in locks.splitlines():
        match line.split():
            case [_, "FLOCK", _, "WRITE", pid, place, *_] if place == wanted and pid.isdecimal() and int(pid) > 0:
                return int(pid)
    return None


def program_name(comm: str, argv: list[str]) -> str:
    """Return what a person would call the process: of a Python interpreter the script or module that it runs."""
    if not comm.startswith("python"):
        return comm
    words = iter(argv[1:])
    for word in words:
        if word == "-m":
            return next(words, comm)
        if word == "-c":
            return comm
        if word in {"-W", "-X"}:
            next(words, None)
        elif word and not word.startswith("-"):
            return word.rpartition("/")[2]
    return comm


def _exclusive(fd: int) -> bool:
    raw = bytearray(4)
    try:
        fcntl.ioctl(fd, TIOCGEXCL, raw)
    except OSError:
        return False
    return struct.unpack("@i", raw) != (0,)


def _opener(status: os.stat_result, proc: Path) -> int | None:
    """Return another process that has the device open, as far as we may see."""
    for process in _names(proc):
        if not process.isdecimal() or int(process) == os.getpid():
            continue
        folder = proc / process / "fd"
        if any(_leads_to(folder / name, status) for name in _names(folder)):
            return int(process)
    return None


def _names(folder: Path) -> list[str]:
    try:
        return [entry.name for entry in folder.iterdir()]
    except OSError:
        return []  # gone, or not ours to see


def _leads_to(link: Path, status: os.stat_result) -> bool:
    try:
        # Only devices are asked further: a stat of any open file can hang for ever on a dead network drive.
        return str(link.readlink()).startswith("/dev/") and os.path.samestat(status, link.stat())
    except OSError:
        return False


def _program(process: Path) -> str:
    try:
        comm = (process / "comm").read_text("utf-8", "replace").strip()
        argv = (process / "cmdline").read_text("utf-8", "replace").split("\0")
    except OSError:
        return ""
    return program_name(comm, argv)
