"""Log records as tests make them."""

from __future__ import annotations

import logging
from contextlib import suppress

WHEN = 1_795_298_022.003
"""2026-11-21T21:53:42.003Z."""


def record(
    words: str = "slave 3 is offline",
    *arguments: object,
    level: int = logging.WARNING,
    name: str = "lfs10d.line.poller",
    error: BaseException | None = None,
) -> logging.LogRecord:
    """Return a record as the logging package would make it."""
    trouble = None if error is None else (type(error), error, error.__traceback__)
    made = logging.LogRecord(name, level, __file__, 1, words, arguments, trouble)
    made.created = WHEN
    return made


def fail(error: ValueError) -> None:
    """Raise it."""
    raise error


def raised(words: str = "no such\nregister") -> ValueError:
    """Return an error with a traceback."""
    made = ValueError(words)
    with suppress(ValueError):
        fail(made)
    return made
