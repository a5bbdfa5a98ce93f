"""Files that survive a power cut: write, fsync, rename, fsync of the folder.

`Disk` holds the order of the steps, `Files` are the steps; the tests have some that forget at a power cut what was not
synced.
"""

from __future__ import annotations

import contextlib
import os
from pathlib import Path

from lfs10d.system.regular_file import read_regular, write_new


class Files:
    """The basic steps on a file system, as system calls. All raise OSError."""

    def read(self, path: Path) -> bytes:
        """Return the content; raises OSError where it is no regular file, and never waits."""
        return read_regular(path)

    def write(self, path: Path, data: bytes, *, mode: int) -> None:
        """Write a new file in place of an old one; it does not survive a power cut yet."""
        write_new(path, data, mode=mode)

    def sync(self, path: Path) -> None:
        """Wait until the content is on the disk."""
        descriptor = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)

    def rename(self, source: Path, target: Path) -> None:
        """Put one file in place of another, in one step."""
        source.replace(target)

    def remove(self, path: Path) -> None:
        """Remove the name."""
        path.unlink()

    def sync_folder(self, folder: Path) -> None:
        """Wait until the folder's names are on the disk."""
        self.sync(folder)

    def exists(self, path: Path) -> bool:
        """Return whether there is such a file."""
        return path.exists()


class Disk:
    """Changes to files that are on the disk when the call returns, or have not happened.

    All raise OSError. New files are readable by their owner only, unless `mode` says otherwise.
    """

    def __init__(self, files: Files | None = None) -> None:
        self.files = Files() if files is None else files

    def read(self, path: Path) -> bytes:
        """Return the content of a file."""
        return self.files.read(path)

    def replace(self, path: Path, data: bytes, *, mode: int = 0o600) -> None:
        """Replace the whole file by `data`: after a power cut it has the old content or the new."""
        draft = path.with_name(f".{path.name}.new")
        try:
            self.files.write(draft, data, mode=mode)
            self.files.sync(draft)
            self.files.rename(draft, path)
        except OSError:
            with contextlib.suppress(OSError):
                self.files.remove(draft)
            raise
        self.files.sync_folder(path.parent)

    def remove(self, path: Path) -> None:
        """Remove a file, if it is there."""
        if self.files.exists(path):
            self.files.remove(path)
            self.files.sync_folder(path.parent)

    def put_aside(self, path: Path, target: Path) -> None:
        """Give a file another name in the same folder."""
        self.files.rename(path, target)
        self.files.sync_folder(path.parent)
