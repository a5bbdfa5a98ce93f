"""One simulated device: hears requests, obeys them, answers; well, or with what ails it.

What a write of id or rate does (the manual leaves it open, so every variant can be played):

==================== ================ =================== =======================
ailment              register reads   obeyed              echo
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

from collections.abc import Mapping
from dataclasses import dataclass, replace
from random import Random
from typing import Final

from lfs10d.simulator.faults import (
    STRIKES_ANSWERS,
    STRIKES_FRAMES,
    STRIKES_VALUES,
    Ailment,
    FaultKind,
    ailment,
)
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
_COUNT_AT: Final = 2

_BROKEN_FLOATS: Final[Mapping[FaultKind, int]] = {
    FaultKind.NAN: 0x7FC0_0000,
    FaultKind.INFINITE: 0x7F80_0000,
    FaultKind.OUT_OF_RANGE: 0x4974_2400,  # 1e6
    FaultKind.SUBNORMAL: 0x0000_0001,
}
_SPOILS: Final = (STRIKES_ANSWERS | STRIKES_FRAMES) - {FaultKind.LEADING_NOISE, FaultKind.TRAILING_NOISE}
DAYS: Final = nanoseconds(1e6)
"""Before anything happened on the line, in ns."""
_FOLLOWED: Final = frozenset({FaultKind.TWIN, FaultKind.REPEATED, FaultKind.GATEWAY})
_NOTHING: Final[Mapping[FaultKind, Ailment]] = {}


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
    """A device at a slave id, with its registers, ailments and power. Switch anything at any time in a test."""

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
        self.ailments: list[Ailment] = []
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

    def ail(self, kind: FaultKind | str, rate: float = 1.0, **particulars: float | str | None) -> Ailment:
        """Add an ailment told in seconds (see `faults.ailment`) and return it."""
        added = ailment(kind, rate, **particulars)  # type: ignore[arg-type]  # passed on as they are
        self.ailments.append(added)
        return added

    def heal(self, kind: FaultKind | str | None = None) -> None:
        """Remove the ailments of one kind, or all."""
        self.ailments = [one for one in self.ailments if kind is not None and one.kind != kind]

    def silent_from(self, first: float, last: float | None = None) -> None:
        """Be dead from that time in seconds on, until `last` if given."""
        self.ail(FaultKind.SILENT, first=first, last=last)

    def power_cut(self) -> None:
        """Lose power; a byte under way is completed (`SimulatedLine.power_cut` cuts that too)."""
        self.powered = False

    def power_up(self) -> None:
        """Come back: what the registers say of id and rate is obeyed, unless something overrules it."""
        self.powered = True
        self.hung = False
        self.deaf_until = 0
        kinds = {one.kind for one in self.ailments}
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
        if self.ailments:
            cuts = sum(one.window.ended(now) for one in self.ailments if one.kind is FaultKind.POWER_CUT)
            if cuts > self._cuts:
                self.power_up()
            self._cuts = cuts

    def disturb(self, now: int) -> None:
        """Hear a frame that is none: one that hangs is hung from now on."""
        if any(one.kind is FaultKind.HANGS and one.strikes(now, self.random) for one in self.ailments):
            self.hung = True

    def hear(self, body: bytes, ended: int, *, after_dead: bool = False) -> Reply | None:
        """Hear a request (its body) whose last bit came at `ended`; return what is sent in answer, if anything.

        `after_dead`: the request before this one went to another sensor and had no answer.
        """
        if body[0] not in (self.slave, BROADCAST) and not self._wild(body[0], ended):
            return None
        if not self.powered or self.hung or ended < self.deaf_until or len(body) != REQUEST_BODY:
            return None
        struck = self._struck(ended) if self.ailments else _NOTHING
        gone = FaultKind.SILENT in struck or FaultKind.POWER_CUT in struck
        if gone or (after_dead and FaultKind.SHY in struck) or self._unfit(struck, ended):
            return None
        format_before = self.format
        answer, values = self._obey(body, ended, struck)
        if answer[1] & EXCEPTION_BIT and FaultKind.HANGS in struck:
            self.hung = True
        if body[0] == BROADCAST or (FaultKind.ECHO_LOSING in struck and answer[1] == WRITE_SINGLE):
            return None
        shape = self.format if FaultKind.AT_ONCE in struck else format_before
        delay = nanoseconds(self.turnaround)
        if self.jitter:
            delay += nanoseconds(self.jitter * self.random.random())
        if not struck:
            frame = seal(answer, self.framing, self.blueprint.check)
            return self._reply(Reply(self, ended + delay, frame, shape, 0, values, whole=True))
        if FaultKind.LATE in struck:
            delay += struck[FaultKind.LATE].delay
        frame = seal(self._distort(answer, struck), self.framing, self.blueprint.check)
        pause = struck[FaultKind.SLOW_BYTES].delay if FaultKind.SLOW_BYTES in struck else 0
        spoilt, whole = self._spoil(frame, struck), _SPOILS.isdisjoint(struck)
        reply = self._reply(Reply(self, ended + delay, spoilt, shape, pause, values, whole=whole))
        return self._followed(reply, body, ended, struck) if _FOLLOWED.intersection(struck) else reply

    def _followed(self, reply: Reply, body: bytes, ended: int, struck: Mapping[FaultKind, Ailment]) -> Reply:
        """Return a reply with what else comes to the same request."""
        following: list[Reply] = []
        if FaultKind.GATEWAY in struck:
            gateway = struck[FaultKind.GATEWAY]
            code = SILENT_TARGET if gateway.code is None else gateway.code
            refusal = seal(self._refuse(body, code)[0], self.framing, self.blueprint.check)
            late, reply = reply, replace(reply, data=refusal, pause=0, values=())
            following.append(replace(late, start=reply.ends + gateway.delay))
        if FaultKind.REPEATED in struck:
            start = reply.ends + struck[FaultKind.REPEATED].delay
            following.append(replace(reply, start=start, values=(), second=True))
        if FaultKind.TWIN in struck and body[1] in (READ_HOLDING, READ_INPUT):
            answer, values = self._obey(body, ended, _NOTHING)
            frame = seal(answer, self.framing, self.blueprint.check)
            start = reply.ends + struck[FaultKind.TWIN].delay
            following.append(Reply(self, start, frame, reply.format, 0, values, whole=True, second=True))
        return replace(reply, following=tuple(following))

    def _reply(self, reply: Reply) -> Reply:
        self._last_answer = reply.format.ends(reply.start, len(reply.data), reply.pause)[-1]
        return reply

    def _unfit(self, struck: Mapping[FaultKind, Ailment], ended: int) -> bool:
        """Whether it loses this request: it came too soon after an answer, or after too long a pause."""
        before, self._last_request = self._last_request, ended
        slept = FaultKind.SLEEPS in struck and ended - max(before, self._last_answer) > struck[FaultKind.SLEEPS].delay
        return slept or (
            FaultKind.NEEDS_REST in struck and ended - self._last_answer < struck[FaultKind.NEEDS_REST].delay
        )

    def _wild(self, slave: int, now: int) -> bool:
        return slave == WILDCARD_ID and any(
            one.kind is FaultKind.WILDCARD and one.strikes(now, self.random) for one in self.ailments
        )

    def _struck(self, now: int) -> Mapping[FaultKind, Ailment]:
        return {one.kind: one for one in self.ailments if one.strikes(now, self.random)}

    def _obey(self, body: bytes, now: int, struck: Mapping[FaultKind, Ailment]) -> tuple[bytes, tuple[float, ...]]:
        function = body[1]
        if FaultKind.EXCEPTION in struck:
            return self._refuse(body, struck[FaultKind.EXCEPTION].code or ILLEGAL_ADDRESS)
        if function not in self.blueprint.functions:
            return self._refuse(body, ILLEGAL_FUNCTION)
        address, word = int.from_bytes(body[2:4], "big"), int.from_bytes(body[4:6], "big")
        if function in (READ_HOLDING, READ_INPUT):
            return self._read(body, address, word, now, struck)
        return self._write(body, address, word, now, struck), ()

    @staticmethod
    def _refuse(body: bytes, code: int) -> tuple[bytes, tuple[float, ...]]:
        return bytes((body[0], body[1] | EXCEPTION_BIT, code)), ()

    def _read(
        self, body: bytes, address: int, count: int, now: int, struck: Mapping[FaultKind, Ailment]
    ) -> tuple[bytes, tuple[float, ...]]:
        if not 1 <= count <= self.blueprint.most_words(self.framing):
            return self._refuse(body, ILLEGAL_VALUE)
        values: list[float] = []
        for signal in self.blueprint.signals:
            if signal.address < address + count and address < signal.address + signal.count:
                values += self._measure(signal, now, struck)
        try:
            words = [self.words[register] for register in range(address, address + count)]
        except KeyError:
            return self._refuse(body, ILLEGAL_ADDRESS)
        data = b"".join([word.to_bytes(2, "big") for word in words])
        return body[:2] + bytes((len(data),)) + data, tuple(values)

    def _measure(self, signal: Signal, now: int, struck: Mapping[FaultKind, Ailment]) -> tuple[float, ...]:
        """Put the signal's value into its registers; return it, or nothing if it is a broken one."""
        broken = STRIKES_VALUES.intersection(struck)
        value = self._last if FaultKind.STUCK in broken and self._last is not None else self.source(now)
        self._last = value
        bits = next((_BROKEN_FLOATS[kind] for kind in sorted(broken) if kind in _BROKEN_FLOATS), None)
        words = signal.words(value) if bits is None else signal.broken(bits)
        for n, word in enumerate(words):
            self.words[signal.address + n] = word
        return (signal.settled(value),) if bits is None else ()

    def _write(self, body: bytes, address: int, value: int, now: int, struck: Mapping[FaultKind, Ailment]) -> bytes:
        allowed = self.blueprint.writable.get(address)
        if allowed is None:
            return self._refuse(body, ILLEGAL_ADDRESS)[0]
        if value not in allowed:
            return self._refuse(body, ILLEGAL_VALUE)[0]
        if address == self.blueprint.id_register and FaultKind.DIP_LOCKED in struck:
            switch = struck[FaultKind.DIP_LOCKED]
            if switch.reads == "new":
                self.words[address] = value
            return body if switch.answer == "echo" else self._refuse(body, switch.code or ILLEGAL_ADDRESS)[0]
        if self.words[address] != value and FaultKind.SLOW_FLASH in struck:
            self.deaf_until = now + struck[FaultKind.SLOW_FLASH].delay
        self.words[address] = value
        if {FaultKind.STORES_BUT_IGNORES, FaultKind.POWER_CYCLE}.isdisjoint(struck):
            self._take_place(address)
        return bytes((self.slave,)) + body[1:] if FaultKind.AT_ONCE in struck and body[0] else body

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

    def _distort(self, answer: bytes, struck: Mapping[FaultKind, Ailment]) -> bytes:
        """Return an answer that is wrong though its check will be right."""
        if FaultKind.WRONG_ID in struck:
            wrong = struck[FaultKind.WRONG_ID].value
            answer = bytes(((answer[0] + 1) % 256 if wrong is None else wrong,)) + answer[1:]
        if FaultKind.WRONG_COUNT in struck and answer[1] in (READ_HOLDING, READ_INPUT):
            answer = answer[:2] + bytes((answer[_COUNT_AT] + 2,)) + answer[3:] + answer[-2:]
        if FaultKind.WRONG_ECHO in struck and answer[1] == WRITE_SINGLE:
            answer = answer[:-1] + bytes((answer[-1] ^ 1,))
        if FaultKind.WRONG_FUNCTION in struck:
            answer = answer[:1] + bytes((answer[1] ^ 0x07,)) + answer[2:]
        return answer

    def _spoil(self, frame: bytes, struck: Mapping[FaultKind, Ailment]) -> bytes:
        """Return what of the frame comes onto the line."""
        if FaultKind.NOISY in struck:
            at = self.random.randrange(len(frame))
            bit = 0x10 if self.framing == "ascii" else 1 << self.random.randrange(8)
            frame = frame[:at] + bytes((frame[at] ^ bit,)) + frame[at + 1 :]
        if FaultKind.GARBAGE in struck:
            frame = self.random.randbytes(struck[FaultKind.GARBAGE].length or len(frame))
        if FaultKind.TRUNCATED in struck:
            frame = frame[: struck[FaultKind.TRUNCATED].length or self.random.randrange(1, len(frame))]
        if FaultKind.LEADING_NOISE in struck:
            frame = self.random.randbytes(struck[FaultKind.LEADING_NOISE].length or 3) + frame
        if FaultKind.TRAILING_NOISE in struck:
            frame += self.random.randbytes(struck[FaultKind.TRAILING_NOISE].length or 3)
        return frame
