"""Runs a program that the kernel kills when its parent is gone: `parent_guard.py PARENT PROGRAM [ARGUMENT ...]`.

It is started as a file, without the package: nothing but the standard library, for it delays every start.
"""

from __future__ import annotations

import contextlib
import ctypes
import os
import signal
import sys
from pathlib import Path

PR_SET_PDEATHSIG = 1
"""linux/prctl.h; kept over exec as long as the program changes no user (prctl(2))."""

ITSELF = Path(__file__)


def main(parent: int, program: str, *arguments: str) -> None:
    """Become the program, tied to `parent`; return if that has already ended."""
    with contextlib.suppress(AttributeError):  # not Linux
        ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL, 0, 0, 0)
    if os.getppid() == parent:
        os.execv(program, (program, *arguments))  # noqa: S606  # that is the point


if __name__ == "__main__":
    main(int(sys.argv[1]), *sys.argv[2:])
