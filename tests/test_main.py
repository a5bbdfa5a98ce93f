"""Where every verb begins: signals are heard from there on, and end each verb with its code."""

from __future__ import annotations

import signal
import subprocess
import sys
from collections.abc import Iterator

import click
import pytest

from lfs10d import __main__
from lfs10d.cli import exit_status

SLOW = ("traceback", "click", "lfs10d.cli", "lfs10d.errors", "pydantic")


@pytest.fixture(autouse=True)
def the_signals_as_they_were() -> Iterator[None]:
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    yield
    for number, handler in before.items():
        signal.signal(number, handler)


def exit_code(arguments: list[str]) -> int | str | None:
    """Return the code that the program exits with."""
    with pytest.raises(SystemExit) as exited:
        __main__.main(arguments)
    return exited.value.code


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize(
    ("arguments", "code"),
    [
        (["run"], 0),
        (["run", "-c", "x.yaml"], 0),
        (["watch"], 0),
        (["trace", "--for", "1s"], 0),
        (["simulate"], 0),
        (["demo"], 0),
        (["read", "/dev/x", "2", "--watch"], 0),
        (["read", "/dev/x", "2"], 1),
        (["scan", "/dev/x"], 1),
        (["request", "health"], 1),
        (["check", "-c", "watch"], 1),
        (["config"], 1),
        ([], 1),
    ],
)
def test_a_signal_ends_each_verb_with_its_code(
    number: signal.Signals, arguments: list[str], code: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    @click.command(context_settings={"ignore_unknown_options": True})
    @click.argument("words", nargs=-1)
    def verb(words: tuple[str, ...]) -> None:
        del words
        signal.raise_signal(number)

    monkeypatch.setattr(exit_status, "lfs10d", verb)
    assert exit_code(arguments) == code


@pytest.mark.parametrize(("arguments", "code"), [(["watch"], 0), (["check"], 1)])
def test_a_signal_among_the_imports_ends_each_verb_with_its_code(
    arguments: list[str], code: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Signal:
        """Stands in for a module that a signal comes in the middle of."""

        def __getattr__(self, name: str) -> object:
            if name == "conclude":
                signal.raise_signal(signal.SIGTERM)
            raise AttributeError(name)

    monkeypatch.setitem(sys.modules, "lfs10d.cli.exit_status", Signal())
    assert exit_code(arguments) == code


def test_sigint_is_heard_where_whoever_started_us_ignores_it(monkeypatch: pytest.MonkeyPatch) -> None:
    @click.command()
    def verb() -> None:
        signal.raise_signal(signal.SIGINT)

    signal.signal(signal.SIGINT, signal.SIG_IGN)
    monkeypatch.setattr(exit_status, "lfs10d", verb)
    assert exit_code([]) == 1


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_second_signal_changes_nothing_of_the_end(number: signal.Signals, monkeypatch: pytest.MonkeyPatch) -> None:
    tidied = []

    @click.command(context_settings={"ignore_unknown_options": True})
    def verb() -> None:
        try:
            signal.raise_signal(signal.SIGINT)
        finally:
            signal.raise_signal(number)
            tidied.append(True)

    monkeypatch.setattr(exit_status, "lfs10d", verb)
    assert exit_code([]) == 1
    signal.raise_signal(number)
    assert tidied == [True]


def test_a_verb_that_comes_to_its_end_gives_its_own_code(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(exit_status, "lfs10d", click.command()(lambda: 69))
    assert exit_code([]) == 69


def test_nothing_slow_is_imported_before_signals_are_heard() -> None:
    code = f"import sys, lfs10d.__main__; print([name for name in {SLOW!r} if name in sys.modules])"
    printed = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert printed == "[]\n"
