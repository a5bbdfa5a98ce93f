"""`lfs10d trace`: shows the frames on the running daemon's line, decoded."""

from __future__ import annotations

import asyncio
import contextlib
import secrets
import shutil
import sys
import textwrap
from collections import deque
from collections.abc import Mapping
from datetime import tzinfo
from pathlib import Path
from typing import Any, Final

import click

from lfs10d.cli import EXIT_FAILED, config_option, event_loop, examples, json_option, print_lines
from lfs10d.cli.client import CommandClient, parsed
from lfs10d.cli.json_text import json_text
from lfs10d.cli.local_time import NO_CLOCK, clock_text
from lfs10d.cli.login import Login, log_in, login_options
from lfs10d.cli.options import DurationType
from lfs10d.cli.render.response import status_line
from lfs10d.cli.render.spinner import spinning
from lfs10d.commands.handlers.line import LONGEST, USUAL
from lfs10d.errors import BrokerError, FailedError
from lfs10d.mqtt.messages import Filter
from lfs10d.schema.quantities import duration_text
from lfs10d.system.logs import escape
from lfs10d.telemetry import publication

ANSWERS_WITHIN: Final = 10.0
LAST_FRAMES: Final = 0.5
"""s after the end of a trace within which its last frames arrive."""
ONE_LINE: Final = 100
"""Columns from which the bytes stand beside their meaning, below it otherwise."""
LEAST_WORDS: Final = 20
"""Columns that words and bytes have on the narrowest of terminals."""
HEX_COLUMNS: Final = 26
"""Nine bytes: the answer of a wind sensor."""

EXAMPLES = examples("""
  lfs10d trace                       half a minute of frames
  lfs10d trace --for 2m -c site.yaml two minutes of another daemon's line
  lfs10d trace | grep 'slave 3'      what concerns one slave
  lfs10d trace --json                for programs
""")


@click.command("trace", epilog=EXAMPLES)
@config_option
@click.option(
    "--for",
    "duration",
    type=DurationType("30s or 2m", 0.1, LONGEST),
    default=duration_text(USUAL),
    help=f"How long, at most {duration_text(LONGEST)}.",
)
@login_options
@json_option
def command(config: Path, duration: float, username: str | None, password_file: Path | None, *, as_json: bool) -> int:
    """Show the frames of the running daemon's line, decoded, for a while or until Ctrl-C.

    Each with its time, the silence before it, its direction (> sent, < received), its meaning and its bytes. The daemon
    must allow requests of class `sensors`. Exit code 1 if the daemon refuses, 69 if the broker or the daemon is away.
    """
    with contextlib.suppress(KeyboardInterrupt):
        login = log_in(config, "trace", username=username, password_file=password_file)
        return event_loop.run(_trace(login, duration, as_json=as_json))
    return 0


async def _trace(login: Login, duration: float, *, as_json: bool) -> int:
    topic = login.topics.full(publication.TRACE)
    frames: deque[Any] = deque()
    client = CommandClient(login, [Filter(topic, qos=0)], lambda message: frames.append(parsed(message.payload)))
    try:
        return await _show(client, frames, duration, as_json=as_json)
    finally:
        await client.disconnect()


async def _show(client: CommandClient, frames: deque[Any], duration: float, *, as_json: bool) -> int:
    response = await _begin(client, duration)
    if response.get("status") != "ok":
        click.echo(status_line(response), err=True)
        return EXIT_FAILED
    loop = asyncio.get_running_loop()
    deadline = loop.time() + duration + LAST_FRAMES
    width = shutil.get_terminal_size().columns if sys.stdout.isatty() else ONE_LINE
    while await client.wait_until(lambda: bool(frames) or client.daemon_gone, max(0.0, deadline - loop.time())):
        while frames:
            frame = frames.popleft()
            if not isinstance(frame, dict):
                continue
            print_lines([json_text(frame)] if as_json else lines(frame, width))
        if client.daemon_gone:
            raise BrokerError(f"{client.place}: the daemon went offline")
    return 0


async def _begin(client: CommandClient, duration: float) -> Mapping[str, Any]:
    async with spinning("line/trace ..."):
        await client.connect()
        await client.require_daemon()
        content = {"id": secrets.token_hex(6), "for": duration}
        response = await client.request("line/trace", content, ANSWERS_WITHIN)
    if response is None:
        raise FailedError(f"no response to line/trace within {duration_text(ANSWERS_WITHIN)}")
    return response


def lines(frame: Mapping[str, Any], width: int, zone: tzinfo | None = None) -> list[str]:
    """Return one frame in words, on one line, or on several where the terminal is narrow; its time is of `zone`."""
    ts, gap = frame.get("ts"), frame.get("gap_us")
    when = clock_text(ts, zone) if isinstance(ts, int) else NO_CLOCK
    silence = f"{gap / 1000:8.2f} ms" if isinstance(gap, int | float) else " " * 11
    sign = ">" if frame.get("direction") == "tx" else "<"
    text, data = escape(str(frame.get("text", ""))), escape(str(frame.get("hex", "")))
    if width >= ONE_LINE:
        return [f"{when} {silence} {sign} {data:{HEX_COLUMNS}}  {text}"]
    indent = " " * (len(when) + len(silence) + 4)
    words, *more = textwrap.wrap(text, max(LEAST_WORDS, width - len(indent))) or [""]
    bytes_ = textwrap.wrap(data, max(LEAST_WORDS, width - len(indent)))
    return [f"{when} {silence} {sign} {words}", *(indent + each for each in (*more, *bytes_))]
