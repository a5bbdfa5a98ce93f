"""Which process holds a busy port, and which command to use instead."""

from __future__ import annotations

import shlex
from collections.abc import Iterator
from pathlib import Path

from lfs10d.cli import SERVICE_FILE
from lfs10d.cli.render.table import columns
from lfs10d.config.loader import load
from lfs10d.errors import ConfigError
from lfs10d.modbus.port_lock import PROC, Holder, holder
from lfs10d.system.dataclass import dataclass
from lfs10d.system.logs import escape

DAEMON = "lfs10d"


@dataclass(frozen=True, slots=True)
class HoldingDaemon:
    """A running `lfs10d run`; `config` is the file it was given, "" for the usual one."""

    pid: int
    config: str = ""

    @property
    def option(self) -> str:
        """The option that a verb needs to reach it."""
        return f" -c {shlex.quote(self.config)}" if self.config else ""


def daemon_behind(found: Holder, *, proc: Path = PROC) -> HoldingDaemon | None:
    """Return the daemon that a holder is; None for every other program and verb."""
    if found.program != DAEMON:
        return None
    try:
        argv = (proc / str(found.pid) / "cmdline").read_text("utf-8", "replace").split("\0")
    except OSError:
        return None
    return HoldingDaemon(found.pid, config_of(argv)) if "run" in argv else None


def config_of(argv: list[str]) -> str:
    """Return the configuration file a daemon was started with, "" for the usual one; safe to print."""
    words = iter(argv)
    config = ""
    for word in words:
        if word in ("-c", "--config"):
            config = next(words, "")
        elif word.startswith("--config="):
            config = word.removeprefix("--config=")
        elif word.startswith("-c") and not word.startswith("--"):
            config = word.removeprefix("-c")
    return "" if config == str(SERVICE_FILE) else escape(config)


def device_name(daemon: HoldingDaemon, slave: int) -> str:
    """Return the name the daemon's configuration gives a slave id; the usual one where it cannot be read."""
    try:
        slaves = load(Path(daemon.config or SERVICE_FILE)).config.slaves
    except (ConfigError, OSError):
        slaves = ()
    return next((each.name for each in slaves if each.id == slave), f"slave-{slave}")


def instead(path: str, *, slave: int | None, proc: Path = PROC) -> Iterator[str]:
    """Yield what to type instead of a scan (`slave` None) or of reading one slave, if the daemon holds the port."""
    found = holder(path, proc=proc)
    if found is None:
        yield "If it is the lfs10d daemon (systemctl status lfs10d), it can do this itself: lfs10d request --help"
        return
    daemon = daemon_behind(found, proc=proc)
    if daemon is None:
        return
    yield f"The daemon (lfs10d run, process {daemon.pid}) polls this line. Ask it instead:"
    if slave is None:
        same = ("request line/scan", "the same scan, while polling goes on")
    else:
        same = (f"request device/read device={device_name(daemon, slave)}", "this sensor, now")
    others = (
        ("watch", "what every sensor measures now"),
        ("request line/pause for=1m", "the port is yours for a minute"),
    )
    first, *rest = [(f"lfs10d {way}{daemon.option}", meaning) for way, meaning in (same, *others)]
    for line in columns(first, rest):
        yield f"  {line}"
