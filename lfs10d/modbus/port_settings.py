"""The settings of a port: plain values, checked once."""

from __future__ import annotations

from lfs10d.schema.quantities import BAUDRATES
from lfs10d.system.dataclass import dataclass

PARITIES = ("none", "even", "odd")
DATABITS = (7, 8)
STOPBITS = (1, 2)


@dataclass(frozen=True, slots=True)
class Rs485:
    """The driver switches the transceiver by RTS (kernel document serial-rs485); delays in seconds."""

    rts_on_send: bool = True
    rts_after_send: bool = False
    delay_before_send: float = 0.0
    delay_after_send: float = 0.0


@dataclass(frozen=True, slots=True)
class PortSettings:
    """Which port, and how its characters look; raises ValueError for what no port can be set to.

    `rs485` None leaves the driver's RS485 mode as it is (a device tree may have set it).
    """

    path: str
    baudrate: int = 9600
    parity: str = "none"
    databits: int = 8
    stopbits: int = 1
    low_latency: bool = True
    rs485: Rs485 | None = None

    def __post_init__(self) -> None:
        """Refuse what has no bits in termios."""
        for name, value, choices in (
            ("baudrate", self.baudrate, BAUDRATES),
            ("parity", self.parity, PARITIES),
            ("databits", self.databits, DATABITS),
            ("stopbits", self.stopbits, STOPBITS),
        ):
            if value not in choices:
                raise ValueError(f"{name} {value!r} is none of {', '.join(map(str, choices))}")
