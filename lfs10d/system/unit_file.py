"""The text of a systemd unit for one installation, and whether a person changed it since it was written. Pure."""

from __future__ import annotations

import hashlib
import re
from pathlib import PurePath

PROGRAM = "/opt/lfs10d/bin/lfs10d"
"""The program in the units as they are shipped."""
DOCUMENTATION = "/opt/lfs10d/share/doc/lfs10d"
"""The folder of the documentation in them."""
CONFIGURATION = "/etc/lfs10d/"

_MARK = re.compile(r"# Written by `lfs10d service install` \((?P<version>\S+), (?P<check>[0-9a-f]{16})\)\.[^\n]*\n")

# What the manager of a user's services cannot do: it has no privileges to give away.
_SYSTEM_ONLY = re.compile(
    r"^(?:After|Wants|DynamicUser|SupplementaryGroups|StateDirectory\w*|RuntimeDirectory\w*|ConfigurationDirectory"
    r"|DevicePolicy|DeviceAllow|CapabilityBoundingSet|AmbientCapabilities|Private\w+|Protect\w+|ProcSubset|RemoveIPC)="
    r"[^\n]*\n",
    re.MULTILINE,
)
_PLAIN_PATH = re.compile(r"[A-Za-z0-9/._+@,:-]+")


def for_installation(template: str, program: PurePath, documentation: PurePath) -> str:
    """Return a shipped unit with this installation's program and its folder of documentation.

    Raises ValueError for a path that a unit's command lines cannot carry as it is.
    """
    for path in (program, documentation):
        if not _PLAIN_PATH.fullmatch(str(path)):
            raise ValueError(f"{path}: a unit cannot carry this path; install into one of plain letters: /opt/lfs10d")
    return template.replace(PROGRAM, str(program)).replace(DOCUMENTATION, str(documentation))


def for_user(unit: str, configurations: PurePath) -> str:
    """Return a unit for the manager of one user's services, whose configurations are in a folder of that user.

    State and status go where the daemon puts them for a person, below the home and the session's runtime directory.
    """
    if not _PLAIN_PATH.fullmatch(str(configurations)):
        raise ValueError(f"{configurations}: a unit cannot carry this path")
    comments = r"^# DeviceAllow= below [^\n]*\n|^# The broker's password, [^\n]*\n|^#LoadCredential=[^\n]*\n"
    unit = re.sub(comments, "", _SYSTEM_ONLY.sub("", unit), flags=re.MULTILINE)
    unit = unit.replace("WantedBy=multi-user.target", "WantedBy=default.target")
    return re.sub(r"\n{3,}", "\n\n", unit).replace(CONFIGURATION, f"{configurations}/")


def marked(unit: str, version: str) -> str:
    """Return the unit with a first line by which `is_unchanged` recognises it."""
    return (
        f"# Written by `lfs10d service install` ({version}, {_check(unit)}). Changed by hand it is left alone; "
        f"better is a drop-in: systemctl edit\n{unit}"
    )


def is_unchanged(text: str) -> bool:
    """Return whether a unit's file is still as `lfs10d service install` of any version wrote it."""
    mark = _MARK.match(text)
    return mark is not None and mark["check"] == _check(text[mark.end() :])


def _check(unit: str) -> str:
    return hashlib.sha256(unit.encode()).hexdigest()[:16]
