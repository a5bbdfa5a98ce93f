"""Files in memory that forget at a power cut what was not synced: the double of `disk.Files` for tests.

A file system may bring un-synced steps to the disk in any order, some and not others: `power_cut` is told which.
Every step can be the last: `steps_left` counts down and then the power fails before the step has any effect.
"""

from __future__ import annotations

import errno
import os
from collections.abc import Container
from dataclasses import dataclass, field
from pathlib import Path

from lfs10d.system.disk import Files


class PowerCutError(BaseException):
    """The power failed; no code under test catches this."""


@dataclass
class _Content:
    """One file's bytes, as programs see them and as they are on the disk."""

    seen: bytes = b""
    kept: bytes = b""


@dataclass
class ForgetfulFiles(Files):
    """`seen` are the names as programs see them, `kept` those on the disk; `steps` the steps taken.

    `full` makes every further write fail with ENOSPC once so many bytes were written.
    """

    steps_left: int | None = None
    full: int | None = None
    steps: int = 0
    seen: dict[Path, _Content] = field(default_factory=dict)
    kept: dict[Path, _Content] = field(default_factory=dict)

    def _step(self) -> None:
        if self.steps_left is not None and self.steps >= self.steps_left:
            raise PowerCutError
        self.steps += 1

    def power_cut(self, surviving: Container[Path] = ()) -> None:
        """Forget what was not synced, but for names and contents of the paths in `surviving`."""
        self.steps_left = None
        for path in {*self.seen, *self.kept}:
            content = self.seen.get(path)
            if path in surviving:
                if content is None:
                    self.kept.pop(path, None)
                else:
                    self.kept[path] = content
                    content.kept = content.seen
        self.seen = dict(self.kept)
        for content in self.seen.values():
            content.seen = content.kept

    def read(self, path: Path) -> bytes:
        """Return the content; reading is no step."""
        return self._content(path).seen

    def _content(self, path: Path) -> _Content:
        if path not in self.seen:
            raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT), str(path))
        return self.seen[path]

    def write(self, path: Path, data: bytes, *, mode: int) -> None:
        """Create or empty the file and write."""
        del mode
        self._step()
        content = self.seen.setdefault(path, _Content())
        content.seen = b""
        self._put(content, data)

    def _put(self, content: _Content, data: bytes) -> None:
        room = len(data) if self.full is None else min(self.full, len(data))
        content.seen += data[:room]
        if self.full is not None:
            self.full -= room
        if room < len(data):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    def sync(self, path: Path) -> None:
        """Keep the content."""
        self._step()
        content = self._content(path)
        content.kept = content.seen

    def rename(self, source: Path, target: Path) -> None:
        """Put one file in place of another."""
        self._step()
        self.seen[target] = self._content(source)
        del self.seen[source]

    def remove(self, path: Path) -> None:
        """Take the name away."""
        self._step()
        self._content(path)
        del self.seen[path]

    def sync_folder(self, folder: Path) -> None:
        """Keep the folder's names."""
        self._step()
        for path in {*self.seen, *self.kept}:
            if path.parent == folder:
                if path in self.seen:
                    self.kept[path] = self.seen[path]
                else:
                    del self.kept[path]

    def exists(self, path: Path) -> bool:
        """Tell whether programs see such a file."""
        return path in self.seen
