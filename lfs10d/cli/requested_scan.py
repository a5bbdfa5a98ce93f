"""`lfs10d request line/scan`: the daemon scans while it polls; shows the progress, then the devices as a table."""

from __future__ import annotations

import asyncio
import secrets
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Final

import click

from lfs10d.cli import print_lines
from lfs10d.cli.client import CommandClient, at_daemon, parsed
from lfs10d.cli.login import Login
from lfs10d.cli.render import scan_findings
from lfs10d.cli.render.foreign import mapping
from lfs10d.cli.render.response import content_lines
from lfs10d.cli.render.scan_progress import progress_view
from lfs10d.errors import FailedError
from lfs10d.mqtt.messages import Filter, Incoming
from lfs10d.profiles.library import builtin_names, load_profile
from lfs10d.profiles.profile import Profile
from lfs10d.schema.quantities import duration_text
from lfs10d.system.logs import escape
from lfs10d.telemetry.publication import EVENT

SCAN: Final = "line/scan"
CANCEL: Final = "line/cancel"
ENDS_WITHIN: Final = 1.4
"""s for a cancelled scan to end; the verb itself must end within 2 s."""


async def scan(login: Login, content: dict[str, Any], patience: float | None, *, quiet: bool) -> dict[str, Any]:
    """Have the daemon scan and show its progress; return the response. Cancelling ends the scan, too."""
    with progress_view(quiet=quiet, title=SCAN, remaining="?") as shown:

        def arrived(message: Incoming) -> None:
            event = parsed(message.payload)
            if isinstance(event, dict) and event.get("type") == "scan_progress":
                percent, remaining = _figures(event)
                where = f"{event.get('baudrate')} baud, id {event.get('slave')!s:>3}"
                shown.progress(percent, remaining, escape(where))

        client = CommandClient(login, [Filter(login.topics.full(EVENT))], arrived)
        cancelled = False
        async with at_daemon(client):
            try:
                response = await client.request(SCAN, content, patience)
            except asyncio.CancelledError:  # Ctrl-C, SIGTERM
                if not client.request_sent:
                    raise
                cancelled = True
                client.send(CANCEL, {"id": secrets.token_hex(6)})
                await client.wait_until(lambda: client.response is not None, ENDS_WITHIN)
                response = client.response
    if response is None:
        if cancelled:
            raise FailedError(f"{CANCEL} was sent, but the daemon has not confirmed the end of the scan yet")
        raise FailedError(f"no response to {SCAN} within {duration_text(patience or 0)}; the scan may be under way")
    return response


def show(response: Mapping[str, Any]) -> None:
    """Print what a scan found."""
    data = mapping(response.get("data"))
    found = data.get("found")
    if isinstance(found, list):
        rows = [row(each) for each in found if isinstance(each, dict)]
        if rows:
            scan_findings.show(rows)
        else:
            click.echo("No device was found.")
        rest = {key: value for key, value in data.items() if key != "found"}
        print_lines(content_lines({"data": rest}) if rest else ())


def row(entry: Mapping[str, Any]) -> tuple[str, ...]:
    """Return a found device as a row of the table of `lfs10d scan`."""
    rtt = entry.get("rtt_ms")
    answers_in = f"{rtt:.0f} ms" if isinstance(rtt, int | float) else "-"
    cells = (str(entry.get("id")), str(entry.get("baudrate")), answers_in, _what(entry), "; ".join(_remarks(entry)))
    return tuple(escape(cell) for cell in cells)


def _what(entry: Mapping[str, Any]) -> str:
    name = entry.get("profile")
    return _title(name) if isinstance(name, str) else "unknown device"


def _builtin(name: object) -> Profile | None:
    return load_profile(str(name), relative_to=Path()) if name in builtin_names() else None


def _title(name: str) -> str:
    profile = _builtin(name)
    return name if profile is None else profile.title


def _remarks(entry: Mapping[str, Any]) -> Iterator[str]:
    if isinstance(entry.get("device"), str):
        yield f"polled as {entry['device']}"
    if entry.get("duplicate") is True:
        yield "DUPLICATE? garbled answers: two sensors with this id?"
    if entry.get("suspect") is True:
        yield "SUSPECT: others answer too, so it may be no sensor of its own"
    slave = entry.get("id")
    if isinstance(slave, int) and scan_findings.is_factory_id(slave, _builtin(entry.get("profile"))):
        yield "the factory id"
    others = entry.get("alternatives")
    if isinstance(others, list) and others:
        yield scan_findings.may_also_be([_title(str(name)) for name in others])


def _figures(progress: Mapping[str, Any]) -> tuple[float, float]:
    """Return percent and s to go; what comes from the broker may be anything."""
    percent, remaining = (
        float(value) if isinstance(value, int | float) and 0 <= value <= most else 0.0
        for value, most in ((progress.get("percent"), 100.0), (progress.get("remaining_s"), 1e6))
    )
    return percent, remaining
