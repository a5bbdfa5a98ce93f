"""What the demo says in words, in both views. Pure."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final

from lfs10d.cli.demo.broker import Broker
from lfs10d.cli.demo.scenario import BASE_TOPIC, BAUDRATE, Role
from lfs10d.cli.demo.state import DemoState, LineFigures

SUBJECT: Final = f"eight LFS10 wind sensors on a simulated RS485 line, {BAUDRATE} baud"
FAREWELL: Final = "Ctrl-C ends it and leaves nothing behind."


def data_flow(broker: Broker) -> str:
    """Return who hands the values to whom."""
    return f"simulated line > lfs10d > {broker.name} (MQTT {broker.speaks}, 127.0.0.1:{broker.port}) > this view"


def look_on(broker: Broker) -> str:
    """Return the command with which to look on."""
    return f"mosquitto_sub -h 127.0.0.1 -p {broker.port} -t '{BASE_TOPIC}/#' -v"


def stories(cast: Sequence[Role]) -> Iterator[tuple[str, str]]:
    """Yield name and story of each sensor that has one."""
    for role in cast:
        if role.story is not None:
            yield role.name, role.story


def figures(line: LineFigures | None) -> str:
    """Return what the line's statistics say, empty before the first."""
    if line is None:
        return ""
    return (
        f"{line.polls_per_s:.1f} polls/s, {line.load_pct:.0f} % of the wire; "
        f"shortest gap {line.gap_min / 1000:.2f} ms, {line.gap_required / 1000:.2f} needed"
    )


def summary(picture: DemoState, seconds: float) -> str:
    """Return one line for the end."""
    return (
        f"lfs10d demo: {picture.samples} samples in {seconds:.0f} s, {picture.online} of {len(picture.rows)} sensors "
        "online; nothing is left running"
    )
