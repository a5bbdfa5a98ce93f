"""The live table."""

from __future__ import annotations

import io

import pytest
from rich.console import Console

from lfs10d.cli.demo.broker import Broker
from lfs10d.cli.demo.table_view import LEAST_HEIGHT, LEAST_WIDTH, TableView, draw
from tests.support.demo_states import Told

BROKER = Broker("mosquitto", "5", 18830)


def screen(told: Told, width: int = 80, *, unicode: bool = True) -> list[str]:
    """Return what is drawn, line by line."""
    told.stats(13.7, 49.3, 3709.3)
    console = Console(file=io.StringIO(), width=width, height=LEAST_HEIGHT, force_terminal=True, color_system=None)
    with console.capture() as capture:
        console.print(draw(told.picture, BROKER, width, unicode=unicode))
    return capture.get().splitlines()


def row_of(lines: list[str], name: str) -> str:
    return next(line for line in lines if line.lstrip().partition("  ")[2].startswith(name))


@pytest.mark.parametrize("width", [LEAST_WIDTH, 200])
def test_it_fits_the_terminal(told: Told, width: int) -> None:
    for name in told.picture.rows:
        told.availability(name, "offline")
        told.error(name, "timeout", "no answer in 1000 ms")
        for _ in range(60):
            told.sample(name, None, "timeout")
    lines = screen(told, width)
    assert max(map(len, lines)) <= width
    assert len(lines) < LEAST_HEIGHT
    assert "timeout: no answer in 1000 ms" in row_of(lines, "crane")


def test_a_row_has_id_name_speed_trend_state_and_error(told: Told) -> None:
    told.availability("bridge", "online")
    for speed in (0.0, 6.0, None, 40.0, 7.254):
        told.sample("bridge", speed, None if speed is not None else "crc")
    assert row_of(screen(told), "bridge").split() == [
        "8",
        "bridge",
        "7.25",
        "▁▅x█▅",
        "online",
        *["1", "of", "5", "polls", "failed"],
    ]


def test_a_terminal_without_unicode_gets_letters_of_ascii(told: Told) -> None:
    told.sample("bridge", 0.0)
    told.sample("bridge", 16.0)
    assert "_#" in row_of(screen(told, unicode=False), "bridge")


def test_it_says_who_is_ill_how_the_line_is_and_how_to_look_on(told: Told) -> None:
    text = "\n".join(screen(told))
    assert "crane is silent" in text
    assert "bridge is noisy" in text
    assert "13.7 polls/s, 49 % of the wire; shortest gap 3.71 ms, 3.65 needed" in text
    assert "mosquitto_sub -h 127.0.0.1 -p 18830 -t 'lfs10d/#' -v" in text


@pytest.mark.parametrize(
    ("columns", "lines", "terminal", "fits"),
    [
        (80, 24, "xterm-256color", True),
        (LEAST_WIDTH - 1, 24, "xterm-256color", False),
        (80, LEAST_HEIGHT - 1, "xterm-256color", False),
        (80, 24, "dumb", False),
    ],
)
def test_a_terminal_too_small_or_too_dumb_is_known(
    told: Told, monkeypatch: pytest.MonkeyPatch, *, columns: int, lines: int, terminal: str, fits: bool
) -> None:
    monkeypatch.setenv("COLUMNS", str(columns))
    monkeypatch.setenv("LINES", str(lines))
    monkeypatch.setenv("TERM", terminal)
    assert TableView(told.picture, BROKER).fits is fits
