"""A configuration file together with the changes made by request, for the verbs that show or use both."""

from __future__ import annotations

import os
import stat
from pathlib import Path

from lfs10d.config.changes_file import ChangesFile
from lfs10d.config.credentials import reason
from lfs10d.config.effective import Effective, effective
from lfs10d.config.loader import LoadedConfig
from lfs10d.daemon.state_directory import state_directory
from lfs10d.errors import StateError
from lfs10d.system.disk import Disk


def with_changes(file: LoadedConfig, chosen: Path | None) -> Effective:
    """Return the effective configuration of a file and the state directory; raises StateError if only half is known.

    Where nobody named the directory (`chosen` is None) and there is none, no daemon ever ran by this file, and nothing
    was changed.
    """
    directory = state_directory(file.path, file.config.line.name, chosen=chosen, environment=os.environ)
    why = None
    try:
        if not stat.S_ISDIR(directory.stat().st_mode):
            why = "it is no directory"
    except FileNotFoundError:
        why = "it is not there" if chosen is not None else None
    except OSError as error:
        why = reason(error)
    if why is not None:
        raise StateError(f"the state directory {directory} cannot be read: {why}")
    found = ChangesFile(directory, Disk()).read()
    if found.trouble is not None:
        raise StateError(f"the changes made by request cannot be read: {found.trouble}")
    return effective(file, found.changes)
