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

from dataclasses import field, replace
from random import Random
from typing import Final

from lfs10d.simulator.blueprint import LFS10, WRITE_COILS, WRITES, Blueprint
from lfs10d.simulator.burst import Burst
from lfs10d.simulator.faults import (
    ActiveFaults,
    FaultKind,
    SensorFault,
)
from lfs10d.simulator.frame_faults import SPOIL, distorted, spoilt
from lfs10d.simulator.memory import (
    EXCEPTION_BIT,
    ILLEGAL_ADDRESS,
    ILLEGAL_FUNCTION,
    READS,
    REQUEST_BODY,
    Measured,
    Memory,
    is_whole,
    numbers,
    refusal,
    written,
)
from lfs10d.simulator.wind import Unique, WindSource
from lfs10d.simulator.wire import Format, Framing, nanoseconds, seal
from lfs10d.system.dataclass import dataclass

BROADCAST: Final = 0
WILDCARD_ID: Final = 255
SILENT_TARGET: Final = 11
DAYS: Final = nanoseconds(1e6)
"""Before anything happened on the line, in ns."""
_FOLLOWED: Final = frozenset({FaultKind.TWIN, FaultKind.REPEATED, FaultKind.GATEWAY})
_NOTHING: Final[ActiveFaults] = {}


@dataclass(slots=True)
class Reply:
    """What a sensor sends: bytes, when, in which format; and what it meant by them."""

    sensor: Sensor
    start: int
    data: bytes
    format: Format
    pause: int
    measured: Measured
    """The values in it by name; None where they were broken."""
    whole: bool
    """A master that hears every byte may believe it."""
    second: bool = False
    """Another answer of this sensor to the same request came before it."""
    following: tuple[Reply, ...] = ()
    """What comes after it, to the same request."""
    burst: Burst = field(init=False, repr=False, compare=False)
    """Its bytes on the line, once they are sent."""

    @property
    def values(self) -> tuple[float, ...]:
        """The measured numbers in it; empty if none, or if they were broken."""
        return numbers(self.measured)

    @property
    def ends(self) -> int:
        """When its last bit is over."""
        return self.format.ends(self.start, len(self.data), self.pause)[-1]


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
        self.format = format or Format()
        self.framing: Framing = framing
        self.turnaround = turnaround
        """Seconds from the request's last bit to the answer's first; up to `jitter` more, drawn each time."""
        self.jitter = jitter
        self.source: WindSource = source or Unique()
        self.memory = Memory(blueprint)
        self.words = self.memory.words
        if blueprint.id_register is not None:
            self.words[blueprint.id_register] = slave
        if blueprint.rate_register is not None and self.format.baudrate in blueprint.rate_codes:
            self.words[blueprint.rate_register] = blueprint.rate_codes[self.format.baudrate]
        self.faults: list[SensorFault] = []
        self.powered = True
        self.hung = False
        self.deaf_until = 0
        self._last_answer = -DAYS
        self._last_request = -DAYS
        self._cuts = 0
        self.random = Random(f"{seed}/{slave}")  # noqa: S311  # repeatable faults, no secret

    def __repr__(self) -> str:
        """Return slave id and rate."""
        return f"<Sensor {self.slave} at {self.format.baudrate}>"

    @property
    def blueprint(self) -> Blueprint:
        """What kind of device it is."""
        return self.memory.blueprint

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
        slave = body[0]
        if slave not in (self.slave, BROADCAST) and not (slave == WILDCARD_ID and self._wild(ended)):
            return None
        if not self.powered or self.hung or ended < self.deaf_until or not is_whole(body):
            return None
        active = self._active(ended) if self.faults else _NOTHING
        gone = FaultKind.SILENT in active or FaultKind.POWER_CUT in active
        if gone or (after_dead and FaultKind.SHY in active) or self._unfit(active, ended):
            return None
        format_before = self.format
        answer, measured = self._obey(body, ended, active)
        if answer[1] & EXCEPTION_BIT and FaultKind.HANGS in active:
            self.hung = True
        if body[0] == BROADCAST or (FaultKind.ECHO_LOSING in active and answer[1] in WRITES):
            return None
        shape = self.format if FaultKind.AT_ONCE in active else format_before
        delay = nanoseconds(self.turnaround)
        if self.jitter:
            delay += nanoseconds(self.jitter * self.random.random())
        if FaultKind.LATE in active:
            delay += active[FaultKind.LATE].delay
        frame = seal(distorted(answer, active), self.framing, self.blueprint.check)
        pause = active[FaultKind.SLOW_BYTES].delay if FaultKind.SLOW_BYTES in active else 0
        sent, whole = spoilt(frame, active, self.random, self.framing), SPOIL.isdisjoint(active)
        reply = self._reply(Reply(self, ended + delay, sent, shape, pause, measured, whole=whole))
        return self._followed(reply, body, ended, active) if _FOLLOWED.intersection(active) else reply

    def _followed(self, reply: Reply, body: bytes, ended: int, active: ActiveFaults) -> Reply:
        """Return a reply with what else comes to the same request."""
        following: list[Reply] = []
        if FaultKind.GATEWAY in active:
            gateway = active[FaultKind.GATEWAY]
            code = SILENT_TARGET if gateway.code is None else gateway.code
            refused = seal(refusal(body, code), self.framing, self.blueprint.check)
            late, reply = reply, replace(reply, data=refused, pause=0, measured=())
            following.append(replace(late, start=reply.ends + gateway.delay))
        if FaultKind.REPEATED in active:
            start = reply.ends + active[FaultKind.REPEATED].delay
            following.append(replace(reply, start=start, measured=(), second=True))
        if FaultKind.TWIN in active and body[1] in READS:
            answer, measured = self._obey(body, ended, _NOTHING)
            frame = seal(answer, self.framing, self.blueprint.check)
            start = reply.ends + active[FaultKind.TWIN].delay
            following.append(Reply(self, start, frame, reply.format, 0, measured, whole=True, second=True))
        return replace(reply, following=tuple(following))

    def _reply(self, reply: Reply) -> Reply:
        self._last_answer = reply.ends
        return reply

    def _unfit(self, active: ActiveFaults, ended: int) -> bool:
        """Whether it loses this request: it came too soon after an answer, or after too long a pause."""
        before, self._last_request = self._last_request, ended
        slept = FaultKind.SLEEPS in active and ended - max(before, self._last_answer) > active[FaultKind.SLEEPS].delay
        return slept or (
            FaultKind.NEEDS_REST in active and ended - self._last_answer < active[FaultKind.NEEDS_REST].delay
        )

    def _wild(self, now: int) -> bool:
        return any(one.kind is FaultKind.WILDCARD and one.strikes(now, self.random) for one in self.faults)

    def _active(self, now: int) -> ActiveFaults:
        return {one.kind: one for one in self.faults if one.strikes(now, self.random)}

    def _obey(self, body: bytes, now: int, active: ActiveFaults) -> tuple[bytes, Measured]:
        function = body[1]
        if FaultKind.EXCEPTION in active:
            return refusal(body, active[FaultKind.EXCEPTION].code or ILLEGAL_ADDRESS), ()
        if function not in self.blueprint.functions:
            return refusal(body, ILLEGAL_FUNCTION), ()
        if function in READS:
            return self.memory.read(body, self.framing, self.source, now, active)
        code = self.memory.refuses(body)
        if code is not None:
            return refusal(body, code), ()
        if function == WRITE_COILS:
            self.memory.write_coils(body)
            return body[:REQUEST_BODY], ()
        return self._write(body, now, active), ()

    def _write(self, body: bytes, now: int, active: ActiveFaults) -> bytes:
        for address, value in written(body).items():
            if address == self.blueprint.id_register and FaultKind.DIP_LOCKED in active:
                switch = active[FaultKind.DIP_LOCKED]
                if switch.reads == "new":
                    self.words[address] = value
                locked = switch.answer != "echo"
                return refusal(body, switch.code or ILLEGAL_ADDRESS) if locked else body[:REQUEST_BODY]
            if self.words[address] != value and FaultKind.SLOW_FLASH in active:
                self.deaf_until = now + active[FaultKind.SLOW_FLASH].delay
            self.words[address] = value
            if {FaultKind.STORES_BUT_IGNORES, FaultKind.POWER_CYCLE}.isdisjoint(active):
                self._take_place(address)
        body = body[:REQUEST_BODY]
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
