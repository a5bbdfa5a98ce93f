"""Errors of a port, with a message that says what to do.

`look` gathers what the words need, `refusal` chooses them. ENOENT, ENODEV, ENXIO, EIO, EACCES and EBUSY all mean
"not yet": an adapter that comes back passes through several of them before udev is done with it.
"""

from __future__ import annotations

import errno
import grp
import os
import pwd
import stat
import termios
from pathlib import Path

from lfs10d.errors import PortBusyError, PortError, PortGoneError, PortLostError
from lfs10d.system.dataclass import dataclass
from lfs10d.system.logs import escape

GROUP_MAY_USE = stat.S_IRGRP | stat.S_IWGRP

_SEE = "`ls -l /dev/serial/by-id` shows the adapters that are there"
_ABSENT = f"there is no such device: is the adapter plugged in and the path right? {_SEE}"
_SILENT = f"no hardware answers behind it ({{reason}}): is the adapter plugged in, or was another device meant? {_SEE}"
_NO_PATH = f"is no path of a device: {_SEE}"

_ADVICE = {
    errno.ENOENT: _ABSENT,
    errno.ENOTDIR: _ABSENT,
    errno.ENODEV: _SILENT,
    errno.ENXIO: _SILENT,
    errno.EIO: _SILENT,
    errno.ELOOP: f"its symbolic links lead in a circle: name the device itself; {_SEE}",
    errno.EISDIR: f"is a directory, no serial port; {_SEE}",
    errno.ENOTTY: f"is no serial port; {_SEE}",
    errno.EINVAL: _NO_PATH,
    errno.ENAMETOOLONG: _NO_PATH,
    errno.EACCES: (
        "permission denied: add the user {user} to the group {group} (sudo usermod -aG {group} {user}), "
        "then log in again or restart the service"
    ),
    errno.EPERM: (
        "the system forbids it, whatever the file's permissions say: in a service allow the device (DeviceAllow=), "
        "in a container pass it in (--device)"
    ),
}
"""The message for each errno of open(2), or of the first access to the device."""

_MISSING = frozenset({errno.ENOENT, errno.ENOTDIR})
_GONE = _MISSING | {errno.ENODEV, errno.ENXIO, errno.EIO}
_USED_ELSEWHERE = frozenset({errno.EBUSY, errno.EWOULDBLOCK})


@dataclass(frozen=True, slots=True)
class PortErrorFacts:
    """The facts about a port that cannot be opened.

    `target` is where a symbolic link ends, `group` the group whose members may use the device ("" for both where
    there is none), `user` who we are, `holder` who has the port ("" if unknown).
    """

    target: str = ""
    group: str = ""
    user: str = ""
    holder: str = ""


def look(path: str) -> PortErrorFacts:
    """Gather the facts about a path; never fails."""
    try:
        target = escape(os.path.realpath(path)) if Path(path).is_symlink() else ""
    except (OSError, ValueError):
        target = ""
    return PortErrorFacts(target=target, group=_group(path), user=_user())


def refusal(path: str, code: int, facts: PortErrorFacts) -> PortError:
    """Return the error for an errno met while opening or setting a port."""
    if code in _USED_ELSEWHERE:
        return PortBusyError(path, f"in use by {facts.holder or 'another program'}: end that, or free the port there")
    return (PortGoneError if code in _GONE else PortLostError)(path, _words(code, facts))


def hung_up(path: str, code: int) -> PortGoneError:
    """Return the error for an errno met on an open port (0: the end of a hung-up one)."""
    reason = f" ({os.strerror(code)})" if code else ""
    return PortGoneError(path, f"hung up{reason}: the adapter was unplugged or reset; plug it in again")


def number_of(error: OSError | termios.error) -> int:
    """Return the errno of an error; `termios.error` is no OSError but carries the same number."""
    number: object = error.errno if isinstance(error, OSError) else error.args[0]
    return number if isinstance(number, int) else errno.EIO


def _words(code: int, facts: PortErrorFacts) -> str:
    if code in _MISSING and facts.target:
        return f"the link leads to {facts.target}, which is not there: is the adapter plugged in? {_SEE}"
    if code == errno.EACCES and not facts.group:
        return (
            f"permission denied to the user {facts.user}, and no group may use it: give it to the group dialout by a "
            'udev rule (GROUP="dialout", MODE="0660") and be a member of it'
        )
    words = _ADVICE.get(code, "cannot be used ({reason}): see its driver's messages in `dmesg`")
    return words.format(reason=os.strerror(code), user=facts.user, group=facts.group)


def _group(path: str) -> str:
    """Return the group whose members may read and write the device; "" if there is none."""
    try:
        status = Path(path).stat()
    except (OSError, ValueError):
        return ""
    if status.st_mode & GROUP_MAY_USE != GROUP_MAY_USE:
        return ""
    try:
        return grp.getgrgid(status.st_gid).gr_name
    except KeyError:
        return str(status.st_gid)


def _user() -> str:
    try:
        return pwd.getpwuid(os.geteuid()).pw_name
    except KeyError:
        return str(os.geteuid())
