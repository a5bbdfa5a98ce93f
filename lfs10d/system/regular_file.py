"""Opens regular files only: never waits for a FIFO, never writes through a symbolic link."""

from __future__ import annotations

import contextlib
import errno
import os
import stat
from pathlib import Path

_KINDS = (
    (stat.S_ISFIFO, "it is a pipe, and must be a regular file"),
    (stat.S_ISSOCK, "it is a socket, and must be a regular file"),
    (stat.S_ISCHR, "it is a device, and must be a regular file"),
    (stat.S_ISBLK, "it is a device, and must be a regular file"),
)


def read_regular(path: Path, most: int | None = None) -> bytes:
    """Return the content, at most `most` bytes of it. Raises OSError, also where it is no regular file; never waits.

    A symbolic link is followed: whoever may write the folder may as well put another file there.
    """
    # Non-blocking: without that, opening a FIFO waits for a writer, for ever. It means nothing for a regular file.
    descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_NOCTTY | os.O_CLOEXEC)
    with os.fdopen(descriptor, "rb") as file:
        _refuse_irregular(descriptor, path)
        return file.read(most)


def _refuse_irregular(descriptor: int, path: Path) -> None:
    mode = os.fstat(descriptor).st_mode
    if stat.S_ISDIR(mode):
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
    for is_kind, words in _KINDS:
        if is_kind(mode):
            raise OSError(errno.EINVAL, words, str(path))


def write_new(path: Path, data: bytes, *, mode: int) -> None:
    """Write a new file in the place of one that is there; its mode is `mode` whatever the umask is. Raises OSError.

    What is there is removed, not opened: a symbolic link to another file leaves that one alone.
    """
    flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW | os.O_CLOEXEC
    try:
        descriptor = os.open(path, flags, mode)
    except FileExistsError:
        with contextlib.suppress(FileNotFoundError):
            path.unlink()
        descriptor = os.open(path, flags, mode)
    try:
        os.fchmod(descriptor, mode)
        rest = memoryview(data)
        while rest:
            rest = rest[os.write(descriptor, rest) :]
    finally:
        os.close(descriptor)


def make_private(path: Path) -> None:
    """Remove all permissions except the owner's from a file, if it is there. Raises OSError.

    Raises it for a symbolic link too, and for what is no regular file.
    """
    flags = os.O_RDONLY | os.O_NONBLOCK | os.O_NOFOLLOW | os.O_CLOEXEC
    try:
        descriptor = os.open(path, flags)
    except FileNotFoundError:
        return
    try:
        _refuse_irregular(descriptor, path)
        mode = stat.S_IMODE(os.fstat(descriptor).st_mode)
        if mode & 0o077:
            os.fchmod(descriptor, mode & 0o700)
    finally:
        os.close(descriptor)


def create_private(path: Path) -> None:
    """Create an empty file that only its owner may use, or make an existing one private. Raises OSError."""
    try:
        descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW | os.O_CLOEXEC, 0o600)
    except FileExistsError:
        make_private(path)
    else:
        os.close(descriptor)
