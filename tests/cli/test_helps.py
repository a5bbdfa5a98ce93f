"""The help of every verb fits a terminal of 80 columns, and no sentence of it is cut."""

from __future__ import annotations

from collections.abc import Iterator

import click
import pytest

from lfs10d.cli import VERBS, lfs10d
from lfs10d.commands.handlers.registry import HANDLERS

COLUMNS = 80


def helps() -> Iterator[str]:
    """Yield what is typed before `--help`: each verb, each verb of a verb, each request."""
    yield ""
    context = click.Context(lfs10d)
    for verb in VERBS:
        yield verb
        command = lfs10d.get_command(context, verb)
        if isinstance(command, click.Group):
            yield from (f"{verb} {inner}" for inner in command.list_commands(context))
    yield from (f"request {name}" for name in HANDLERS)


@pytest.mark.parametrize("typed", list(helps()))
def test_a_help_fits_80_columns_with_no_sentence_cut(
    typed: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", str(COLUMNS))
    lfs10d.main([*typed.split(), "--help"], "lfs10d", standalone_mode=False)
    shown = capsys.readouterr().out
    assert shown.startswith("Usage: lfs10d")
    too_long = [line for line in shown.splitlines() if len(line) > COLUMNS]
    cut = [line for line in shown.splitlines() if line.endswith("...") and not line.startswith("Usage: ")]
    assert (too_long, cut) == ([], [])
