"""How raw access to registers ends."""

from __future__ import annotations

from enum import StrEnum


class End(StrEnum):
    """How an access to registers ended."""

    DONE = "done"
    """The registers were read; what was written was read back."""
    REFUSED = "refused"
    """An exception: `fault` has its code."""
    BUSY = "busy"
    """An exception that means so by the profile."""
    NOT_VERIFIED = "not_verified"
    """The slave answers, but its register does not hold what was written, or cannot be read."""
    UNANSWERED = "unanswered"
    """Silence, or bytes that are no answer: `fault` says which."""
    ECHO_UNKNOWN = "echo_unknown"
    """It could not be learned whether the adapter echoes, so nothing was written."""
    CUT_OFF = "cut_off"
    """The port was lost."""
