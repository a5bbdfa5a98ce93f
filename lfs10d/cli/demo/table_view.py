"""The live table on a terminal: each sensor with its wind, the last seconds of it, state and error."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Final, Self

from rich import box
from rich.console import Console, Group
from rich.live import Live
from rich.table import Table
from rich.text import Text

from lfs10d.cli.demo import texts
from lfs10d.cli.demo.broker import Broker
from lfs10d.cli.demo.state import DemoRow, DemoState

LEAST_WIDTH: Final = 80
LEAST_HEIGHT: Final = 20
"""What the table needs; a smaller terminal gets plain lines."""
ERROR_WIDTH: Final = 30
TREND_LEAST: Final = 4
TREND_MOST: Final = 40
"""Samples shown, as there is room."""
_BESIDE_TREND: Final = 32 + ERROR_WIDTH
_STORM: Final = 12.0
"""m/s at which a bar of the trend is full."""
_BARS: Final = "▁▂▃▄▅▆▇█"
_PLAIN_BARS: Final = "_.-~=+*#"
_FAILED: Final = "x"
_STATES: Final = {"online": "green", "offline": "bold red", "...": "dim"}


class TableView:
    """The table on a screen of its own between enter and exit; then what it last showed stays on the terminal."""

    every: Final = 0.2
    """Seconds from one turn to the next."""

    def __init__(self, picture: DemoState, broker: Broker) -> None:
        self._picture, self._broker = picture, broker
        self._console = Console(highlight=False, force_terminal=True)
        self._live = Live(
            console=self._console, screen=True, auto_refresh=False, redirect_stdout=False, redirect_stderr=False
        )

    @property
    def fits(self) -> bool:
        """Whether the terminal can show the table."""
        console = self._console
        return console.width >= LEAST_WIDTH and console.height >= LEAST_HEIGHT and not console.is_dumb_terminal

    def __enter__(self) -> Self:
        """Begin."""
        self._live.start()
        self.turn()
        return self

    def turn(self) -> None:
        """Draw what is known now."""
        self._live.update(self._drawn(), refresh=True)

    def __exit__(self, *_: object) -> None:
        """End."""
        self._live.stop()
        self._console.print(self._drawn())

    def _drawn(self) -> Group:
        unicode = self._console.encoding.startswith("utf")
        return draw(self._picture, self._broker, self._console.width, unicode=unicode)


def draw(picture: DemoState, broker: Broker, width: int, *, unicode: bool = True) -> Group:
    """Return the whole view for a terminal of this width in characters, in ASCII if it has no `unicode`."""
    trend = min(TREND_MOST, max(TREND_LEAST, width - _BESIDE_TREND))
    return Group(
        Text.assemble(("lfs10d demo", "bold"), f"  {texts.SUBJECT}"),
        Text(texts.data_flow(broker), "dim"),
        Text(),
        _table(picture.rows.values(), trend, unicode=unicode),
        Text(),
        *(_story(name, story) for name, story in texts.stories([row.role for row in picture.rows.values()])),
        Text(texts.figures(picture.line), "dim"),
        Text.assemble("Look on: ", (texts.look_on(broker), "bold cyan")),
        Text(texts.FAREWELL),
    )


def _story(name: str, story: str) -> Text:
    return Text.assemble((name, "bold yellow"), f" {story}")


def _table(rows: Iterable[DemoRow], trend: int, *, unicode: bool) -> Table:
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, show_edge=False, padding=(0, 1, 0, 0), header_style="bold")
    table.add_column("id", justify="right")
    table.add_column("sensor", style="cyan", no_wrap=True)
    table.add_column("m/s", justify="right", min_width=5)
    table.add_column("wind", no_wrap=True, width=trend)
    table.add_column("state", no_wrap=True, min_width=7)
    table.add_column("error", no_wrap=True, width=ERROR_WIDTH)
    for row in rows:
        table.add_row(
            str(row.role.slave),
            row.role.name,
            Text("-", "dim") if row.speed is None else Text(f"{row.speed:.2f}", "bold"),
            Text.assemble(*_trend(row, trend, unicode=unicode)),
            Text(row.state, _STATES[row.state]),
            Text(row.error, "red" if row.fault or row.message else "dim"),
        )
    return table


def _trend(row: DemoRow, length: int, *, unicode: bool) -> Iterator[tuple[str, str]]:
    bars = _BARS if unicode else _PLAIN_BARS
    for speed in list(row.trend)[-length:]:
        if speed is None:
            yield _FAILED, "red"
        else:
            yield bars[min(len(bars) - 1, int(speed / _STORM * len(bars)))], "blue"
