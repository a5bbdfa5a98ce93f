"""`status.json`, for `watch` while the broker is away: replaced as a whole once a second."""

from __future__ import annotations

import contextlib
import json
from collections.abc import Mapping
from pathlib import Path

from lfs10d.system.regular_file import write_new

WORLD_READABLE = 0o644
_JSON = json.JSONEncoder(allow_nan=False, separators=(",", ":"))


class StatusFile:
    """The file at `path`; its folder is made if it can be. A place that cannot be written is no error."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._draft = path.with_suffix(".tmp")

    def show(self, status: Mapping[str, object]) -> bool:
        """Replace the content; returns whether it could be written. Nothing is synced: it is of the moment."""
        text = _json(status)
        try:
            try:
                self._write(text)
            except FileNotFoundError:
                self.path.parent.mkdir(parents=True, exist_ok=True)
                self._write(text)
        except OSError:
            return False
        return True

    def _write(self, text: str) -> None:
        write_new(self._draft, text.encode(), mode=WORLD_READABLE)
        self._draft.replace(self.path)

    def remove(self) -> None:
        """Remove the file: the daemon ends."""
        for path in (self.path, self._draft):
            with contextlib.suppress(OSError):
                path.unlink(missing_ok=True)


def _json(status: Mapping[str, object]) -> str:
    """Return the status as JSON, encoded device by device: the encoder would delay the line thread."""
    encode = _JSON.encode
    members = (
        f"{encode(key)}:" + (f"[{','.join(map(encode, value))}]" if isinstance(value, list) else encode(value))
        for key, value in status.items()
    )
    return f"{{{','.join(members)}}}"
