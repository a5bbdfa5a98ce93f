"""`lfs10d metrics`: the figures of the page's `/metrics` once, for node_exporter's textfile collector."""

from __future__ import annotations

import time
from pathlib import Path

import click

from lfs10d.cli import config_option, event_loop, examples
from lfs10d.cli.login import Login, log_in, login_options
from lfs10d.errors import BrokerError
from lfs10d.web import metrics
from lfs10d.web.feed import feeds, settle
from lfs10d.web.site_model import SiteModel

EXAMPLES = examples("""
  lfs10d metrics                      the service's line
  lfs10d metrics -c site.yaml         the line of another daemon
  lfs10d metrics >lfs10d.prom.new && mv lfs10d.prom.new lfs10d.prom
                                      for node_exporter, which must never see
                                      half a file; called by a timer
""")


@click.command("metrics", epilog=EXAMPLES)
@config_option
@login_options
def command(config: Path, username: str | None, password_file: Path | None) -> int:
    """Print the figures of the running daemon once, as OpenMetrics text.

    From MQTT, or from the daemon's status file where the broker is away. A value that is not good now is absent. Exit
    code 69 if there is neither a broker with this daemon nor a status file.
    """
    login = log_in(config, "metrics", username=username, password_file=password_file, needed=False)
    click.echo(event_loop.run(_figures(config, login)), nl=False)
    return 0


async def _figures(config: Path, login: Login) -> str:
    """Return the figures; raises BrokerError where there is nothing to tell."""
    site = SiteModel()
    (feed,) = feeds([(config, login)], site, others=False)
    try:
        await settle(feed)
        wall = time.time()
        lines = list(site.lines.values())
        sources = [line.source(wall) for line in lines]
        if not any(source.alive for source in sources):
            raise BrokerError("; ".join(source.words.removeprefix("not live: ") for source in sources))
        return metrics.text(lines, wall, openmetrics=True)
    finally:
        await feed.disconnect()
