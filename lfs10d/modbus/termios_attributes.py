"""The termios attributes for given settings, and which of them a driver did not accept. Pure.

Raw means that every byte arrives as it was sent and at once: no line discipline at work, no flow control, no
modem lines heeded (CLOCAL), DTR and RTS left alone at closing (HUPCL clear: some converters key the
transmitter by RTS, and a drop of it would jam the pair). A break is heard as a byte 00, so it counts as noise.
"""

from __future__ import annotations

import termios
from typing import Any, TypeAlias

from lfs10d.modbus.port_settings import PortSettings

Attributes: TypeAlias = list[Any]
"""As `termios.tcgetattr` gives them: iflag, oflag, cflag, lflag, ispeed, ospeed (int), control characters (list)."""

IFLAG, OFLAG, CFLAG, LFLAG, ISPEED, OSPEED, CC = range(7)

SPEEDS: dict[int, int] = {
    rate: getattr(termios, f"B{rate}") for rate in (1200, 2400, 4800, 9600, 19200, 38400, 57600, 115200)
}
_RATES = {speed: rate for rate, speed in SPEEDS.items()}

_SIZES = {7: termios.CS7, 8: termios.CS8}
_PARITIES = {"none": 0, "even": termios.PARENB, "odd": termios.PARENB | termios.PARODD}
_STOPS = {1: 0, 2: termios.CSTOPB}

CMSPAR = 0o10000000000
"""Mark or space parity (asm-generic/termbits.h); absent from Python's termios. Never wanted, so it must be off."""


def attributes(settings: PortSettings, current: Attributes) -> Attributes:
    """Return the attributes to set; of `current` only the control characters no raw port uses are kept.

    VMIN = VTIME = 0 and O_NONBLOCK: a read gives what is there. With parity a character that fails its check
    becomes 00 (INPCK), so that the frame's own check fails too.
    """
    flags = termios.CREAD | termios.CLOCAL
    flags |= _SIZES[settings.databits] | _PARITIES[settings.parity] | _STOPS[settings.stopbits]
    speed = SPEEDS[settings.baudrate]
    characters = list(current[CC])
    characters[termios.VMIN] = 0
    characters[termios.VTIME] = 0
    checked = termios.INPCK if settings.parity != "none" else 0
    return [checked, 0, flags, 0, speed, speed, characters]


def differences(settings: PortSettings, current: Attributes, *, pty: bool = False) -> tuple[str, ...]:
    """Return in words what the driver did not take, by the attributes it reports afterwards.

    A pty has no characters on a wire: of all this it keeps the rate.
    """
    found = []
    speeds = {current[ISPEED], current[OSPEED]}
    if speeds != {SPEEDS[settings.baudrate]}:
        rates = " and ".join(str(_RATES.get(speed, "another rate")) for speed in sorted(speeds))
        found.append(f"{settings.baudrate} baud (it says {rates})")
    if pty:
        return tuple(found)
    flags = current[CFLAG]
    if flags & termios.CSIZE != _SIZES[settings.databits]:
        found.append(f"{settings.databits} data bits")
    # Without PARENB the PARODD bit means nothing; with CMSPAR "even" would be space and "odd" mark.
    parity = flags & (termios.PARENB | termios.PARODD | CMSPAR) if flags & termios.PARENB else 0
    if parity != _PARITIES[settings.parity]:
        found.append(f"parity {settings.parity}")
    if flags & termios.CSTOPB != _STOPS[settings.stopbits]:
        found.append(f"{settings.stopbits} stop bit{'s' if settings.stopbits > 1 else ''}")
    if flags & termios.CRTSCTS:
        found.append("no flow control")
    return tuple(found)
