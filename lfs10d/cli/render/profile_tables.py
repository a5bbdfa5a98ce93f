"""A device profile as tables for a person who has never seen a register list: everything that its file says."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from lfs10d.cli.render.table import Row, Table
from lfs10d.modbus.frames import EXCEPTION_NAMES
from lfs10d.profiles.blocks import Block
from lfs10d.profiles.decimals import span
from lfs10d.profiles.facts import Fact
from lfs10d.profiles.profile import Profile
from lfs10d.profiles.settings import Setting
from lfs10d.profiles.values import Value
from lfs10d.schema.quantities import duration_text

READ_FUNCTIONS = {1: "coil ", 2: "discrete input ", 3: "", 4: "input "}
"""Function 03 reads holding registers, the usual ones; 04 reads input registers, 01 and 02 bits."""
WRITE_FUNCTIONS = {6: "06 (one register)", 16: "16 (several registers)"}


def explain(profile: Profile) -> list[Table]:
    """Return the profile as tables; those that would be empty are left out."""
    values = [_value(value) for value in profile.values]
    some_have_none = any(value.unavailable for value in profile.values)
    heads = ("name", "registers", "content", "number", "valid", *(["no value"] if some_have_none else []), "")
    displayed = [value for value in profile.values if value.precision is not None or value.device_class is not None]
    displays = tuple((value.name, value.device_class or "", _decimals(value.precision)) for value in displayed)
    settings = tuple(_setting(setting) for setting in profile.settings)
    tables = (
        Table(f"{profile.title} (profile {profile.name})", (), tuple(_device(profile))),
        Table("Values in a sample", heads, tuple(row if some_have_none else (*row[:5], row[6]) for row in values)),
        Table("On displays", ("name", "kind", "precision"), displays),
        Table("Settings of the device", ("name", "register", "content", "allowed", "writable", ""), settings),
        Table("Sources and notes", (), tuple(_remarks(profile))),
    )
    return [table for table in tables if table.rows]


def _device(profile: Profile) -> Iterator[Row]:
    yield from _places(profile)
    for identity in profile.identify:
        contents = " or ".join(map(_register, identity.holds))
        yield "recognised by", f"{_place(identity.function, identity.register, 1)} holding {contents}"
    yield "framings", ", ".join(profile.framings)
    yield "check (rtu)", _alternatives(profile.checksums)
    yield "one read", f"at most {profile.max_words} registers{_ascii_limit(profile)}{_skipped(profile.may_skip)}"
    yield "one poll", f"reads {_listed([_read(block) for block in profile.reads()])}"
    barrier = profile.barrier
    if barrier is None:
        yield "after no answer", "the line rests for twice the time-out, for no read of another length is known"
    else:
        place = _place(barrier.function, barrier.register, barrier.count)
        yield "after no answer", f"{place} is read first (the barrier)"
    yield from _writes(profile)
    if profile.busy_exceptions:
        yield "busy", f"exception {', '.join(map(_exception, profile.busy_exceptions))}: it is asked again later"
    if profile.min_interval:
        yield "interval", f"at least {duration_text(profile.min_interval)}"
    if profile.request_gap:
        yield "rest", f"{duration_text(profile.request_gap)} between two exchanges"


def _writes(profile: Profile) -> Iterator[Row]:
    if profile.slave_id or profile.baudrate or any(setting.writable for setting in profile.settings):
        yield "writes", f"by function {WRITE_FUNCTIONS[profile.write_function]}"
    if profile.broadcast:
        yield "broadcast", "it obeys writes to slave 0; lfs10d sends none"
    if profile.run_commands:
        yield "never written", f"{', '.join(map(_register, profile.run_commands))}: run commands"


def _places(profile: Profile) -> Iterator[Row]:
    """Yield who makes it, and where it can be: its slave ids and baud rates."""
    if profile.manufacturer is not None:
        yield "manufacturer", profile.manufacturer
    if profile.model is not None:
        yield "model", profile.model
    first, last = profile.ids
    factory = profile.factory
    usual_id = f"; {factory.id} from the factory" if factory else ""
    yield "slave ids", f"{first} to {last}{usual_id}"
    if profile.slave_id is not None:
        yield "", f"set in register {_register(profile.slave_id.register)}{_unless(profile.slave_id.locked_by)}"
    usual_rate = f"; {factory.baudrate} from the factory" if factory else ""
    rate = profile.baudrate
    if rate is not None:
        yield "baud rates", ", ".join(str(rate) for rate in rate.codes) + usual_rate
        codes = ", ".join(f"{code} for {baudrate}" for baudrate, code in rate.codes.items())
        yield "", f"set in register {_register(rate.register)} ({codes}){_unless(rate.locked_by)}"
    else:
        yield "baud rates", f"not known how to set; lfs10d never changes them{usual_rate}"


def _unless(lock: str | None) -> str:
    return f", unless the {lock} overrules it" if lock else ""


def _alternatives(checksums: Row) -> str:
    usual, others = checksums[0], checksums[1:]
    return f"{usual}, or {' or '.join(others)} by a slave's key checksum" if others else usual


def _ascii_limit(profile: Profile) -> str:
    return f", {profile.ascii_max_data} data bytes in ascii" if profile.ascii_max_data else ""


def _skipped(registers: int) -> str:
    return f", and it may span {registers} without a name between two values" if registers else ""


def _exception(code: int) -> str:
    return f"{code:02X} ({EXCEPTION_NAMES[code]})" if code in EXCEPTION_NAMES else f"{code:02X}"


def _register(address: int) -> str:
    return f"0x{address:04X}"


def _span_of_registers(address: int, count: int) -> str:
    return _register(address) if count == 1 else f"{_register(address)}-{_register(address + count - 1)}"


def _place(function: int, address: int, count: int) -> str:
    return READ_FUNCTIONS[function] + _span_of_registers(address, count)


def _read(block: Block) -> str:
    interval = block.values[0].interval
    slow = "" if interval is None else f" (every {duration_text(interval)})"
    return _place(block.function, block.address, block.count) + slow


def _listed(words: Sequence[str]) -> str:
    *others, last = words
    return f"{', '.join(others)} and {last}" if others else last


def _content(value: Value) -> str:
    kind = f"{value.type} of {value.length} registers" if value.length is not None else value.type
    order = {"high_first": "high word first", "low_first": "low word first", None: ""}[value.word_order]
    swapped = "bytes swapped" if value.byte_order == "little" else ""
    return ", ".join(part for part in (kind, order, swapped, _part(value)) if part)


def _part(value: Value) -> str:
    """Return which part of a register is meant, as the file says it; empty for all of it."""
    if value.bits is not None:
        first, last = value.bits
        return f"bit {first}" if first == last else f"bits {first} to {last}"
    if value.mask is not None:
        return f"mask 0x{value.mask:04X}"
    return f"{value.byte} byte" if value.byte is not None else ""


def _number(value: Value) -> str:
    if value.is_text:
        return "true or false" if value.map is None and value.type == "bool" else "text"
    unit = "" if value.unit == "1" else value.unit
    factor = "" if value.scale == 1 else f"x {value.scale:.12g}"
    shift = f"{value.offset:+.12g}" if value.offset else ""
    number = " ".join(part for part in (factor, shift, unit) if part) or "as it is"
    return f"{number}, wraps at {value.modulo:.12g}" if value.modulo is not None else number


def _valid(value: Value) -> str:
    if value.map is not None:
        return ", ".join(f"{content} = {word}" for content, word in value.map.items())
    low, high = value.range or (None, None)
    return span(low, high, value.unit)


def _contents(value: Value) -> str:
    digits = 4 * value.words
    return ", ".join(
        f"{content:g}" if isinstance(content, float) else str(content) if content < 0 else f"0x{content:0{digits}X}"
        for content in value.unavailable
    )


def _decimals(precision: int | None) -> str:
    return "" if precision is None else f"{precision} decimal{'' if precision == 1 else 's'}"


def _status(fact: Fact) -> str:
    return "unverified" if fact.unverified else ""


def _value(value: Value) -> Row:
    often = None if value.interval is None else f"every {duration_text(value.interval)}"
    remarks = ("optional" if value.optional else None, often, _status(value))
    return (
        value.name,
        _place(value.function, value.register, value.words),
        _content(value),
        _number(value),
        _valid(value),
        _contents(value),
        ", ".join(remark for remark in remarks if remark),
    )


def _setting(setting: Setting) -> Row:
    if setting.values is not None:
        allowed = ", ".join(f"{code} = {meaning}" for code, meaning in setting.values.items())
    else:
        low, high = setting.range or (None, None)
        allowed = span(low, high, setting.unit)
    return (
        setting.name,
        _register(setting.register),
        setting.type if setting.scale == 1 else f"{setting.type} x {setting.scale:.12g}",
        allowed,
        "yes" if setting.writable else "no",
        _status(setting),
    )


def _remarks(profile: Profile) -> Iterator[Row]:
    for source in profile.sources:
        yield "document", source
    yield from profile.provenance.items()
    facts: list[tuple[str, Fact | None]] = [
        ("factory", profile.factory),
        ("slave_id", profile.slave_id),
        ("baudrate", profile.baudrate),
        *(("identify", identity) for identity in profile.identify),
        *((value.name, value) for value in profile.values),
        *((setting.name, setting) for setting in profile.settings),
        ("barrier", profile.barrier),
    ]
    for name, fact in facts:
        if fact is not None:
            unverified = "unverified on hardware" if fact.unverified else None
            if fact.source:
                yield name, fact.source + (f" ({unverified})" if unverified else "")
            elif unverified:
                yield name, unverified
            if fact.notes:
                yield name, fact.notes
    for note in profile.notes:
        yield "note", note
