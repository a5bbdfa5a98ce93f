"""Where every verb begins: signals are heard before anything is imported that takes its time."""

from __future__ import annotations

import signal
import sys
from collections.abc import Sequence
from types import FrameType
from typing import NoReturn

LASTING = frozenset({"run", "watch", "trace", "simulate", "demo"})
"""Verbs that go on until they are told to end, which is no failure then; `read --watch` is one more."""

ENDING = (signal.SIGINT, signal.SIGTERM)


def main(arguments: Sequence[str] | None = None) -> NoReturn:
    """Run the verb that the arguments name and exit with its code."""
    words = sys.argv[1:] if arguments is None else arguments
    interrupted = 0 if lasting(words) else 1
    try:
        # Also where whoever started us ignores SIGINT, as a shell does for what it puts into the background.
        for number in ENDING:
            signal.signal(number, _interrupted)
        from lfs10d.cli.exit_status import conclude  # noqa: PLC0415  # a tenth of a second, in which a signal may come

        code = conclude(words, interrupted=interrupted)
    except KeyboardInterrupt:
        code = interrupted
    _ignore()
    sys.exit(code)


def lasting(words: Sequence[str]) -> bool:
    """Tell whether these arguments name a verb that goes on until it is told to end."""
    verb = next((word for word in words if not word.startswith("-")), None)
    return verb in LASTING or (verb == "read" and "--watch" in words)


def _interrupted(signum: int, frame: FrameType | None) -> NoReturn:
    """End the verb, whose end takes less than 2 s; who asks for it twice meanwhile gets no other end."""
    del signum, frame
    _ignore()
    raise KeyboardInterrupt


def _ignore() -> None:
    for number in ENDING:
        signal.signal(number, signal.SIG_IGN)


if __name__ == "__main__":
    main()
