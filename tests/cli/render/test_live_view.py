"""The view that fits standard output."""

from __future__ import annotations

import io
import json
import sys

import pytest

from lfs10d.cli.render.live_screen import LiveScreen
from lfs10d.cli.render.live_state import LiveState
from lfs10d.cli.render.live_table import DataSource
from lfs10d.cli.render.live_view import LivePrinter, live_view

HERE = DataSource("live from broker here", alive=True)


def line() -> LiveState:
    """Return the state of a line with one sensor."""
    live = LiveState("line0")
    live.on_message("devices", [{"name": "mast", "id": 2}], old=False, now=0.0, wall=0.0)
    return live


class Terminal(io.StringIO):
    """Standard output at a terminal."""

    def isatty(self) -> bool:
        return True


def test_a_pipe_gets_the_remarks_once_then_a_line_for_each_change(capsys: pytest.CaptureFixture[str]) -> None:
    live = line()
    view = live_view(remarks=["a remark"])
    assert isinstance(view, LivePrinter)
    with view:
        for _ in range(2):
            view.draw(live, HERE, now=0.0, wall=0.0)
    printed = capsys.readouterr().out.splitlines()
    assert printed[0] == "# a remark"
    assert printed.count("# live from broker here") == 1
    assert sum("  mast  2  -  no reply yet" in each for each in printed) == 1


def test_json_has_neither_remarks_nor_headings(capsys: pytest.CaptureFixture[str]) -> None:
    view = live_view(as_json=True, remarks=["a remark"])
    with view:
        view.draw(line(), HERE, now=0.0, wall=0.0)
    (printed,) = capsys.readouterr().out.splitlines()
    assert json.loads(printed)["device"] == "mast"


@pytest.mark.parametrize(("term", "table"), [("xterm-256color", True), ("dumb", False), (None, False)])
def test_a_terminal_gets_the_table_unless_it_is_dumb(
    monkeypatch: pytest.MonkeyPatch, term: str | None, *, table: bool
) -> None:
    monkeypatch.setattr(sys, "stdout", Terminal())
    if term is None:
        monkeypatch.delenv("TERM", raising=False)
    else:
        monkeypatch.setenv("TERM", term)
    assert isinstance(live_view(), LiveScreen) is table
    assert isinstance(live_view(as_json=True), LivePrinter)


def test_the_last_table_stays_with_its_remarks(monkeypatch: pytest.MonkeyPatch) -> None:
    terminal = Terminal()
    monkeypatch.setattr(sys, "stdout", terminal)
    monkeypatch.setenv("TERM", "xterm-256color")
    monkeypatch.setenv("COLUMNS", "80")
    monkeypatch.setenv("LINES", "24")
    view = live_view(remarks=["a remark"])
    with view:
        view.draw(line(), HERE, now=0.0, wall=0.0)
    after = terminal.getvalue().rpartition("\x1b[?1049l")[2]
    assert "mast" in after
    assert after.rstrip().endswith("a remark")
