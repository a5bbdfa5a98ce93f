"""Identification of a slave id that answered: whether it is one device, of which profile, how fast. Pure.

Rules
-----
1. Profiles are tried in order; each by the register of its slave id, where it has one, and the read that brings its
   first value. What was answered once is not asked again. Nothing is ever written.
2. A profile fits that reads believable values; optional ones may be absent. Where the first read brings none now, the
   others are read, if more than values speaks for the profile. One with a register of its slave id fits only if all
   agree: that register holds a possible id, the values are believable, and the register of the rate, where it has one,
   holds one of its codes. Where the profile names registers that tell the device from others (`identify`), they must
   hold what it says. Values that collide do not disagree, where the id is the right one: then two such devices share
   it.
3. An answer is any right frame of the slave, an exception too. Silence is asked again, `SILENCES` times in all.
4. Where bytes came that make no right frame, or a second frame behind the right one, the read is repeated, `TRIES`
   times in all. Spoilt `SPOILT` times, two devices probably share the id (`ALL_SPOILT` where no right answer came).
5. After a profile that fits, those are tried that could be the same device: none after one by `identify`; after one by
   the register of its slave id the others that have it in the same place; after one by its values alone all.
6. Of several that fit the device is that for which most speaks: a person's own profile, then `identify`, then its own
   id in the register of the slave id, then more registers of values, then the order. The others that the answers do
   not exclude are its `alternatives`; one by `identify` has none tried after it.
"""

from __future__ import annotations

from collections.abc import Generator, Iterable, Mapping, Sequence
from dataclasses import field, replace
from enum import IntEnum
from typing import TypeAlias

from lfs10d.line.read_plan import ILLEGAL_ADDRESS
from lfs10d.modbus.frames import Codec
from lfs10d.modbus.outcome import Outcome
from lfs10d.modbus.request import READ_HOLDING_REGISTERS, ReadRegisters
from lfs10d.profiles.blocks import NO_VALUE_NOW, Block
from lfs10d.profiles.library import builtin_names
from lfs10d.profiles.profile import Profile
from lfs10d.reading import Fault, FaultCode, Value
from lfs10d.system.dataclass import dataclass

TRIES = 5
"""Tries of a read after something spoilt it."""
SPOILT = 3
"""Spoilt tries out of `TRIES` after which an answering id probably has two devices."""
ALL_SPOILT = 4
"""The same if no valid answer came: noise alone must not make a device."""
SILENCES = 3
"""Silent tries after which a slave is given up."""

_NO_ANSWER = Fault(FaultCode.TIMEOUT, "no answer")
_EXCEPTION_BODY = 3
"""Slave, function, code: the body of the shortest answer (Modbus Application Protocol V1.1b3, section 7)."""

IdentificationSteps: TypeAlias = "Generator[ReadRegisters, Outcome, FoundDevice | None]"
"""Yields reads, is sent outcomes, returns the device; None: there is none."""


@dataclass(frozen=True, slots=True)
class FoundDevice:
    """The device at one slave id and rate.

    `answers`: a right frame came; without it only bytes that make none. `rtt` in s is the middle one of the
    answers'. `profile` is the one that fits best, with the `values` it read; `alternatives` are others that its answers
    do not exclude. `id_register` is what the slave says its id is, `exception` the code of its last refusal. `spoilt`
    of `tries` repeated reads were spoilt; `duplicate`: two devices probably share the id. `suspect`: it may be no
    device of its own; see `lfs10d.line.jobs.scan`.
    """

    slave: int
    baudrate: int
    answers: bool = False
    rtt: float | None = None
    profile: Profile | None = None
    alternatives: tuple[Profile, ...] = ()
    values: Mapping[str, Value] = field(default_factory=dict)
    id_register: int | None = None
    exception: int | None = None
    spoilt: int = 0
    tries: int = 0
    duplicate: bool = False
    suspect: bool = False


def speaks(outcome: Outcome, codec: Codec) -> bool:
    """Return whether the slave is there: a valid frame of it came, also an exception or an unexpected one."""
    fault = outcome.fault
    if fault is None or fault.code is FaultCode.EXCEPTION:
        return True
    return outcome.request.slave in _speakers(outcome, codec)


def strangers(outcome: Outcome, codec: Codec) -> frozenset[int]:
    """Return the other slaves that sent a valid frame."""
    return frozenset() if outcome.fault is None else _speakers(outcome, codec) - {outcome.request.slave}


def _speakers(outcome: Outcome, codec: Codec) -> frozenset[int]:
    frames = codec.frames(codec.fold(outcome.heard), outcome.request.slave, codec.answer_size(outcome.request))
    return frozenset(body[0] for _, _, body in frames if codec.wrap(body) != outcome.sent)


def spoilt(outcome: Outcome, codec: Codec) -> bool:
    """Return whether bytes came that are no valid frame, or enough for a second frame."""
    fault = outcome.fault
    if fault is None or fault.code is FaultCode.EXCEPTION:
        return outcome.unsolicited >= shortest_answer(codec)
    return fault.code in (FaultCode.CRC, FaultCode.MALFORMED) and not speaks(outcome, codec)


def shortest_answer(codec: Codec) -> int:
    """Return the length of the shortest answer, an exception."""
    return codec.size(_EXCEPTION_BODY)


def rate_fits(profile: Profile, code: int | None, baudrate: int) -> bool:
    """Whether the register of the rate holds what a device of this profile can hold; always where it has none.

    A device may speak at a rate that the profile has no code for (the factory's may be such): then any content fits.
    """
    if profile.baudrate is None:
        return True
    return code is not None and (baudrate not in profile.baudrate.codes or code in profile.baudrate.codes.values())


def by_evidence(profiles: Iterable[Profile]) -> tuple[Profile, ...]:
    """Return profiles in the order to try: those identified by values alone come last."""
    return tuple(sorted(profiles, key=lambda profile: profile.slave_id is None and not profile.identify))


def first_read(profile: Profile, slave: int) -> ReadRegisters:
    """Return what a device of this profile is asked first: its id, or else its first values."""
    if profile.slave_id is not None:
        return ReadRegisters(slave, profile.slave_id.register, 1, READ_HOLDING_REGISTERS)
    return _read_of(profile.main_read, slave)


def _read_of(block: Block, slave: int) -> ReadRegisters:
    return ReadRegisters(slave, block.address, block.count, block.function)


def may_lack(block: Block, exception: int | None) -> bool:
    """Whether a read was refused, with this exception, because of optional registers."""
    return exception == ILLEGAL_ADDRESS and any(value.optional for value in block.values)


class _Evidence(IntEnum):
    """The evidence for a profile, the weakest first."""

    VALUES = 0
    OTHER_ID = 1
    OWN_ID = 2
    IDENTITY = 3


@dataclass(frozen=True, slots=True)
class _Fit:
    """A profile that fits: the values it read from so many registers, and what the register of its slave id holds."""

    profile: Profile
    evidence: _Evidence
    words: int
    values: Mapping[str, Value]
    id_register: int | None

    @property
    def own(self) -> bool:
        """Whether a person wrote the profile, for the device that is looked for."""
        return self.profile.name not in builtin_names()

    def may_also_be(self, other: Profile) -> bool:
        """Whether another profile could fit the same device (rule 5)."""
        if self.evidence is _Evidence.IDENTITY:
            return False
        own, its = self.profile.slave_id, other.slave_id
        return own is None or (its is not None and its.register == own.register)


class Identification:
    """One slave id at one rate; `first` is an outcome that is known already. `steps` does it."""

    def __init__(self, found: FoundDevice, profiles: Sequence[Profile], codec: Codec, first: Outcome | None) -> None:
        self._found = found
        self._slave = found.slave
        self._profiles = [profile for profile in profiles if profile.ids[0] <= found.slave <= profile.ids[1]]
        self._codec = codec
        self._told: dict[object, Outcome | None] = {}
        self._rtts: list[float] = []
        if first is not None and self._listen(first):
            self._told[first.request] = first

    def steps(self) -> IdentificationSteps:
        """Ask until it is known which device answers."""
        fits: list[_Fit] = []
        for profile in self._profiles:
            if all(fit.may_also_be(profile) for fit in fits) and (fit := (yield from self._fit(profile))) is not None:
                fits.append(fit)
        if fits:
            self._choose(fits)
        if not self._profiles:
            yield from self._hear(ReadRegisters(self._slave, 0, 1))
        rtts = sorted(self._rtts)
        self._note(rtt=rtts[len(rtts) // 2] if rtts else None)
        found = self._found
        return found if found.answers or found.duplicate else None

    def _note(self, **changes: object) -> None:
        self._found = replace(self._found, **changes)  # type: ignore[arg-type]  # replace checks the names

    def _choose(self, fits: Sequence[_Fit]) -> None:
        """Note the profile with the strongest evidence, and the others (rule 6)."""
        best = max(fits, key=lambda fit: (fit.own, fit.evidence, fit.words))  # the first of equals
        sure = best.evidence is _Evidence.IDENTITY
        others = () if sure else tuple(fit.profile.plain for fit in fits if fit is not best)
        self._note(profile=best.profile.plain, alternatives=others, values=best.values, id_register=best.id_register)

    def _fit(self, profile: Profile) -> Generator[ReadRegisters, Outcome, _Fit | None]:
        evidence, number = _Evidence.VALUES, None
        if profile.slave_id is not None:
            said = yield from self._hear(first_read(profile, self._slave))
            if said is None or said.answer is None:
                return None
            (number,) = said.answer
            if not profile.ids[0] <= number <= profile.ids[1]:
                return None
            evidence = _Evidence.OWN_ID if number == self._slave else _Evidence.OTHER_ID
        if not (yield from self._identified(profile)):
            return None
        words, values = yield from self._values(profile, evidence)
        if isinstance(values, Fault) or not (yield from self._rate_agrees(profile)):
            return None
        return _Fit(profile, _Evidence.IDENTITY if profile.identify else evidence, words, values, number)

    def _values(
        self, profile: Profile, evidence: _Evidence
    ) -> Generator[ReadRegisters, Outcome, tuple[int, Mapping[str, Value] | Fault]]:
        """Read its first values; return from how many registers, and the values or why they are not believed."""
        words, values, missing = 0, dict[str, Value](), None
        left, others = [profile.main_read], [block for block in profile.reads() if block is not profile.main_read]
        while left:
            block = left.pop(0)
            outcome = yield from self._hear(_read_of(block, self._slave))
            if outcome is None and evidence is _Evidence.OWN_ID and self._found.duplicate:
                continue  # two such devices, whose values collide
            if outcome is not None and outcome.answer is not None:
                read = block.decode(outcome.answer)
                if not isinstance(read, Fault):
                    words += block.count
                    values |= read
                elif read.code in NO_VALUE_NOW:
                    missing = read
                else:
                    return 0, read
            elif outcome is not None and outcome.fault is not None and may_lack(block, outcome.fault.exception_code):
                missing = missing or _NO_ANSWER
                left.extend(profile.without_optional(block))
            else:
                return 0, _NO_ANSWER
            if missing and not left and not values and (evidence is not _Evidence.VALUES or profile.identify):
                left, others = others, []
        return words, values if values or missing is None else missing

    def _identified(self, profile: Profile) -> Generator[ReadRegisters, Outcome, bool]:
        for each in profile.identify:
            said = yield from self._hear(ReadRegisters(self._slave, each.register, 1, each.function))
            if said is None or said.answer is None or said.answer[0] not in each.holds:
                return False
        return True

    def _rate_agrees(self, profile: Profile) -> Generator[ReadRegisters, Outcome, bool]:
        if profile.slave_id is None or profile.baudrate is None:
            return True
        said = yield from self._hear(ReadRegisters(self._slave, profile.baudrate.register, 1, READ_HOLDING_REGISTERS))
        code = None if said is None or said.answer is None else said.answer[0]
        return rate_fits(profile, code, self._found.baudrate)

    def _hear(self, request: ReadRegisters) -> Generator[ReadRegisters, Outcome, Outcome | None]:
        """Ask one read, again where rules 3 and 4 say so; return the outcome that is to be believed."""
        if request in self._told:
            return self._told[request]
        believed: Outcome | None = None
        broken = silences = tries = 0
        while tries < TRIES and silences < SILENCES and (believed is None or broken):
            outcome = yield request
            tries += 1
            broken += spoilt(outcome, self._codec)
            if self._listen(outcome):
                believed = believed or outcome
            elif not spoilt(outcome, self._codec):
                silences += 1
        if broken > self._found.spoilt:
            duplicate = self._found.duplicate or broken >= (SPOILT if self._found.answers else ALL_SPOILT)
            self._note(spoilt=broken, tries=tries, duplicate=duplicate)
        self._told[request] = believed
        return believed

    def _listen(self, outcome: Outcome) -> bool:
        """Note one outcome; return whether it answers the request beyond doubt."""
        if not speaks(outcome, self._codec):
            return False
        self._note(answers=True)
        fault = outcome.fault
        if fault is not None and fault.exception_code is not None:
            self._note(exception=fault.exception_code)
        if outcome.rtt is not None:
            self._rtts.append(outcome.rtt)
        return fault is not None or not outcome.ambiguous
