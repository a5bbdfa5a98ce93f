"""Notifies the service manager: READY, RELOADING, STATUS, WATCHDOG, STOPPING (sd_notify(3)).

Without `$NOTIFY_SOCKET` every call is silent. No call waits and none fails: a service manager that does not listen
is no reason to stop measuring.
"""

from __future__ import annotations

import os
import socket
import time
from collections.abc import Mapping

from lfs10d.system.logs import escape


class Notifier:
    """Notifies the service manager; every method returns whether the message was sent.

    `watchdog` is the longest time in seconds between two calls of `feed` that systemd forgives (WatchdogSec=), None
    if it does not watch this process. Calls may come from any thread.
    """

    def __init__(self, environ: Mapping[str, str] | None = None) -> None:
        variables = os.environ if environ is None else environ
        self.watchdog = watchdog_seconds(variables, os.getpid())
        self._address = notify_address(variables)
        self._socket: socket.socket | None = None
        if self._address is not None:
            self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
            self._socket.settimeout(0)

    def ready(self, status: str = "") -> bool:
        """Notify that the start, or a reload, is over."""
        return self._tell("READY=1", *_status(status))

    def reloading(self) -> bool:
        """Notify that a reload begins; `ready` ends it. Type=notify-reload needs its time."""
        # time.monotonic is CLOCK_MONOTONIC, which is what systemd compares with.
        return self._tell("RELOADING=1", f"MONOTONIC_USEC={time.monotonic_ns() // 1000}")

    def status(self, text: str) -> bool:
        """Show one line in `systemctl status`."""
        return self._tell(*_status(text))

    def feed(self) -> bool:
        """Notify that the daemon makes progress."""
        return self._tell("WATCHDOG=1")

    def stopping(self, status: str = "") -> bool:
        """Notify that the end has begun."""
        return self._tell("STOPPING=1", *_status(status))

    def close(self) -> None:
        """Close the socket; later messages are not sent."""
        if self._socket is not None:
            self._socket.close()
            self._socket = None

    def _tell(self, *assignments: str) -> bool:
        if self._socket is None or self._address is None or not assignments:
            return False
        try:
            self._socket.sendto("\n".join(assignments).encode(), self._address)
        except OSError:
            return False
        return True


def notify_address(variables: Mapping[str, str]) -> bytes | None:
    """Return the socket's address by `$NOTIFY_SOCKET`: a path, or `@name` in the abstract name space; else None."""
    place = os.fsencode(variables.get("NOTIFY_SOCKET", ""))
    if place.startswith(b"/"):
        return place
    return b"\0" + place[1:] if place.startswith(b"@") and len(place) > 1 else None


def watchdog_seconds(variables: Mapping[str, str], pid: int) -> float | None:
    """Return the watchdog's limit by `$WATCHDOG_USEC` in seconds; None if `$WATCHDOG_PID` is another process."""
    meant = variables.get("WATCHDOG_PID")
    limit = variables.get("WATCHDOG_USEC", "")
    if meant not in {None, str(pid)} or not (limit.isascii() and limit.isdecimal()) or int(limit) == 0:
        return None
    return int(limit) / 1_000_000


def _status(text: str) -> tuple[str, ...]:
    # A line break would begin another assignment: STATUS must not be able to say READY=1.
    return (f"STATUS={escape(text)}",) if text else ()
