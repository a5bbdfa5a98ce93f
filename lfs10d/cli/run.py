"""`lfs10d run`: the daemon."""

from __future__ import annotations

import asyncio
import contextlib
import faulthandler
import os
import selectors
import signal
import time
from functools import partial
from pathlib import Path

import click

from lfs10d.cli import config_option, examples, state_option
from lfs10d.config.loader import load
from lfs10d.daemon import boot
from lfs10d.daemon.daemon import run
from lfs10d.daemon.state_directory import prepare, state_directory
from lfs10d.errors import StateError
from lfs10d.system import logs
from lfs10d.system.disk import Disk
from lfs10d.system.secret import leave_no_core

STANDARD_ERROR = 2

EXAMPLES = examples("""
  lfs10d run               the service's file, /etc/lfs10d/lfs10d.yaml
  lfs10d run -c site.yaml  another one
""")


@click.command("run", epilog=EXAMPLES)
@config_option
@partial(state_option, text="Where to keep state. Default: $STATE_DIRECTORY, else below /var/lib or ~/.local/state.")
def command(config: Path, state_dir: Path | None) -> int:
    """Run the daemon: poll the line, publish to the broker, until SIGTERM or Ctrl-C."""
    # Until the daemon handles signals: the files are about to be read anyway, so SIGHUP has nothing to reload.
    signal.signal(signal.SIGHUP, signal.SIG_IGN)
    # The watchdog of the service manager ends us by SIGABRT: the stacks of all threads are the last thing logged.
    faulthandler.enable(STANDARD_ERROR)
    leave_no_core()
    try:
        return _run(config, state_dir)
    except KeyboardInterrupt:
        return 0


def _run(config: Path, state_dir: Path | None) -> int:
    loaded = load(config)
    logs.install(loaded.config.log.level, loaded.config.log.format)
    directory = state_directory(config, loaded.config.line.name, chosen=state_dir, environment=os.environ)
    with contextlib.suppress(StateError):  # the daemon tries again, and reports it
        prepare(directory)
    life = boot.begin(directory, Disk(), time.time())
    with asyncio.Runner(loop_factory=lambda: asyncio.SelectorEventLoop(selectors.EpollSelector())) as runner:
        return runner.run(run(loaded, life, directory))
