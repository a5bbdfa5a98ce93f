"""The far end of a pty."""

from __future__ import annotations

import os
from dataclasses import dataclass


@dataclass
class FarEnd:
    """The master of a pty; `path` is where its slave is opened."""

    fd: int
    path: str

    def close(self) -> None:
        """Pull the plug."""
        if self.fd >= 0:
            os.close(self.fd)
            self.fd = -1
