"""A password that is never printed, and a process that leaves no core dump with it."""

from __future__ import annotations

import hmac
import resource
from typing import NoReturn

ONE_BYTE = 1
"""The limit at which Linux writes no core and starts no handler of `kernel.core_pattern` either; 0 does not keep a
handler from being fed (`do_coredump` in fs/coredump.c)."""


class Secret:
    """Text that shows as `***` wherever it is printed, formatted or put into a traceback; `reveal` to use it."""

    __slots__ = ("_text",)

    def __init__(self, text: str) -> None:
        self._text = text

    def reveal(self) -> str:
        """Return the text itself; for the one place that hands it to the broker."""
        return self._text

    def __repr__(self) -> str:
        return "Secret(***)"

    def __str__(self) -> str:
        return "***"

    def __format__(self, spec: str) -> str:
        return format("***", spec)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Secret):
            return NotImplemented
        return hmac.compare_digest(self._text.encode(), other._text.encode())

    def __hash__(self) -> int:
        return hash((Secret, self._text))

    def __reduce__(self) -> NoReturn:
        raise TypeError("a secret is not written down")


def leave_no_core() -> None:
    """Make this process and its children leave no core dump: its memory holds passwords and keys.

    Unlike PR_SET_DUMPABLE, which bars debuggers too, this takes nothing from the person who looks for a fault: the
    stacks that faulthandler prints on SIGABRT, `/proc`, py-spy.
    """
    _, hard = resource.getrlimit(resource.RLIMIT_CORE)
    limit = ONE_BYTE if hard == resource.RLIM_INFINITY else min(ONE_BYTE, hard)
    resource.setrlimit(resource.RLIMIT_CORE, (limit, limit))
