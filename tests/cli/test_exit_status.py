"""How a verb ends: one line and an exit code, never a traceback."""

from __future__ import annotations

import errno
import os
import subprocess
import sys
from pathlib import Path

import click
import pytest

from lfs10d.cli import exit_status
from lfs10d.errors import BrokerError, ConfigError, FailedError, PortBusyError, PortLostError, Problem, StateError


def ended(monkeypatch: pytest.MonkeyPatch, end: BaseException | int | None) -> int:
    """Return the exit code of a verb that ends like this."""

    @click.command()
    def verb() -> int | None:
        if isinstance(end, BaseException):
            raise end
        return end

    monkeypatch.setattr(exit_status, "lfs10d", verb)
    return exit_status.conclude([], interrupted=7)


@pytest.mark.parametrize(
    ("end", "code", "told"),
    [
        (None, 0, ""),
        (0, 0, ""),
        (1, 1, ""),
        (78, 78, ""),
        (
            ConfigError((Problem("f", 1, 2, "a", "x"), Problem("f", 3, 4, "b", "y"))),
            78,
            "f:1:2: a: x\nf:3:4: b: y\n",
        ),
        (PortLostError("/dev/x", "gone"), 69, "lfs10d: /dev/x: gone\n"),
        (PortBusyError("/dev/x", "held"), 69, "lfs10d: /dev/x: held\n"),
        (BrokerError("no broker"), 69, "lfs10d: no broker\n"),
        (StateError("no state"), 1, "lfs10d: no state\n"),
        (FailedError("nobody answered"), 1, "lfs10d: nobody answered\n"),
        (KeyboardInterrupt(), 7, ""),
        (BrokenPipeError(), 1, ""),
        (click.UsageError("no such thing"), 2, "Error: no such thing\n"),
        (
            OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), "/full"),
            1,
            "lfs10d: No space left on device: /full\n",
        ),
        (OSError("odd"), 1, "lfs10d: odd\n"),
        (RuntimeError("a\x1b[2Jb\nc"), 1, "RuntimeError: a [2Jb c; this is an internal error of lfs10d\n"),
    ],
)
def test_every_error_ends_in_its_exit_code_and_a_line(
    end: BaseException | int | None,
    code: int,
    told: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert ended(monkeypatch, end) == code
    err = capsys.readouterr().err
    assert err.endswith(told)
    assert "Traceback" not in err


def test_who_asks_for_it_is_shown_where_a_fault_of_the_program_happened(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("LFS10D_TRACEBACK", "1")
    assert ended(monkeypatch, RuntimeError("x")) == 1
    assert "Traceback" in capsys.readouterr().err


@pytest.mark.parametrize("out", ["/dev/full", "pipe", "closed"])
def test_output_that_cannot_be_written_is_no_traceback(out: str, tmp_path: Path) -> None:
    arguments = [sys.executable, "-m", "lfs10d", "--help"]
    if out == "pipe":
        reader, writer = os.pipe()
        os.close(reader)
        result = subprocess.run(arguments, stdout=writer, stderr=subprocess.PIPE, check=False, cwd=tmp_path)
        os.close(writer)
    elif out == "closed":
        shell = ["sh", "-c", '"$@" >&-', "sh", *arguments]
        result = subprocess.run(shell, stderr=subprocess.PIPE, check=False, cwd=tmp_path)
    else:
        with Path(out).open("wb") as full:
            result = subprocess.run(arguments, stdout=full, stderr=subprocess.PIPE, check=False, cwd=tmp_path)
    assert result.returncode == (0 if out == "closed" else 1)
    assert b"Traceback" not in result.stderr
    assert b"Exception ignored" not in result.stderr


def test_characters_a_terminal_does_not_know_are_escaped(tmp_path: Path) -> None:
    (tmp_path / "→.yaml").write_text("line: {port: /dev/x}\nslaves: [2]\n")
    result = subprocess.run(
        [sys.executable, "-m", "lfs10d", "check", "-c", "→.yaml"],
        capture_output=True,
        check=False,
        cwd=tmp_path,
        env={"PATH": "/usr/bin:/bin", "PYTHONIOENCODING": "latin-1"},
    )
    assert result.returncode == 0
    assert result.stdout.startswith(b"\\u2192.yaml: valid")
