"""Examines the machine: clock, disk of the state directory, service, other daemons."""

from __future__ import annotations

import errno
import os
import shutil
import statistics
import subprocess
import time
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Final

from lfs10d.cli.doctor.finding import Area, Finding
from lfs10d.cli.doctor.port import Root, there
from lfs10d.system.clock_step import ClockState
from lfs10d.system.dataclass import dataclass

CLOCK, DISK, SERVICE = Area("clock"), Area("disk"), Area("service")

SLOW_SYNC: Final = 0.2
"""s for one write with fsync: from here on a change takes noticeably long."""
STUCK_SYNC: Final = 2.0
WRITES: Final = 5
MUCH_WRITTEN: Final = 20e9
"""Bytes written a day that wear out a usual SD card of 32 GB within years."""
SECTOR: Final = 512
LONG_ENOUGH: Final = 3600.0
"""s since the boot; before that the rate of writing means little."""
CLOCK_SLACK: Final = 86400.0
REFUSED: Final[Mapping[int, str]] = {
    errno.ENOSPC: "make room: df -h; large folders: sudo du -xh --max-depth=2 /var | sort -h | tail",
    errno.EDQUOT: "make room, or raise the quota",
    errno.EROFS: "a failing SD card is made read-only: dmesg; else sudo mount -o remount,rw, and see /etc/fstab",
}
"""What to do if a write is refused, by errno. Samples are published all the same, without a backlog."""


@dataclass(frozen=True, slots=True)
class DiskState:
    """The disk of the state directory; `sync` in s, `written` in bytes a day, None where not known."""

    folder: Path
    device: str
    exists: bool
    writable: bool
    free: int
    wanted: int
    sync: float | None = None
    written: float | None = None
    refused: int = 0
    """The errno of a refused write; 0 if it succeeded or none was tried."""


def clock(state: ClockState, now: float, installed: float) -> Iterator[Finding]:
    """Yield the findings about the wall clock; `now` and `installed` in s since the epoch."""
    if now < installed - CLOCK_SLACK:
        yield CLOCK.fail(
            f"it says {time.strftime('%Y-%m-%d %H:%M', time.gmtime(now))} UTC, before this version was installed",
            "give the machine the time: timedatectl, a network with NTP, or a real-time clock",
        )
    elif state == "synced":
        yield CLOCK.ok("synchronised")
    elif state == "unsynced":
        yield CLOCK.warn("not synchronised: samples are marked unsynced", "timedatectl; sudo timedatectl set-ntp true")
    else:
        yield CLOCK.warn("it is not known whether it is synchronised", "install systemd-timesyncd or chrony")


def look_at_disk(folder: Path, wanted: int, root: Root | None = None) -> DiskState:
    """Return the state of the state directory's disk; a small file is written there and removed, if permitted."""
    root = root or Root()
    existing = next(each for each in (folder, *folder.parents) if there(each))
    writable = existing == folder and folder.is_dir() and os.access(folder, os.W_OK)
    device = _device(existing)
    refused = errno.EROFS if os.statvfs(existing).f_flag & os.ST_RDONLY else 0
    sync = _sync_time(folder) if writable and not refused else None
    if isinstance(sync, OSError):
        refused = sync.errno or errno.EIO
        sync = None
    return DiskState(
        folder=folder,
        device=device,
        exists=os.path.lexists(folder),
        writable=writable,
        free=shutil.disk_usage(existing).free,
        wanted=wanted,
        sync=sync,
        written=_written_a_day(device, root),
        refused=refused,
    )


def _device(path: Path) -> str:
    """Return the name of the block device that holds a path, such as mmcblk0p2; "" if there is none."""
    number = path.stat().st_dev
    link = Path(f"/sys/dev/block/{os.major(number)}:{os.minor(number)}")
    return link.resolve().name if there(link) else ""


def _sync_time(folder: Path) -> float | OSError:
    probe = folder / f".doctor-{os.getpid()}"
    took = []
    try:
        for _ in range(WRITES):
            began = time.monotonic()
            descriptor = os.open(probe, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW, 0o600)
            try:
                os.write(descriptor, bytes(4096))
                os.fsync(descriptor)
            finally:
                os.close(descriptor)
                probe.unlink()
            took.append(time.monotonic() - began)
    except OSError as error:
        return error
    return statistics.median(took)


def _written_a_day(device: str, root: Root) -> float | None:
    uptime = root.read("proc/uptime").partition(" ")[0]
    for line in root.read("proc/diskstats").splitlines():
        words = line.split()
        if device and len(words) > 9 and words[2] == device and uptime:  # noqa: PLR2004  # iostats.txt: sectors written
            seconds = float(uptime)
            return int(words[9]) * SECTOR * 86400 / seconds if seconds > LONG_ENOUGH else None
    return None


def disk(state: DiskState) -> Iterator[Finding]:
    """Yield the findings about the disk."""
    where = str(state.folder)
    if state.refused:
        yield DISK.fail(
            f"{where} cannot be written: {os.strerror(state.refused).lower()}",
            REFUSED.get(state.refused, "is the disk or SD card failing? dmesg, and journalctl -k -p err"),
        )
    elif state.sync is not None and state.sync >= STUCK_SYNC:
        yield DISK.fail(f"{where}: a write takes {state.sync:.1f} s", "the disk or SD card is failing: replace it")
    elif state.sync is not None and state.sync >= SLOW_SYNC:
        yield DISK.warn(f"{where}: a write takes {state.sync:.1f} s", "is the SD card worn out, or the disk busy?")
    elif state.writable:
        speed = "" if state.sync is None else f", a write takes {state.sync * 1e3:.0f} ms"
        yield DISK.ok(f"{where} can be written{speed}")
    elif not state.exists:
        yield DISK.ok(f"{where} does not exist yet: the daemon creates it")
    else:
        yield DISK.warn(
            f"{where} cannot be written by this user", "the service can write there; as root more is examined"
        )
    if state.free < state.wanted:
        yield DISK.warn(
            f"{state.free / 1e6:.0f} MB are free, and the backlog may take {state.wanted / 1e6:.0f} MB",
            "make room, or set store.max_size lower",
        )
    if state.written is not None and state.device.startswith("mmcblk") and state.written > MUCH_WRITTEN:
        yield DISK.warn(
            f"{state.written / 1e9:.0f} GB a day are written to the SD card",
            "which program? sudo iotop -ao; journal in memory: Storage=volatile in journald.conf",
        )


# The service


def unit_state(unit: str) -> dict[str, str] | None:
    """Return systemd's properties of a unit; None without systemd."""
    keys = "LoadState,UnitFileState,ActiveState,SubState,NRestarts,Result,ExecMainStatus,WatchdogUSec,MainPID"
    try:
        done = subprocess.run(  # noqa: S603  # the unit's name is ours
            ["systemctl", "show", unit, f"--property={keys}"],  # noqa: S607  # the system's own
            capture_output=True, text=True, timeout=10, check=True,
        )  # fmt: skip
    except (OSError, subprocess.SubprocessError):
        return None
    return dict(line.split("=", 1) for line in done.stdout.splitlines() if "=" in line)


def service(unit: str, state: Mapping[str, str] | None) -> Iterator[Finding]:
    """Yield the findings about a unit."""
    if state is None:
        yield SERVICE.warn(
            "there is no systemd on this machine", "see docs/installation.md, or start lfs10d run yourself"
        )
        return
    if state.get("LoadState") != "loaded":
        yield SERVICE.warn(f"{unit} is not installed", "sudo lfs10d service install, or the Debian package")
        return
    active, result = state.get("ActiveState"), state.get("Result", "")
    if active == "active":
        yield SERVICE.ok(f"{unit} runs (process {state.get('MainPID')})")
    elif state.get("ExecMainStatus") == "78":
        yield SERVICE.fail(f"{unit} has ended: the configuration is wrong", "lfs10d check, then systemctl restart")
    elif active == "failed" or result not in {"", "success"}:
        yield SERVICE.fail(f"{unit} is {active} ({result})", f"why: journalctl -u {unit} -n 30")
    else:
        yield SERVICE.fail(f"{unit} does not run", f"sudo systemctl start {unit}")
    if state.get("UnitFileState") not in {"enabled", "enabled-runtime"}:
        yield SERVICE.warn(f"{unit} is not started at boot", f"sudo systemctl enable {unit}")
    restarts = state.get("NRestarts", "0")
    if restarts != "0":
        yield SERVICE.warn(f"{unit} was restarted {restarts} times ({result})", f"why: journalctl -u {unit}")
    if state.get("WatchdogUSec", "infinity") in {"0", "infinity"}:
        yield SERVICE.warn(f"{unit} has no watchdog", "take WatchdogSec= from the unit of this version")


def daemons(same: tuple[int, ...]) -> Iterator[Finding]:
    """Yield a finding where several daemons run for one configuration or one port; `same` are processes."""
    if len(same) > 1:
        processes = ", ".join(map(str, same))
        yield SERVICE.fail(
            f"{len(same)} daemons run for this line (processes {processes})",
            "end all but one: they disconnect each other at the broker, and only one can have the port",
        )
