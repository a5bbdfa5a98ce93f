"""The exit status of a verb: errors become one line and an exit code, never a traceback."""

from __future__ import annotations

import contextlib
import io
import os
import sys
import traceback
from collections.abc import Sequence
from pathlib import Path

import click

from lfs10d.cli import EXIT_CONFIG, EXIT_FAILED, EXIT_UNAVAILABLE, lfs10d
from lfs10d.errors import BrokerError, ConfigError, Lfs10dError, PortError
from lfs10d.system import startup

STANDARD_ERROR = 2
TRACEBACK = "LFS10D_TRACEBACK"
"""Set in the environment, an internal error shows its traceback."""


def conclude(arguments: Sequence[str], *, interrupted: int) -> int:
    """Run the verb that the arguments name and return its exit code: `interrupted` where a signal ended it."""
    _hold_standard_descriptors()
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")
    startup.begin()
    return _flushed(_run(arguments, interrupted))


def _hold_standard_descriptors() -> None:
    """Put /dev/null where standard input, output or error was closed.

    Else the next thing opened would take its number, and the log be written to the port.
    """
    while (descriptor := os.open(os.devnull, os.O_RDWR)) <= STANDARD_ERROR:
        pass
    os.close(descriptor)


def _run(arguments: Sequence[str], interrupted: int) -> int:
    try:
        code = lfs10d.main(args=list(arguments), prog_name="lfs10d", standalone_mode=False)
    except click.ClickException as error:
        error.show()
        return error.exit_code
    except (click.Abort, KeyboardInterrupt):
        return interrupted
    except BrokenPipeError:
        return EXIT_FAILED
    except Lfs10dError as error:
        _report(str(error) if isinstance(error, ConfigError) else f"lfs10d: {error}")
        return _code_of(error)
    except Exception as error:  # noqa: BLE001  # no traceback reaches a user
        return _failed(error)
    return code if isinstance(code, int) else 0


def _code_of(error: Lfs10dError) -> int:
    match error:
        case ConfigError():
            return EXIT_CONFIG
        case PortError() | BrokerError():
            return EXIT_UNAVAILABLE
        case _:
            return EXIT_FAILED


def _failed(error: Exception) -> int:
    if isinstance(error, OSError):
        message = f"{error.strerror or error}{f': {error.filename}' if error.filename else ''}"
    else:
        message = f"{_where(error)}: {type(error).__name__}: {error}; this is an internal error of lfs10d"
    if os.environ.get(TRACEBACK):
        traceback.print_exception(error)
    one_line = "".join(character if character.isprintable() else " " for character in message)
    _report(f"lfs10d: {one_line}")
    return EXIT_FAILED


def _where(error: Exception) -> str:
    frames = traceback.extract_tb(error.__traceback__)
    return f"{Path(frames[-1].filename).name}:{frames[-1].lineno}" if frames else "?"


def _report(message: str) -> None:
    with contextlib.suppress(OSError, ValueError):
        print(message, file=sys.stderr, flush=True)  # noqa: T201  # click.echo would raise on a closed stderr


def _flushed(code: int) -> int:
    """Return the exit code, 1 if what was printed could not be written (a full disk, a closed pipe)."""
    try:
        if sys.stdout is not None:  # None: closed by whoever started us
            sys.stdout.flush()
    except BrokenPipeError:
        pass
    except (OSError, ValueError) as error:
        _report(f"lfs10d: the output cannot be written: {getattr(error, 'strerror', None) or error}")
    else:
        return code
    # What is left in the buffer would fail once more when the interpreter ends.
    with contextlib.suppress(OSError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    return code or EXIT_FAILED
