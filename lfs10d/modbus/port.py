"""The port: open and lock, write, read, set the rate, close. Nothing here decides; `bus` does.

A `SerialPort` is a tty on its own file descriptor; the simulator has another `Port` in virtual time. Whatever the
system says about an open port is `PortLostError`: close it and open it anew by path, so that an adapter that comes
back as another ttyUSB is found by its link in /dev/serial/by-id.
"""

from __future__ import annotations

import errno
import fcntl
import os
import select
import stat
import struct
import termios
from contextlib import suppress
from pathlib import Path
from typing import Protocol

from lfs10d.errors import PortError, PortLostError
from lfs10d.modbus.port_errors import PortErrorFacts, hung_up, look, number_of, refusal
from lfs10d.modbus.port_lock import claim, holder, is_pty, release
from lfs10d.modbus.port_settings import PortSettings
from lfs10d.modbus.serial_driver import USB_LATENCY, lower_latency, read_counters, switch_rs485
from lfs10d.modbus.termios_attributes import attributes, differences
from lfs10d.reading import UartCounters

_READ_SIZE = 4096
"""What the kernel's line discipline can hold (N_TTY_BUF_SIZE)."""

_GONE = select.POLLHUP | select.POLLERR | select.POLLNVAL

_CONSOLES = 4
_FIRST_UART = 64
_TERMINALS = 5
"""Majors of /dev/tty0.. (minors below 64, UARTs from there) and of /dev/tty, /dev/console, /dev/ptmx."""

_INT = struct.Struct("@i")


class Port(Protocol):
    """A line's end in this machine. Times are seconds, bytes are whole characters on the wire."""

    settings: PortSettings
    adapter_latency: float
    """Longest pause that the adapter may put into one answer, as found at opening: 0.004 or 0.020."""
    paced: bool
    """Whether nothing arrives sooner than the rate allows; not so on a pseudo terminal."""

    def open(self) -> None:
        """Open by path, lock and set; raises PortLostError or PortBusyError, which say what to do."""

    def close(self) -> None:
        """Unlock and close; never raises, a second time does nothing."""

    def fileno(self) -> int:
        """Return the descriptor to select on; -1 when closed."""

    def write(self, frame: bytes) -> None:
        """Hand over a frame in one piece; raises PortLostError if it was not taken whole."""

    def read(self) -> bytes:
        """Return what is there, b"" if nothing; raises PortLostError after a hang-up."""

    def waiting(self) -> int:
        """Return how many bytes a read would give; raises PortLostError."""

    def drain(self) -> None:
        """Wait until what was written has left the wire; raises PortLostError."""

    def flush(self) -> None:
        """Forget what was received and not read; raises PortLostError."""

    def reconfigure(self, settings: PortSettings) -> None:
        """Take rate, parity, data and stop bits on the open port, the rest at the next opening.

        Nothing received or written is discarded. Raises PortLostError if the driver does not take it.
        """

    def counters(self) -> UartCounters | None:
        """Return the driver's error counters; None where it has none."""


class SerialPort:
    """A `Port` on a tty of Linux.

    `notices` is what a person should know of the open port though it works: low latency or RS485 mode refused.
    """

    def __init__(self, settings: PortSettings) -> None:
        self.settings = settings
        self.adapter_latency = USB_LATENCY
        self.paced = True
        self.notices: tuple[str, ...] = ()
        self._fd = -1
        self._hangup = select.poll()
        self._busy: tuple[str, PortErrorFacts] | None = None

    def open(self) -> None:
        """Open by path, lock, set, and discard what was received before."""
        self.close()
        try:
            fd = _open_tty(self.settings.path)
            try:
                self._prepare(fd)
            except BaseException:
                os.close(fd)
                raise
        except (OSError, termios.error) as error:
            raise self._refused(number_of(error)) from error
        except ValueError as error:  # a path with a zero byte, or one that no file system can name
            raise self._refused(errno.EINVAL) from error
        self._busy = None
        self._fd = fd
        self._hangup.register(fd, 0)

    def close(self) -> None:
        """Unlock and close, without waiting for bytes that a stuck adapter never takes."""
        fd, self._fd = self._fd, -1
        if fd < 0:
            return
        self._hangup.unregister(fd)
        release(fd)
        # The kernel would wait 30 s (closing_wait) for the rest of a frame that nobody waits for any more.
        with suppress(termios.error):
            termios.tcflush(fd, termios.TCOFLUSH)
        with suppress(OSError):
            os.close(fd)

    def fileno(self) -> int:
        """Return the descriptor to select on; -1 when closed."""
        return self._fd

    def write(self, frame: bytes) -> None:
        """Write a frame by one call: two would leave a pause inside the frame."""
        try:
            taken = os.write(self._fd, frame)
        except BlockingIOError:
            taken = 0
        except OSError as error:
            raise hung_up(self.settings.path, number_of(error)) from error
        if taken != len(frame):
            with suppress(termios.error):
                termios.tcflush(self._fd, termios.TCOFLUSH)
            raise PortLostError(
                self.settings.path,
                f"the driver took {taken} of {len(frame)} bytes of a frame: nothing leaves the adapter; "
                "plug it in again, or look at `dmesg`",
            )

    def read(self) -> bytes:
        """Return what is there; an empty read is a hang-up if poll says so, else there is nothing."""
        try:
            heard = os.read(self._fd, _READ_SIZE)
        except OSError as error:
            raise hung_up(self.settings.path, number_of(error)) from error
        if not heard and any(flags & _GONE for _, flags in self._hangup.poll(0)):
            raise hung_up(self.settings.path, 0)
        return heard

    def waiting(self) -> int:
        """Return how many bytes a read would give (FIONREAD)."""
        count = bytearray(_INT.size)
        try:
            fcntl.ioctl(self._fd, termios.FIONREAD, count)
        except (OSError, ValueError) as error:
            raise self._lost(error) from error
        (waiting,) = _INT.unpack(count)
        return int(waiting)

    def drain(self) -> None:
        """Wait until what was written has left the wire; the kernel looks every 4 ms or so."""
        while True:
            try:
                termios.tcdrain(self._fd)
            except (termios.error, ValueError) as error:
                # A signal's handler runs in the main thread, but any thread's wait is cut short by it.
                if isinstance(error, termios.error) and number_of(error) == errno.EINTR:
                    continue
                raise self._lost(error) from error
            return

    def flush(self) -> None:
        """Forget what was received and not read."""
        try:
            termios.tcflush(self._fd, termios.TCIFLUSH)
        except (termios.error, ValueError) as error:
            raise self._lost(error) from error

    def reconfigure(self, settings: PortSettings) -> None:
        """Take rate, parity, data and stop bits on the open port, and look whether they stuck."""
        try:
            _set(self._fd, settings)
        except (OSError, termios.error, ValueError) as error:
            raise self._lost(error) from error
        self.settings = settings

    def counters(self) -> UartCounters | None:
        """Return the driver's error counters; None where it has none."""
        return read_counters(self._fd) if self._fd >= 0 else None

    def _prepare(self, fd: int) -> None:
        # The lock first: what another program uses is left as it is, its locks too.
        if not claim(fd):
            raise BlockingIOError(errno.EWOULDBLOCK, os.strerror(errno.EWOULDBLOCK))
        try:
            _set(fd, self.settings)
            latency = lower_latency(fd, wanted=self.settings.low_latency)
            refused = switch_rs485(fd, self.settings.rs485) if self.settings.rs485 else None
            termios.tcflush(fd, termios.TCIFLUSH)
        except BaseException:
            release(fd)
            raise
        self.adapter_latency = latency.adapter
        self.paced = not is_pty(fd)
        self.notices = tuple(notice for notice in (latency.notice, refused) if notice)

    def _refused(self, code: int) -> PortError:
        path = self.settings.path
        if code not in {errno.EBUSY, errno.EWOULDBLOCK}:
            self._busy = None
            return refusal(path, code, look(path))
        # Who holds it is looked for once per refusal in a row: the search goes through all of /proc.
        if self._busy is None or self._busy[0] != path:
            owner = holder(path)
            self._busy = path, PortErrorFacts(holder=str(owner) if owner else "")
        return refusal(path, code, self._busy[1])

    def _lost(self, error: OSError | termios.error | ValueError) -> PortError:
        # ValueError: the descriptor of a closed port, -1.
        return hung_up(self.settings.path, errno.EBADF if isinstance(error, ValueError) else number_of(error))


def _open_tty(path: str) -> int:
    """Open a terminal that is a port; OSError with ENOTTY for what is none.

    O_NOCTTY | O_NONBLOCK: no controlling terminal, and no waiting for a carrier; DTR and RTS stay as the
    opening leaves them.
    """
    status = Path(path).stat()
    if stat.S_ISDIR(status.st_mode):
        raise OSError(errno.EISDIR, os.strerror(errno.EISDIR))
    if not stat.S_ISCHR(status.st_mode) or _is_console(status.st_rdev):
        raise OSError(errno.ENOTTY, os.strerror(errno.ENOTTY))
    return os.open(path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK | os.O_CLOEXEC)


def _is_console(device: int) -> bool:
    """Return whether it is a console: raw mode would take the keyboard away."""
    major, minor = os.major(device), os.minor(device)
    return major == _TERMINALS or (major == _CONSOLES and minor < _FIRST_UART)


def _set(fd: int, settings: PortSettings) -> None:
    """Set the attributes, and raise PortLostError if the driver does not report them back."""
    try:
        termios.tcsetattr(fd, termios.TCSANOW, attributes(settings, termios.tcgetattr(fd)))
    except termios.error as error:
        # Some C libraries say EINVAL if any bit did not stick (on a pty the parity never does): look which.
        if number_of(error) != errno.EINVAL:
            raise
    refused = differences(settings, termios.tcgetattr(fd), pty=is_pty(fd))
    if refused:
        raise PortLostError(
            settings.path,
            f"the driver did not take {', '.join(refused)}: choose what the adapter can do, or another adapter",
        )
