"""Entry point of every verb: signals are handled before any slow import."""

from __future__ import annotations

import signal
import sys
from collections.abc import Sequence
from types import FrameType
from typing import NoReturn

LASTING = frozenset({"run", "watch", "trace", "simulate", "demo", "web"})
"""Verbs that run until a signal ends them, which is success then; `read --watch` is one more."""

ENDING = (signal.SIGINT, signal.SIGTERM)


def main(arguments: Sequence[str] | None = None) -> NoReturn:
    """Run the verb that the arguments name and exit with its code."""
    words = sys.argv[1:] if arguments is None else arguments
    interrupted = 0 if lasting(words) else 1
    try:
        # Also where the parent ignores SIGINT, as a shell does for background jobs.
        for number in ENDING:
            signal.signal(number, _interrupted)
        from lfs10d.cli.exit_status import conclude  # noqa: PLC0415  # a tenth of a second, in which a signal may come

        code = conclude(words, interrupted=interrupted)
    except KeyboardInterrupt:
        code = interrupted
    _ignore()
    sys.exit(code)


def lasting(words: Sequence[str]) -> bool:
    """Return whether these arguments name a verb that runs until a signal ends it."""
    verb = next((word for word in words if not word.startswith("-")), None)
    return verb in LASTING or (verb == "read" and "--watch" in words)


def _interrupted(signum: int, frame: FrameType | None) -> NoReturn:
    """End the verb, which takes less than 2 s; further signals are ignored meanwhile."""
    del signum, frame
    _ignore()
    raise KeyboardInterrupt


def _ignore() -> None:
    for number in ENDING:
        signal.signal(number, signal.SIG_IGN)


if __name__ == "__main__":
    main()
