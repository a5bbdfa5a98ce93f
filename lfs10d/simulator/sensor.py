"""One simulated device: receives requests, obeys them and replies, with the faults it is given.

What a write of id or rate does (the manual leaves it open, so every variant can be played):

==================== ================ =================== =======================
fault                register reads   obeyed              echo
==================== ================ =================== =======================
none                 new              after the echo      from the old place
at_once              new              before the echo     from the new place
power_cycle          new              at power-up         from the old place
stores_but_ignores   new              never               from the old place
dip_locked (id only) old or new       never               echo or exception
slow_flash           new              after the echo      then silent for `delay`
echo_losing          new              at once             none
==================== ================ =================== =======================
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from random import Random
from typing import Final

from lfs10d.simulator.faults import (
    ActiveFaults,
    FaultKind,
    SensorFault,
    sensor_fault,
)
from lfs10d.simulator.frame_faults import SPOIL, broken_float, distorted, spoilt
from lfs10d.simulator.registers import LFS10, READ_HOLDING, READ_INPUT, WRITE_SINGLE, Blueprint, Signal
from lfs10d.simulator.wind import Unique, WindSource
from lfs10d.simulator.wire import Format, Framing, nanoseconds, seal

BROADCAST: Final = 0
WILDCARD_ID: Final = 255
EXCEPTION_BIT: Final = 0x80
ILLEGAL_FUNCTION: Final = 1
ILLEGAL_ADDRESS: Final = 2
ILLEGAL_VALUE: Final = 3
SILENT_TARGET: Final = 11
REQUEST_BODY: Final = 6
"""Bytes of the requests 03, 04 and 06 without their check: id, function, two words."""

DAYS: Final = nanoseconds(1e6)
"""Before anything happened on the line, in ns."""
_FOLLOWED: Final = frozenset({FaultKind.TWIN, FaultKind.REPEATED, FaultKind.GATEWAY})
_NOTHING: Final[ActiveFaults] = {}


@dataclass(frozen=True, slots=True)
class Reply:
    """What a sensor sends: bytes, when, in which format; and what it meant by them."""

    sensor: Sensor
    start: int
    data: bytes
    format: Format
    pause: int
    values: tuple[float, ...]
    """The measured values in it; empty if none, or if they were broken."""
    whole: bool
    """A master that hears every byte may believe it."""
    second: bool = False
    """Another answer of this sensor to the same request came before it."""
    following: tuple[Reply, ...] = ()
    """What comes after it, to the same request."""

    @property
    def ends(self) -> int:
        """When its last bit is over."""
        return self.format.ends(self.start, len(self.data), self.pause)[-1]

    def postponed(self, start: int) -> Reply:
        """Return the same, what follows too, beginning no earlier than `start`."""
        delay = max(0, start - self.start)
        following = tuple(replace(each, start=each.start + delay) for each in self.following)
        return replace(self, start=self.start + delay, following=following)


class Sensor:
    """A device at a slave id, with its registers, faults and power. Switch anything at any time in a test."""

    def __init__(
        self,
        slave: int,
        *,
        blueprint: Blueprint = LFS10,
        format: Format | None = None,  # noqa: A002  # the word for it
        framing: Framing = "rtu",
        turnaround: float = 0.005,
        jitter: float = 0.0,
        source: WindSource | None = None,
        seed: int = 0,
    ) -> None:
        self.slave = slave
        self.blueprint = blueprint
        self.format = format or Format()
        self.framing: Framing = framing
        self.turnaround = turnaround
        """Seconds from the request's last bit to the answer's first; up to `jitter` more, drawn each time."""
        self.jitter = jitter
        self.source: WindSource = source or Unique()
        self.words = dict(blueprint.words)
        if blueprint.id_register is not None:
            self.words[blueprint.id_register] = slave
        if blueprint.rate_register is not None and self.format.baudrate in blueprint.rate_codes:
            self.words[blueprint.rate_register] = blueprint.rate_codes[self.format.baudrate]
        for signal in blueprint.signals:
            for n in range(signal.count):
                self.words.setdefault(signal.address + n, 0)
        self.faults: list[SensorFault] = []
        self.powered = True
        self.hung = False
        self.deaf_until = 0
        self._last_answer = -DAYS
        self._last_request = -DAYS
        self._last: float | None = None
        self._cuts = 0
        self.random = Random(f"{seed}/{slave}")  # noqa: S311  # repeatable faults, no secret

    def __repr__(self) -> str:
        """Return slave id and rate."""
        return f"<Sensor {self.slave} at {self.format.baudrate}>"

    def add_fault(self, kind: FaultKind | str, rate: float = 1.0, **particulars: float | str | None) -> SensorFault:
        """Add a fault with times in seconds (see `faults.sensor_fault`) and return it."""
        added = sensor_fault(kind, rate, **particulars)  # type: ignore[arg-type]  # passed on as they are
        self.faults.append(added)
        return added

    def clear_faults(self, kind: FaultKind | str | None = None) -> None:
        """Remove the faults of one kind, or all."""
        self.faults = [one for one in self.faults if kind is not None and one.kind != kind]

    def silent_from(self, first: float, last: float | None = None) -> None:
        """Be dead from that time in seconds on, until `last` if given."""
        self.add_fault(FaultKind.SILENT, first=first, last=last)

    def power_cut(self) -> None:
        """Lose power; a byte under way is completed (`SimulatedLine.power_cut` cuts that too)."""
        self.powered = False

    def power_up(self) -> None:
        """Come back: what the registers say of id and rate is obeyed, unless something overrules it."""
        self.powered = True
        self.hung = False
        self.deaf_until = 0
        kinds = {one.kind for one in self.faults}
        register = self.blueprint.id_register
        if FaultKind.DIP_LOCKED in kinds and register is not None:
            self.words[register] = self.slave
        if FaultKind.STORES_BUT_IGNORES not in kinds:
            self._take_place()

    def power_cycle(self) -> None:
        """Lose power and come back."""
        self.power_cut()
        self.power_up()

    def restore(self, now: int) -> None:
        """Come back from the scheduled power cuts that are over by `now`."""
        if self.faults:
            cuts = sum(one.window.ended(now) for one in self.faults if one.kind is FaultKind.POWER_CUT)
            if cuts > self._cuts:
                self.power_up()
            self._cuts = cuts

    def disturb(self, now: int) -> None:
        """Hear a frame that is none: one that hangs is hung from now on."""
        if any(one.kind is FaultKind.HANGS and one.strikes(now, self.random) for one in self.faults):
            self.hung = True

    def hear(self, body: bytes, ended: int, *, after_dead: bool = False) -> Reply | None:
        """Hear a request (its body) whose last bit came at `ended`; return what is sent in answer, if anything.

        `after_dead`: the request before this one went to another sensor and had no answer.
        """
        if body[0] not in (self.slave, BROADCAST) and not self._wild(body[0], ended):
            return None
        if not self.powered or self.hung or ended < self.deaf_until or len(body) != REQUEST_BODY:
            return None
        active = self._active(ended) if self.faults else _NOTHING
        gone = FaultKind.SILENT in active or FaultKind.POWER_CUT in active
        if gone or (after_dead and FaultKind.SHY in active) or self._unfit(active, ended):
            return None
        format_before = self.format
        answer, values = self._obey(body, ended, active)
        if answer[1] & EXCEPTION_BIT and FaultKind.HANGS in active:
            self.hung = True
        if body[0] == BROADCAST or (FaultKind.ECHO_LOSING in active and answer[1] == WRITE_SINGLE):
            return None
        shape = self.format if FaultKind.AT_ONCE in active else format_before
        delay = nanoseconds(self.turnaround)
        if self.jitter:
            delay += nanoseconds(self.jitter * self.random.random())
        if not active:
            frame = seal(answer, self.framing, self.blueprint.check)
            return self._reply(Reply(self, ended + delay, frame, shape, 0, values, whole=True))
        if FaultKind.LATE in active:
            delay += active[FaultKind.LATE].delay
        frame = seal(distorted(answer, active), self.framing, self.blueprint.check)
        pause = active[FaultKind.SLOW_BYTES].delay if FaultKind.SLOW_BYTES in active else 0
        sent, whole = spoilt(frame, active, self.random, self.framing), SPOIL.isdisjoint(active)
        reply = self._reply(Reply(self, ended + delay, sent, shape, pause, values, whole=whole))
        return self._followed(reply, body, ended, active) if _FOLLOWED.intersection(active) else reply

    def _followed(self, reply: Reply, body: bytes, ended: int, active: ActiveFaults) -> Reply:
        """Return a reply with what else comes to the same request."""
        following: list[Reply] = []
        if FaultKind.GATEWAY in active:
            gateway = active[FaultKind.GATEWAY]
            code = SILENT_TARGET if gateway.code is None else gateway.code
            refusal = seal(self._refuse(body, code)[0], self.framing, self.blueprint.check)
            late, reply = reply, replace(reply, data=refusal, pause=0, values=())
            following.append(replace(late, start=reply.ends + gateway.delay))
        if FaultKind.REPEATED in active:
            start = reply.ends + active[FaultKind.REPEATED].delay
            following.append(replace(reply, start=start, values=(), second=True))
        if FaultKind.TWIN in active and body[1] in (READ_HOLDING, READ_INPUT):
            answer, values = self._obey(body, ended, _NOTHING)
            frame = seal(answer, self.framing, self.blueprint.check)
            start = reply.ends + active[FaultKind.TWIN].delay
            following.append(Reply(self, start, frame, reply.format, 0, values, whole=True, second=True))
        return replace(reply, following=tuple(following))

    def _reply(self, reply: Reply) -> Reply:
        self._last_answer = reply.format.ends(reply.start, len(reply.data), reply.pause)[-1]
        return reply

    def _unfit(self, active: ActiveFaults, ended: int) -> bool:
        """Whether it loses this request: it came too soon after an answer, or after too long a pause."""
        before, self._last_request = self._last_request, ended
        slept = FaultKind.SLEEPS in active and ended - max(before, self._last_answer) > active[FaultKind.SLEEPS].delay
        return slept or (
            FaultKind.NEEDS_REST in active and ended - self._last_answer < active[FaultKind.NEEDS_REST].delay
        )

    def _wild(self, slave: int, now: int) -> bool:
        return slave == WILDCARD_ID and any(
            one.kind is FaultKind.WILDCARD and one.strikes(now, self.random) for one in self.faults
        )

    def _active(self, now: int) -> ActiveFaults:
        return {one.kind: one for one in self.faults if one.strikes(now, self.random)}

    def _obey(self, body: bytes, now: int, active: ActiveFaults) -> tuple[bytes, tuple[float, ...]]:
        function = body[1]
        if FaultKind.EXCEPTION in active:
            return self._refuse(body, active[FaultKind.EXCEPTION].code or ILLEGAL_ADDRESS)
        if function not in self.blueprint.functions:
            return self._refuse(body, ILLEGAL_FUNCTION)
        address, word = int.from_bytes(body[2:4], "big"), int.from_bytes(body[4:6], "big")
        if function in (READ_HOLDING, READ_INPUT):
            return self._read(body, address, word, now, active)
        return self._write(body, address, word, now, active), ()

    @staticmethod
    def _refuse(body: bytes, code: int) -> tuple[bytes, tuple[float, ...]]:
        return bytes((body[0], body[1] | EXCEPTION_BIT, code)), ()

    def _read(
        self, body: bytes, address: int, count: int, now: int, active: ActiveFaults
    ) -> tuple[bytes, tuple[float, ...]]:
        if not 1 <= count <= self.blueprint.most_words(self.framing):
            return self._refuse(body, ILLEGAL_VALUE)
        values: list[float] = []
        for signal in self.blueprint.signals:
            if signal.address < address + count and address < signal.address + signal.count:
                values += self._measure(signal, now, active)
        try:
            words = [self.words[register] for register in range(address, address + count)]
        except KeyError:
            return self._refuse(body, ILLEGAL_ADDRESS)
        data = b"".join([word.to_bytes(2, "big") for word in words])
        return body[:2] + bytes((len(data),)) + data, tuple(values)

    def _measure(self, signal: Signal, now: int, active: ActiveFaults) -> tuple[float, ...]:
        """Put the signal's value into its registers; return it, or nothing if it is a broken one."""
        value = self._last if FaultKind.STUCK in active and self._last is not None else self.source(now)
        self._last = value
        bits = broken_float(active)
        words = signal.words(value) if bits is None else signal.broken(bits)
        for n, word in enumerate(words):
            self.words[signal.address + n] = word
        return (signal.settled(value),) if bits is None else ()

    def _write(self, body: bytes, address: int, value: int, now: int, active: ActiveFaults) -> bytes:
        allowed = self.blueprint.writable.get(address)
        if allowed is None:
            return self._refuse(body, ILLEGAL_ADDRESS)[0]
        if value not in allowed:
            return self._refuse(body, ILLEGAL_VALUE)[0]
        if address == self.blueprint.id_register and FaultKind.DIP_LOCKED in active:
            switch = active[FaultKind.DIP_LOCKED]
            if switch.reads == "new":
                self.words[address] = value
            return body if switch.answer == "echo" else self._refuse(body, switch.code or ILLEGAL_ADDRESS)[0]
        if self.words[address] != value and FaultKind.SLOW_FLASH in active:
            self.deaf_until = now + active[FaultKind.SLOW_FLASH].delay
        self.words[address] = value
        if {FaultKind.STORES_BUT_IGNORES, FaultKind.POWER_CYCLE}.isdisjoint(active):
            self._take_place(address)
        return bytes((self.slave,)) + body[1:] if FaultKind.AT_ONCE in active and body[0] else body

    def _take_place(self, register: int | None = None) -> None:
        """Obey what the registers say of id and rate (only the one that was written, if given)."""
        blueprint = self.blueprint
        if blueprint.id_register is not None and register in (None, blueprint.id_register):
            self.slave = self.words[blueprint.id_register]
        if blueprint.rate_register is not None and register in (None, blueprint.rate_register):
            code = self.words[blueprint.rate_register]
            for rate, its_code in blueprint.rate_codes.items():
                if its_code == code and rate != self.format.baudrate:
                    self.format = replace(self.format, baudrate=rate)
