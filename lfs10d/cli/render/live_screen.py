"""The live table on a terminal, on a screen of its own; its last state stays to be read when it ends."""

from __future__ import annotations

from collections.abc import Sequence

from rich.console import Console
from rich.live import Live
from rich.text import Text

from lfs10d.cli.render.live_state import LiveState
from lfs10d.cli.render.live_table import DataSource, screen


class LiveScreen:
    """The table; `remarks` stand below it where the terminal is high enough for both."""

    def __init__(self, remarks: Sequence[str] = ()) -> None:
        self._remarks = remarks
        self._console = Console(highlight=False, markup=False, emoji=False)
        self._screen = Live(console=self._console, screen=True, auto_refresh=False)

    def __enter__(self) -> None:
        """Begin."""
        self._screen.start()

    def __exit__(self, *error: object) -> None:
        """End, and print the last state once more below what was on the terminal before."""
        last = self._screen.renderable
        self._screen.stop()
        self._console.print(last)

    def draw(self, live: LiveState, source: DataSource, *, now: float, wall: float) -> None:
        """Draw it anew."""
        size = self._console.size
        lines = screen(live, source, (size.width, size.height), now=now, wall=wall, remarks=self._remarks)
        text = Text("\n", no_wrap=True, overflow="crop").join(Text.assemble(*line) for line in lines)
        self._screen.update(text, refresh=True)
