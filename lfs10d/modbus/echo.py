"""Whether the adapter returns our own bytes, learned from reads where the configuration does not say.

Three reads in a row must agree. Only a read that got an answer counts towards "no echo": where nobody answers,
nothing is proved. Learned anew at each opening of the port; until it is known no write is sent.
"""

from __future__ import annotations

from enum import StrEnum
from typing import Literal

AGREEING = 3
"""So many observations in a row must agree."""


class Echo(StrEnum):
    """Whether the adapter returns our own bytes."""

    ON = "on"
    OFF = "off"
    UNKNOWN = "unknown"


class EchoLearner:
    """What is known of the adapter's echo; `setting` is the configuration's word.

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
        """Take what one read showed; None where it showed nothing."""
        if echoed is None or self._fixed is not None:
            return
        self._agreeing = self._agreeing + 1 if echoed is self._seen else 1
        self._seen = echoed
        if self._agreeing >= AGREEING:
            self.state, self.proved = Echo.ON if echoed else Echo.OFF, True
