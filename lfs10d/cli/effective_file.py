"""A configuration file together with the changes made by request, for the verbs that show or use both."""

from __future__ import annotations

import stat
from pathlib import Path

from lfs10d.config.changes_file import ChangesFile
from lfs10d.config.credentials import reason
from lfs10d.config.effective import Effective, effective
from lfs10d.config.loader import LoadedConfig
from lfs10d.errors import StateError
from lfs10d.system.disk import Disk


def with_changes(file: LoadedConfig, directory: Path, *, chosen: bool) -> Effective:
    """Return the effective configuration of a file and the state directory; raises StateError if only half is known.

    Where nobody named the directory (`chosen` is False) and there is none, no daemon ever ran by this file, and nothing
    was changed.
    """
    why = None
    try:
        if not stat.S_ISDIR(directory.stat().st_mode):
            why = "it is no directory"
    except FileNotFoundError:
        why = "it is not there" if chosen else None
    except OSError as error:
        why = reason(error)
    if why is not None:
        raise StateError(f"the state directory {directory} cannot be read: {why}")
    found = ChangesFile(directory, Disk()).read()
    if found.trouble is not None:
        raise StateError(f"the changes made by request cannot be read: {found.trouble}")
    return effective(file, found.changes)
