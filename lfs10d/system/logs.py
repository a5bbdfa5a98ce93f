"""Logging: one line per record, for the journal, a terminal or a pipe; foreign text is escaped.

Standard error may be closed, full or unread: a record that cannot be written raises nothing and waits for nothing. Lost
records are counted, and the count is the first thing written afterwards.
"""

from __future__ import annotations

import logging
import os
import select
import sys
import threading
import time
import traceback
from collections.abc import Mapping
from enum import StrEnum
from typing import TypeVar

T = TypeVar("T")

OUR_PACKAGE = "lfs10d"

LIMIT = 4096
"""Most bytes of one line: a pipe that is ready takes this much (PIPE_BUF, pipe(7)) without blocking."""

PATIENCE = 0.05
"""Seconds that the first refused record waits for a slow reader; the following ones do not wait."""

LEVELS = {"debug": logging.DEBUG, "info": logging.INFO, "warning": logging.WARNING, "error": logging.ERROR}

_PRIORITIES = ((logging.CRITICAL, 2), (logging.ERROR, 3), (logging.WARNING, 4), (logging.INFO, 6), (0, 7))
"""Priorities of syslog(3), each from that level on."""

_DIM, _RESET = "\x1b[2m", "\x1b[0m"
_COLOURS = ((logging.ERROR, "\x1b[31m"), (logging.WARNING, "\x1b[33m"), (logging.INFO, ""), (0, _DIM))

_CUT = b" ... "


class Style(StrEnum):
    """The style of a log line."""

    JOURNAL = "journal"
    """`<4>message`: the journal takes the priority off and adds the time (sd-daemon(3))."""
    COLOUR = "colour"
    """`21:53:42 CET warning message` with colour, local time: for a person at a terminal."""
    PLAIN = "plain"
    """`2026-11-21T21:53:42.003Z warning message`: for a file or another program."""
    BARE = "bare"
    """`warning message`: where the reader adds the time."""


def escape(text: str) -> str:
    r"""Return text without control and direction characters: `\n`, `\x1b`, `\u2028` for what would.

    Printable text is returned as it is; to escape twice changes nothing.
    """
    if text.isprintable():
        return text
    return "".join(sign if sign.isprintable() else sign.encode("unicode_escape").decode("ascii") for sign in text)


def shortened(line: str, limit: int = LIMIT - 1) -> str:
    """Return the line without its middle if it has more than `limit` bytes."""
    raw = line.encode("utf-8", "backslashreplace")
    if len(raw) <= limit:
        return line
    half = (limit - len(_CUT)) // 2
    return (raw[:half] + _CUT + raw[-half:]).decode("utf-8", "ignore")


def style_of(wanted: str, *, journal: bool, terminal: bool, coloured: bool = True) -> Style:
    """Return the style for log.format `auto`, `journal` or `text`.

    `journal` and `terminal` say what standard error is, `coloured` whether colour is wanted there.
    """
    if wanted == "journal" or (wanted == "auto" and journal):
        return Style.JOURNAL
    if terminal and coloured:
        return Style.COLOUR
    return Style.BARE if journal else Style.PLAIN


def is_journal(descriptor: int, variables: Mapping[str, str]) -> bool:
    """Return whether the descriptor is the journal's, by `$JOURNAL_STREAM` (systemd.exec(5))."""
    try:
        status = os.fstat(descriptor)
    except OSError:
        return False
    return variables.get("JOURNAL_STREAM") == f"{status.st_dev}:{status.st_ino}"


def likes_colour(variables: Mapping[str, str]) -> bool:
    """Return whether colour is wanted: not with `$NO_COLOR` (no-color.org), and not on a dumb terminal."""
    return not variables.get("NO_COLOR") and variables.get("TERM") != "dumb"


class LineFormatter(logging.Formatter):
    """One record, one line, printable throughout; an exception is its type and text.

    With `tracebacks` the traceback follows on the same line, escaped. Other packages' records begin with their name.
    """

    def __init__(self, look: Style, *, tracebacks: bool = False) -> None:
        super().__init__()
        self._look = look
        self._tracebacks = tracebacks

    def format(self, record: logging.LogRecord) -> str:
        """Return the line without its end."""
        words = escape(self._said(record))
        level = record.levelname.lower()
        if self._look is Style.JOURNAL:
            return f"<{_at_level(_PRIORITIES, record.levelno)}>{words}"
        if self._look is Style.COLOUR:
            stamp = time.strftime("%H:%M:%S %Z", time.localtime(record.created))
            colour = _at_level(_COLOURS, record.levelno)
            return f"{_DIM}{stamp}{_RESET} {colour}{level:<7} {words}{_RESET}"
        if self._look is Style.BARE:
            return f"{level} {words}"
        return f"{_utc(record.created)} {level} {words}"

    def _said(self, record: logging.LogRecord) -> str:
        try:
            words = record.getMessage()
        except Exception as wrong:  # noqa: BLE001 - whatever a faulty log call raises, its record is still told
            words = f"{record.msg} {record.args} ({wrong})"
        if record.name.partition(".")[0] != OUR_PACKAGE:
            words = f"{record.name}: {words}"
        error = record.exc_info[1] if record.exc_info else None
        if error is None:
            return words
        trace = " | " + "".join(traceback.format_exception(error)).rstrip() if self._tracebacks else ""
        return f"{words}: {_summary(error)}{trace}"


class DescriptorHandler(logging.Handler):
    """Writes each record to a file descriptor by one call; never raises, and never waits for a stopped reader.

    `dropped` counts the records nobody took since the last one that was taken.
    """

    def __init__(self, descriptor: int) -> None:
        super().__init__()
        self.dropped = 0
        self._descriptor = descriptor

    def emit(self, record: logging.LogRecord) -> None:
        """Write one line, or count it as dropped."""
        if not (self._told_dropped(record) and self._write(self.format(record))):
            self.dropped += 1

    def _told_dropped(self, record: logging.LogRecord) -> bool:
        """Log the number of lost records, if any; return False if that cannot be written either."""
        if not self.dropped:
            return True
        lost = logging.LogRecord(
            name=OUR_PACKAGE,
            level=logging.WARNING,
            pathname="",
            lineno=0,
            msg="%d log records were lost: standard error was not read",
            args=(self.dropped,),
            exc_info=None,
        )
        lost.created = record.created
        taken = self._write(self.format(lost))
        if taken:
            self.dropped = 0
        return taken

    def _write(self, line: str) -> bool:
        data = shortened(line).encode("utf-8", "backslashreplace") + b"\n"
        try:
            return self._ready() and os.write(self._descriptor, data) == len(data)
        except (OSError, ValueError):
            return False

    def _ready(self) -> bool:
        poll = select.poll()
        poll.register(self._descriptor, select.POLLOUT)
        found = poll.poll(0 if self.dropped else PATIENCE * 1000)
        return any(flags & select.POLLOUT for _, flags in found)


def install(level: str = "info", wanted: str = "auto", *, descriptor: int = 2) -> None:
    """Log to standard error, in place of any handler before; called again after a reload.

    `level` is one of `LEVELS`; other packages are heard from warning on. What nobody caught in a thread or a
    destructor is logged too, instead of a traceback on the screen.
    """
    variables = os.environ
    style = style_of(
        wanted,
        journal=is_journal(descriptor, variables),
        terminal=os.isatty(descriptor),
        coloured=likes_colour(variables),
    )
    least = LEVELS[level]
    handler = DescriptorHandler(descriptor)
    handler.setFormatter(LineFormatter(style, tracebacks=least <= logging.DEBUG))
    root = logging.getLogger()
    for other in root.handlers[:]:
        root.removeHandler(other)
    root.addHandler(handler)
    root.setLevel(max(least, logging.WARNING))
    logging.getLogger(OUR_PACKAGE).setLevel(least)
    logging.captureWarnings(capture=True)
    threading.excepthook = _log_thread
    sys.unraisablehook = _log_unraisable


def _log_thread(stray: threading.ExceptHookArgs) -> None:
    name = stray.thread.name if stray.thread else "unknown"
    _log_stray(f"the thread {name} ended", stray.exc_value)


def _log_unraisable(stray: sys.UnraisableHookArgs) -> None:
    _log_stray(stray.err_msg or "an error that cannot be raised", stray.exc_value)


def _log_stray(words: str, error: BaseException | None) -> None:
    logging.getLogger(OUR_PACKAGE).error("%s", words, exc_info=error)


def _at_level(ladder: tuple[tuple[int, T], ...], level: int) -> T:
    return next(value for least, value in ladder if level >= least)


def _utc(seconds: float) -> str:
    whole, milliseconds = divmod(int(seconds * 1000), 1000)
    return f"{time.strftime('%Y-%m-%dT%H:%M:%S', time.gmtime(whole))}.{milliseconds:03}Z"


def _summary(error: BaseException) -> str:
    words = str(error)
    return f"{type(error).__name__}: {words}" if words else type(error).__name__
