"""A kind of simulated device: its registers, signals and limits. LFS10 here; others are built from their profiles."""

from __future__ import annotations

from collections.abc import Container, Iterator, Mapping
from dataclasses import field
from typing import Final

from lfs10d.profiles.profile import Profile
from lfs10d.profiles.settings import Setting
from lfs10d.simulator.signals import READ_HOLDING, Signal, signal_of
from lfs10d.simulator.wire import Check, Framing
from lfs10d.system.dataclass import dataclass

READ_INPUT: Final = 4
WRITE_SINGLE: Final = 6
WRITE_COILS: Final = 15
WRITE_SEVERAL: Final = 16
WRITES: Final = frozenset({WRITE_SINGLE, WRITE_COILS, WRITE_SEVERAL})
_WORD: Final = 2


@dataclass(frozen=True, slots=True)
class Blueprint:
    """One kind of device. Registers that are neither in `words` nor of a signal nor of a span do not exist."""

    name: str
    signals: tuple[Signal, ...]
    words: Mapping[int, int] = field(default_factory=dict)
    """Other registers and what they hold at first."""
    writable: Mapping[int, Container[int]] = field(default_factory=dict)
    """What may be written where; another value is exception 03, another register exception 02."""
    coils: Container[int] = frozenset()
    """Coils that may be written by function 15."""
    functions: frozenset[int] = frozenset({READ_HOLDING, WRITE_SINGLE})
    max_words: int = 125
    ascii_max_data: int | None = None
    """Data bytes of the longest ASCII answer, the byte count among them (Fuling DZB manual, appendix B)."""
    check: Check = "crc"
    id_register: int | None = None
    rate_register: int | None = None
    rate_codes: Mapping[int, int] = field(default_factory=dict)
    """Content of the rate register by baud rate."""
    spans: tuple[tuple[int, int, int], ...] = ()
    """Function, address and count of registers without a name that it has all the same; they are 0."""

    def most_words(self, framing: Framing) -> int:
        """Return how many registers one read may ask for."""
        if framing == "rtu" or self.ascii_max_data is None:
            return self.max_words
        return min(self.max_words, (self.ascii_max_data - 1) // _WORD)


LFS10: Final = Blueprint(
    name="lfs10",
    signals=(Signal(0x0001, name="wind_speed", low=0, high=100),),
    words={0x0004: 1, 0x0005: 1},
    writable={0x0004: range(1, 3), 0x0005: range(1, 256)},
    id_register=0x0005,
    rate_register=0x0004,
    rate_codes={9600: 1, 19200: 2},
)
"""Wind speed at 0x0001-2, rate code at 0x0004, slave id at 0x0005 (LFS10 manual, register table)."""


@dataclass(frozen=True, slots=True)
class Allowed:
    """What a setting of a profile may be written."""

    setting: Setting

    def __contains__(self, word: object) -> bool:
        """Say whether the profile takes this register content."""
        return isinstance(word, int) and self.setting.refusal(word) is None


def blueprint_of(profile: Profile) -> Blueprint:
    """Return the device that a profile describes; registers it neither names nor may skip do not exist."""
    signals = tuple(signal_of(value) for value in profile.values)
    functions: set[int] = {value.function for value in profile.values}
    words: dict[int, int] = {}
    writable: dict[int, Container[int]] = {}
    for setting in profile.settings:
        allowed = Allowed(setting)
        words[setting.register] = (
            next((word for word in range(1 << 16) if word in allowed), 0) if setting.writable else 0
        )
        if setting.writable:
            writable[setting.register] = allowed
    if profile.slave_id is not None:
        words[profile.slave_id.register] = profile.ids[0]
        writable[profile.slave_id.register] = range(profile.ids[0], profile.ids[1] + 1)
    for identity in profile.identify:
        functions.add(identity.function)
        words[identity.register] = identity.holds[0]
    if profile.baudrate is not None:
        codes = profile.baudrate.codes
        words[profile.baudrate.register] = next(iter(codes.values()))
        writable[profile.baudrate.register] = frozenset(codes.values())
    if profile.barrier is not None:
        functions.add(profile.barrier.function)
        for register in range(profile.barrier.register, profile.barrier.register + profile.barrier.count):
            words.setdefault(register, 0)
    if words:
        functions.add(READ_HOLDING)
    return Blueprint(
        name=profile.name,
        signals=signals,
        words=words,
        spans=tuple(_skipped(profile)),
        writable=writable,
        functions=frozenset(functions | ({profile.write_function} if writable else set())),
        max_words=profile.max_words,
        ascii_max_data=profile.ascii_max_data,
        check=profile.checksum,
        id_register=profile.slave_id.register if profile.slave_id else None,
        rate_register=profile.baudrate.register if profile.baudrate else None,
        rate_codes=profile.rate_codes,
    )


def _skipped(profile: Profile) -> Iterator[tuple[int, int, int]]:
    """Yield function, address and count of what lies between two values, where a read may span it."""
    function, end = 0, 0
    for value in sorted(profile.values, key=lambda each: (each.function, each.register)):
        if value.function != function:
            function, end = value.function, value.register
        if end < value.register <= end + profile.may_skip:
            yield function, end, value.register - end
        end = max(end, value.end)
