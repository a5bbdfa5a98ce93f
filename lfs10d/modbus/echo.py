"""Learns from reads whether the adapter returns our own bytes, unless it is configured.

Three reads in a row must agree. Only a read that got an answer counts towards "no echo": where nobody answers,
nothing is proved. Learned anew at each opening of the port; until it is known no write is sent.
"""

from __future__ import annotations

from enum import StrEnum
from typing import Literal

AGREEING = 3
"""Observations in a row that must agree."""


class Echo(StrEnum):
    """Whether the adapter returns our own bytes."""

    ON = "on"
    OFF = "off"
    UNKNOWN = "unknown"


class EchoLearner:
    """Learns the adapter's echo; `setting` is the configured value.

    `proved`: what is known was observed, not only configured.
    """

    def __init__(self, setting: Literal["auto", "on", "off"] = "auto") -> None:
        self._fixed = {"on": Echo.ON, "off": Echo.OFF}.get(setting)
        self.state = Echo.UNKNOWN if self._fixed is None else self._fixed
        self.proved = False
        self._seen: bool | None = None
        self._agreeing = 0

    def reopened(self) -> None:
        """Forget what was learned: the adapter may be another one."""
        if self._fixed is None:
            self.state, self.proved = Echo.UNKNOWN, False
            self._seen, self._agreeing = None, 0

    def observed(self, echoed: bool | None) -> None:  # noqa: FBT001 - an observation, not a switch
        """Take the observation of one read; None if there is none."""
        if echoed is None or self._fixed is not None:
            return
        self._agreeing = self._agreeing + 1 if echoed is self._seen else 1
        self._seen = echoed
        if self._agreeing >= AGREEING:
            self.state, self.proved = Echo.ON if echoed else Echo.OFF, True
