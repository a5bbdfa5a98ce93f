"""`lfs10d run`: the daemon."""

from __future__ import annotations

import asyncio
import logging
import os
import selectors
import time
from pathlib import Path

import click

from lfs10d import boot, logs
from lfs10d.cli import config_option
from lfs10d.configfile import load
from lfs10d.daemon import run
from lfs10d.disk import Disk
from lfs10d.errors import StateError
from lfs10d.statedir import prepare, state_directory

log = logging.getLogger(__name__)

EXAMPLES = """\b
Examples:
  lfs10d run                         the service's file, /etc/lfs10d/lfs10d.yaml
  lfs10d run -c site.yaml            another one
"""


@click.command("run", epilog=EXAMPLES)
@config_option
@click.option(
    "--state-dir",
    type=click.Path(path_type=Path),
    metavar="DIRECTORY",
    help="Where to keep state. Default: $STATE_DIRECTORY, else below /var/lib or ~/.local/state.",
)
def command(config: Path, state_dir: Path | None) -> int:
    """Run the daemon: poll the line, publish to the broker, until SIGTERM or Ctrl-C."""
    loaded = load(config)
    logs.install(loaded.config.log.level, loaded.config.log.format)
    directory = state_directory(config, loaded.config.line.name, chosen=state_dir, environment=os.environ)
    try:
        prepare(directory)
    except StateError as error:
        log.warning("%s", error)
    life = boot.begin(directory, Disk(), time.time())
    with asyncio.Runner(loop_factory=lambda: asyncio.SelectorEventLoop(selectors.EpollSelector())) as runner:
        return runner.run(run(loaded, life))
