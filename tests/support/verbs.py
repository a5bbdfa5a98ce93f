"""Verbs of the command line in this process."""

from __future__ import annotations

import subprocess
from typing import Protocol


class Lfs10d(Protocol):
    """Calls the program with arguments, in a folder of its own, without a terminal."""

    def __call__(self, *arguments: str, **environment: str) -> subprocess.CompletedProcess[str]:
        """Return the exit code and what was printed."""


class AtTerminal(Protocol):
    """Calls the program with arguments at a terminal of `columns`, where it prints all it has to say."""

    def __call__(self, *arguments: str, columns: int = 80, until: str | None = None) -> tuple[int, str]:
        """Return the exit code and what came to the terminal; press Ctrl-C when `until` was seen."""
