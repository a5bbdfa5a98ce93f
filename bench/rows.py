"""What the bench measures: one `Row` a line of the table. A new figure is a new entry here, seldom more."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Literal, TypeAlias

Master: TypeAlias = Literal["reference", "daemon"]

BITS_PER_CHARACTER = 10
REQUEST, ANSWER = 8, 9
"""Characters of a read of two registers and of its answer."""
FIXED_ABOVE, FIXED_T35 = 19200, 0.001750
"""Modbus over Serial Line V1.02, section 2.5.1.1: t3.5 above 19200 baud, in seconds."""


@dataclass(frozen=True)
class Row:
    """One situation: the line, who polls it, how long, and what the daemon's rate is compared with."""

    name: str
    title: str
    baudrate: int = 9600
    sensors: int = 32
    turnaround_ms: float = 1.0
    polled: tuple[int, ...] = ()
    """Slave ids the masters poll; empty: all."""
    interval: str = "0s"
    profile: str = "lfs10"
    line: tuple[str, ...] = ()
    """Further options of the paced line: faults, adapter, echo."""
    ill: tuple[int, ...] = ()
    """Slave ids left out of the comparison: those that die."""
    realtime: bool = False
    sections: Mapping[str, Mapping[str, object]] = field(default_factory=dict)
    """Further keys of the daemon's configuration, by section."""
    slave: Mapping[str, object] = field(default_factory=dict)
    """Further keys of each slave."""
    request: tuple[str, str] | None = None
    """What is asked of the daemon by MQTT while it is measured: the request's name and payload."""
    every: float = 0.0
    """Seconds after which it is asked again; 0: once."""
    backlog: int = 0
    """Samples that wait on the disk at the start."""
    masters: tuple[Master, ...] = ("reference", "daemon")
    against: str = "reference"
    """`reference`, or the row whose daemon's rate is the measure."""
    warm: float = 3.0
    seconds: float = 8.0
    runs: int = 2
    """How often it is measured, unless the command line says otherwise."""

    @property
    def ids(self) -> tuple[int, ...]:
        """The slave ids polled."""
        return self.polled or tuple(range(1, self.sensors + 1))

    @property
    def healthy(self) -> tuple[int, ...]:
        """The slave ids whose rate counts."""
        return tuple(slave for slave in self.ids if slave not in self.ill)

    @property
    def limit(self) -> float:
        """Polls per second that the wire carries: 1 / (request + t3.5 + turnaround + answer + t3.5)."""
        character = BITS_PER_CHARACTER / self.baudrate
        t35 = FIXED_T35 if self.baudrate > FIXED_ABOVE else 3.5 * character
        return 1 / ((REQUEST + ANSWER) * character + 2 * t35 + self.turnaround_ms / 1e3)

    def lasting(self, seconds: float | None = None, *, warm: float | None = None) -> Row:
        """Return the row with runs of another length; `warm`: begun so long after the start."""
        return replace(
            self, seconds=self.seconds if seconds is None else seconds, warm=self.warm if warm is None else warm
        )


DYING = tuple(range(4, 33, 4))
A_DAY = 864_000
"""Samples of ten sensors at 1 Hz."""
SCAN = '{"ids": "33-247", "baudrates": [9600]}'
"""At the line's own rate, for the line counts requests at another as a fault."""
AS_IT_IS = {"wind_speed": {"scale": 1, "offset": 0}}
"""A calibration that is computed and changes nothing, for values are compared with what was sent."""
REPUBLISH = ("republish", "{}")
LIVING = tuple(slave for slave in range(1, 33) if slave not in DYING)

ROWS = (
    Row("9600", "32 at 9600", runs=5),
    Row("19200", "32 at 19200", baudrate=19200, runs=5),
    Row("115200", "32 at 115200 (generic)", baudrate=115200, profile="generic", runs=5),
    Row("9600-rt", "32 at 9600, realtime", realtime=True),
    Row("19200-rt", "32 at 19200, realtime", baudrate=19200, realtime=True),
    Row("115200-rt", "32 at 115200, realtime", baudrate=115200, profile="generic", realtime=True),
    Row("absent", "24 of 32 polled", polled=LIVING, masters=("daemon",), against=""),
    Row(
        "dead",
        "8 of 32 dead for 30 s",
        ill=DYING,
        line=("--dead", ",".join(map(str, DYING)), "--die-after", "8"),
        masters=("daemon",),
        against="absent",
        warm=36.0,
    ),
    Row("noise", "2 % faults", line=("--noise", "2"), masters=("daemon",), against="9600"),
    Row(
        "late",
        "5 % answers 550 ms late",
        line=("--late", "5", "--late-by", "550"),
        masters=("daemon",),
        against="9600",
    ),
    Row("adapter-1", "adapter, 1 ms pieces", line=("--adapter", "1")),
    Row("adapter-16", "adapter, 16 ms pieces", line=("--adapter", "16")),
    Row("echo", "echoing adapter", line=("--echo",), masters=("daemon",), against="9600"),
    Row("1hz", "10 at 1 Hz", sensors=10, interval="1s", masters=("daemon",), against=""),
    Row("idle", "nobody is polled", sensors=0, interval="1s", masters=("daemon",), against="", seconds=30.0),
    Row("4hz", "9 at 4 Hz", sensors=9, interval="250ms", masters=("daemon",), against=""),
    Row("8", "8 at 9600", sensors=8, masters=("daemon",), against="9600"),
    Row("247", "247 at 9600", sensors=247, masters=("daemon",), against="9600", warm=9.0),
    Row("plain", "32 without wind", profile="plain", masters=("daemon",), against="9600"),
    Row("records", "records of 1 min", sections={"wind": {"records": "1m"}}, masters=("daemon",), against="9600"),
    Row("partial", "every sample partial", profile="partial", masters=("daemon",), against="9600"),
    Row("calibrated", "32 calibrated", slave={"calibration": AS_IT_IS}, masters=("daemon",), against="9600"),
    Row(
        "discovery",
        "Home Assistant's discovery",
        sections={"homeassistant": {"discovery": True}},
        masters=("daemon",),
        against="9600",
    ),
    Row("replay", "a day's backlog replayed", backlog=A_DAY, masters=("daemon",), against="9600", warm=14.0),
    Row("scan", "a scan of all ids", request=("line/scan", SCAN), masters=("daemon",), against="9600"),
    Row("burst", "all retained topics each s", request=REPUBLISH, every=1.0, masters=("daemon",), against="9600"),
)

FIRST_ROWS = ("9600", "19200", "115200")
"""What `python -m bench --quick` measures."""
