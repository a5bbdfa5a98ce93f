"""Finds the state directory and the status file of a daemon."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path

from lfs10d.config.models import DEFAULT_STEM
from lfs10d.errors import StateError
from lfs10d.system.regular_file import write_new

SYSTEM_FOLDER = Path("/etc/lfs10d")
STATUS_FILE = "status.json"


def state_directory(file: Path, line: str, *, chosen: Path | None, environment: Mapping[str, str]) -> Path:
    """Return the state directory for a configuration file and its line's name; nothing is created.

    `chosen` (--state-dir) comes first, then `$STATE_DIRECTORY` (of systemd's, the first), then one below /var/lib
    for files in /etc/lfs10d, else one in the user's home.
    """
    if chosen is not None:
        return chosen.absolute()
    if given := environment.get("STATE_DIRECTORY", "").partition(":")[0]:
        return Path(given)
    if in_system_folder(file):
        return Path("/var/lib", _service(file))
    return Path(environment.get("HOME") or "/") / ".local/state/lfs10d" / line


def in_system_folder(file: Path) -> bool:
    """Return whether a configuration file belongs to a service of the system."""
    return Path(os.path.abspath(file)).parent == SYSTEM_FOLDER  # noqa: PTH100  # resolve() would follow links


def service_unit(file: Path) -> str | None:
    """Return the systemd unit that runs the daemon of a configuration file; None where it is no service's."""
    if not in_system_folder(file):
        return None
    return "lfs10d.service" if file.stem == DEFAULT_STEM else f"lfs10d@{file.stem}.service"


def _service(file: Path) -> str:
    return "lfs10d" if file.stem == DEFAULT_STEM else f"lfs10d-{file.stem}"


def status_file(file: Path, line: str, environment: Mapping[str, str], *, root: bool = False) -> Path | None:
    """Return the status file of the daemon of a configuration file; None if there is no place for it.

    `root`: the user is root, who may write where the verbs look first. Run by hand (by sudo) there is no session; then
    the status of a service's file is there.
    """
    if given := environment.get("RUNTIME_DIRECTORY", "").partition(":")[0]:
        return Path(given, STATUS_FILE)
    if session := environment.get("XDG_RUNTIME_DIR"):
        return Path(session, f"lfs10d-{line}", STATUS_FILE)
    return Path("/run", _service(file), STATUS_FILE) if root and in_system_folder(file) else None


def status_places(file: Path, line: str, environment: Mapping[str, str]) -> tuple[Path, ...]:
    """Return where a verb looks for the daemon's status, the likeliest first."""
    places = [Path("/run", _service(file), STATUS_FILE)]
    own = status_file(file, line, environment)
    return (*places, own) if own is not None and own not in places else tuple(places)


def prepare(directory: Path) -> None:
    """Create the state directory if it is missing; raises StateError if files cannot be written there."""
    try:
        directory.mkdir(mode=0o750, parents=True, exist_ok=True)
        probe = directory / ".writable"
        write_new(probe, b"", mode=0o600)
        probe.unlink()
    except OSError as error:
        reason = (error.strerror or str(error)).lower()
        raise StateError(
            f"the state directory {directory} cannot be written: {reason}; name another with --state-dir, "
            "or let it belong to the user the daemon runs as"
        ) from None
