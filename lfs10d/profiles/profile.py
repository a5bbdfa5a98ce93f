"""The schema of a device profile: the keys of its YAML file, and their meaning.

A profile is a fact sheet: registers, limits, how id and rate are set, what may be written at all. Register
addresses are those on the wire (0x0001 is sent as 00 01). There is no default where a guess would give a
plausible wrong number.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Annotated, Any, Literal, TypeAlias

from pydantic import AfterValidator, Field, PrivateAttr, ValidationInfo, field_validator

from lfs10d.profiles.blocks import Block, batch
from lfs10d.profiles.contents import BIT_FUNCTIONS
from lfs10d.profiles.device_facts import MOST_WORDS, Barrier, Factory, Identity, IdRegister, RateRegister, SlaveIds
from lfs10d.profiles.facts import Facts, Place, Register, Registered, Sentence, refuse
from lfs10d.profiles.manual_numbers import hint_for_address
from lfs10d.profiles.settings import Setting
from lfs10d.profiles.values import Value
from lfs10d.reading import Number
from lfs10d.schema.fields import Duration, Hexadecimal, Name, Whole

FramingName: TypeAlias = Literal["rtu", "ascii"]
ChecksumName: TypeAlias = Literal["crc", "sum"]
BUSY_EXCEPTIONS = (6,)
"""Server device busy (Modbus Application Protocol V1.1b3, section 7; EH600: the maker's fuller manual)."""

BYTE_COUNT = 1
"""Byte before the registers of an answer; it counts as data (Fuling DZB manual, appendix B)."""


def _unique(texts: tuple[str, ...]) -> tuple[str, ...]:
    if len(texts) == 0 or len(set(texts)) < len(texts):
        refuse([((), "must name at least one, each once")])
    return texts


def _repeated(facts: Iterable[Value | Setting]) -> list[tuple[Place, str]]:
    seen: dict[str, int] = {}
    problems: list[tuple[Place, str]] = []
    for index, fact in enumerate(facts):
        first = seen.setdefault(fact.name, index)
        if first != index:
            problems.append(((index, "name"), f"{fact.name!r} is the name of [{first}] already"))
    return problems


class Profile(Facts):
    """A kind of device. The first of `values` is the primary one; the first of `checksums` is the usual one.

    `ids` are the first and the last slave id it can have, both included. `ascii_max_data` bounds the data
    bytes of an ASCII answer. `min_interval` is the shortest time between two polls in seconds, `request_gap` the
    silence before each request to it, counted from the end of the exchange with it before.
    `busy_exceptions` are asked again later. `provenance` has the source of a plain key's fact.
    """

    name: Annotated[str, Name()] = Field(description="Its name, of the characters a-z 0-9 _ -.")
    title: Sentence = Field(description="What it is, for people.")
    manufacturer: Sentence | None = Field(None, description="The manufacturer, for Home Assistant.")
    model: Sentence | None = Field(None, description="Its model, for Home Assistant; the title where it is not given.")
    sources: Annotated[tuple[Sentence, ...], Field(strict=False)] = Field((), description="The maker's documents.")
    ids: SlaveIds = Field((1, 247), description="First and last slave id it can have.")
    broadcast: bool = Field(default=False, description="It obeys writes to slave 0; none is ever sent.")
    framings: Annotated[tuple[FramingName, ...], Field(strict=False), AfterValidator(_unique)] = Field(
        ("rtu",), description="rtu, ascii or both."
    )
    checksums: Annotated[tuple[ChecksumName, ...], Field(strict=False), AfterValidator(_unique)] = Field(
        ("crc",), description="crc, sum or both; the first unless a slave's `checksum` says otherwise."
    )
    max_words: Annotated[int, Whole(1, MOST_WORDS)] = Field(
        MOST_WORDS, description="Registers that one read may request."
    )
    ascii_max_data: Annotated[int, Whole(3, 252)] | None = Field(
        None, description="Data bytes that one ascii answer may have."
    )
    min_interval: Annotated[float, Duration(0, 86400)] = Field(0.0, description="Shortest time between two polls.")
    request_gap: Annotated[float, Duration(0, 60)] = Field(
        0.0, description="Rest that it needs between the end of one exchange and its next request, whatever it is for."
    )
    may_skip: Annotated[int, Whole(0, MOST_WORDS - 2)] = Field(
        0, description="Registers without a name that one read may span between two values."
    )
    write_function: Literal[6, 16] = Field(
        6,
        description="6, or 16 for a device that supports no other: settings, slave id and baud rate are written by it.",
    )
    busy_exceptions: Annotated[tuple[Annotated[int, Whole(1, 255)], ...], Field(strict=False)] = Field(
        BUSY_EXCEPTIONS, description="Exception codes that mean: ask again later."
    )
    factory: Factory | None = Field(
        None, description="Slave id and baud rate of a factory-new one; `line/adopt` needs it."
    )
    slave_id: IdRegister | None = Field(None, description="Where its slave id is set.")
    baudrate: RateRegister | None = Field(None, description="Where its baud rate is set.")
    identify: Annotated[tuple[Identity, ...], Field(strict=False)] = Field(
        (), description="Registers that distinguish it from other devices; a scan reads them."
    )
    values: Annotated[tuple[Value, ...], Field(strict=False)] = Field(
        description="What it measures, the most important first."
    )
    settings: Annotated[tuple[Setting, ...], Field(strict=False)] = Field(
        (), description="Registers that configure it."
    )
    barrier: Barrier | None = Field(None, description="A read of another length than any poll's.")
    run_commands: Annotated[tuple[Register, ...], Field(strict=False)] = Field(
        (), description="Registers that trigger an action; never written, whatever a request asks."
    )
    provenance: dict[str, Sentence] = Field(
        {}, description="Sources of keys that have no `source` of their own, by key."
    )
    notes: Annotated[tuple[Sentence, ...], Field(strict=False)] = Field((), description="What else to know.")

    _blocks: tuple[Block, ...] = PrivateAttr(default=())
    _plain: Profile | None = PrivateAttr(default=None)

    # A field's validator sees those fields above it that have no error. So the order of the fields matters,
    # and every problem of a file is found at once, though another field is wrong.

    @field_validator("factory", mode="after")
    @classmethod
    def _factory_id_is_an_id(cls, factory: Factory | None, info: ValidationInfo) -> Factory | None:
        ids = info.data.get("ids")
        if factory and ids and not ids[0] <= factory.id <= ids[1]:
            refuse([(("id",), f"{factory.id} is none of the ids {ids[0]} to {ids[1]}")])
        return factory

    @field_validator("baudrate", mode="after")
    @classmethod
    def _rate_register_is_another(cls, rate: RateRegister | None, info: ValidationInfo) -> RateRegister | None:
        slave_id = info.data.get("slave_id")
        if rate and slave_id and rate.register == slave_id.register:
            refuse([(("register",), "is the register of the slave id")])
        return rate

    @field_validator("values", mode="after")
    @classmethod
    def _values_can_be_read(cls, values: tuple[Value, ...], info: ValidationInfo) -> tuple[Value, ...]:
        problems = _repeated(values)
        if not values:
            problems.append(((), "names no value"))
        most = _words_per_read(info.data)
        for index, value in enumerate(values):
            if value.words > most and value.function not in BIT_FUNCTIONS:
                wanted = f"needs {value.words} registers, one read of this device returns {most} at most"
                problems.append(((index, "type"), f"{value.type} {wanted}"))
        refuse(problems)
        return values

    @field_validator("settings", mode="after")
    @classmethod
    def _settings_are_apart(cls, settings: tuple[Setting, ...], info: ValidationInfo) -> tuple[Setting, ...]:
        problems = _repeated(settings)
        taken = {fact.register: key for key in ("slave_id", "baudrate") if (fact := info.data.get(key)) is not None}
        for index, setting in enumerate(settings):
            if setting.register in taken:
                message = f"is set by {taken[setting.register]}; it is no setting of its own"
                problems.append(((index, "register"), message))
            taken.setdefault(setting.register, f"settings[{index}]")
        refuse(problems)
        return settings

    @field_validator("barrier", mode="after")
    @classmethod
    def _barrier_has_its_own_shape(cls, barrier: Barrier | None, info: ValidationInfo) -> Barrier | None:
        values = info.data.get("values")
        if barrier and values:
            most = _words_per_read(info.data)
            if barrier.count > most:
                refuse([(("count",), f"one read of this device returns {most} registers at most")])
            shapes = {(block.function, block.count) for block in batch(values, most, info.data.get("may_skip", 0))}
            if (barrier.function, barrier.count) in shapes:
                refuse(
                    [
                        (
                            ("count",),
                            "a poll reads as many registers: a late answer could be taken for the barrier's",
                        )
                    ]
                )
        return barrier

    @field_validator("run_commands", mode="after")
    @classmethod
    def _run_commands_are_no_settings(cls, registers: tuple[int, ...], info: ValidationInfo) -> tuple[int, ...]:
        settings = {setting.register: setting.name for setting in info.data.get("settings", ())}
        taken = [(place, register) for place, register in enumerate(registers) if register in settings]
        refuse([((place,), f"is the setting {settings[register]} already") for place, register in taken])
        return registers

    @field_validator("provenance", mode="after")
    @classmethod
    def _provenance_is_of_keys(cls, provenance: dict[str, str]) -> dict[str, str]:
        refuse([((key,), "is no key of a profile") for key in provenance if key not in cls.model_fields])
        return provenance

    def model_post_init(self, _context: Any, /) -> None:  # noqa: ANN401 - pydantic's signature
        """Batch the values once; reads and decoding are on the path of every poll."""
        self._blocks = batch(self.values, self.most_words, self.may_skip)

    def calibrated(self, calibration: Mapping[str, tuple[Number, Number]], *, shows_raw: bool = False) -> Profile:
        """Return the profile with a calibration (scale and offset by value name); itself if there is none.

        Names that it does not have are passed over. `shows_raw`: see `Value.calibrated`.
        """
        if not calibration:
            return self
        values = tuple(
            value.calibrated(*calibration[value.name], shows_raw=shows_raw) if value.name in calibration else value
            for value in self.values
        )
        profile = self.model_copy(update={"values": values})
        profile._blocks = batch(profile.values, profile.most_words, profile.may_skip)  # noqa: SLF001 - its own copy
        profile._plain = self.plain  # noqa: SLF001 - its own copy
        return profile

    @property
    def plain(self) -> Profile:
        """The profile without calibration."""
        return self._plain or self

    @property
    def checksum(self) -> ChecksumName:
        """The check of its RTU frames, unless a slave's `checksum` says otherwise."""
        return self.checksums[0]

    @property
    def value_names(self) -> tuple[str, ...]:
        """Names in the file's order, the primary value first."""
        return tuple(value.name for value in self.values)

    @property
    def units(self) -> dict[str, str]:
        """The unit of each value by name."""
        return {value.name: value.unit for value in self.values}

    def doubts(self) -> tuple[str, ...]:
        """Return the valid facts that are probably a mistake, one sentence each."""
        facts: list[tuple[str, Registered | None]] = [(value.name, value) for value in self.values]
        facts += [("slave_id", self.slave_id), ("baudrate", self.baudrate), ("barrier", self.barrier)]
        facts += [("identify", each) for each in self.identify]
        facts += [(setting.name, setting) for setting in self.settings]
        hints = (
            (name, hint_for_address(fact.register, getattr(fact, "function", None)))
            for name, fact in facts
            if fact is not None and not isinstance(fact.register, Hexadecimal)  # no manual counts in hexadecimal
        )
        own = ((value.name, doubt) for value in self.values for doubt in value.doubts)
        return tuple(f"{name}: {hint}" for name, hint in (*hints, *own) if hint is not None)

    @property
    def rates(self) -> tuple[int, ...]:
        """The known rates of a device: those that can be set, and the factory's."""
        factory = () if self.factory is None else (self.factory.baudrate,)
        return tuple(dict.fromkeys((*factory, *self.rate_codes)))

    @property
    def rate_codes(self) -> Mapping[int, int]:
        """The content of its rate register for each rate; empty where none can be set."""
        return {} if self.baudrate is None else self.baudrate.codes

    @property
    def most_words(self) -> int:
        """Registers that one read may ask for in every framing that the device speaks."""
        return _words_per_read(self.__dict__)

    def first_of(self, device_class: str) -> Value | None:
        """Return the first value of a class, None if there is none."""
        return next((value for value in self.values if value.device_class == device_class), None)

    def setting_at(self, register: int) -> Setting | None:
        """Return the setting at a register; None if the profile names none: it must not be written."""
        return next((setting for setting in self.settings if setting.register == register), None)

    def reads(self) -> tuple[Block, ...]:
        """Return the reads of one poll, neighbouring values together; the same objects every time."""
        return self._blocks

    @property
    def main_read(self) -> Block:
        """The read of the first value, which is the primary one."""
        name = self.values[0].name
        return next(block for block in self._blocks if any(value.name == name for value in block.values))

    def batched(self, values: Iterable[Value]) -> tuple[Block, ...]:
        """Return the reads of some of its values, without registers of the others."""
        return batch(values, self.most_words, self.may_skip, self.values)

    def alone(self, values: Iterable[Value]) -> tuple[Block, ...]:
        """Return a read for each of these values; values that are parts of the same registers share one."""
        places: dict[tuple[int, int], list[Value]] = {}
        for value in values:
            places.setdefault((value.function, value.register), []).append(value)
        return tuple(block for place in places.values() for block in self.batched(place))

    def without_optional(self, block: Block) -> tuple[Block, ...]:
        """Return the reads of a block's required values, or if it has none, of each optional one alone.

        None where that would be the same read again.
        """
        required = [value for value in block.values if not value.optional]
        if required:
            return self.batched(required) if len(required) < len(block.values) else ()
        alone = self.alone(block.values)
        return alone if len(alone) > 1 else ()


def _words_per_read(data: dict[str, Any]) -> int:
    """Return the most registers of one read in every framing; fields with an error are ignored."""
    most: int = data.get("max_words", MOST_WORDS)
    limit: int | None = data.get("ascii_max_data")
    if limit is not None and "ascii" in data.get("framings", ()):
        most = min(most, (limit - BYTE_COUNT) // 2)
    return most
