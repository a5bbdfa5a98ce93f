"""`lfs10d profiles`: the device profiles in a list, one explained in tables, both as JSON."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TypeAlias

import click

from lfs10d.cli import json_option
from lfs10d.cli.options import profile_names
from lfs10d.cli.render.table import columns
from lfs10d.profiles.facts import Fact
from lfs10d.profiles.library import builtin_names, load_profile
from lfs10d.profiles.profile import Profile
from lfs10d.profiles.registers import span
from lfs10d.profiles.settings import Setting
from lfs10d.profiles.values import Value

Row: TypeAlias = tuple[str, ...]

EXAMPLES = """\b
Examples:
  lfs10d profiles                       the devices that lfs10d knows
  lfs10d profiles show lfs10            one of them, explained
  lfs10d profiles show ./wind-vane.yaml your own
"""

READ_FUNCTIONS = {1: "coil ", 2: "discrete input ", 3: "", 4: "input "}
"""Function 03 reads holding registers, the usual ones; 04 reads input registers, 01 and 02 bits."""


@dataclass(frozen=True, slots=True)
class Table:
    """A titled table of text; `heads` is empty where the first column names the row."""

    title: str
    heads: Row
    rows: tuple[Row, ...]


@click.group("profiles", invoke_without_command=True, epilog=EXAMPLES)
@json_option
@click.pass_context
def command(context: click.Context, *, as_json: bool) -> None:
    """List the device profiles that come with lfs10d, or explain one."""
    if context.invoked_subcommand is not None:
        if as_json:
            raise click.UsageError(f"write --json behind {context.invoked_subcommand}")
        return
    known = [load_profile(name, relative_to=Path()) for name in builtin_names()]
    if as_json:
        click.echo(json.dumps([_entry(profile) for profile in known], indent=2))
    else:
        _draw([_overview(known)])


@command.command("show", short_help="Explain a profile: a built-in one, or a YAML file.", epilog=EXAMPLES)
@click.argument("name", shell_complete=profile_names)
@json_option
def show(name: str, *, as_json: bool) -> None:
    """Explain the profile NAME: a built-in one, or the path of a profile's YAML file."""
    profile = load_profile(name, relative_to=Path())
    if as_json:
        click.echo(json.dumps(profile.model_dump(mode="json", by_alias=True), indent=2))
    else:
        _draw(explain(profile))
    for doubt in profile.doubts():
        click.echo(f"lfs10d: warning: {doubt}", err=True)


def _entry(profile: Profile) -> dict[str, object]:
    return {
        "name": profile.name,
        "title": profile.title,
        "values": list(profile.value_names),
        "units": profile.units,
        "framings": list(profile.framings),
        "unverified": seen(profile),
    }


def _overview(known: Iterable[Profile]) -> Table:
    rows = tuple(
        (profile.name, profile.title, ", ".join(profile.value_names), ", ".join(profile.framings), seen(profile))
        for profile in known
    )
    return Table("", ("name", "device", "values", "framings", "not verified"), rows)


def seen(profile: Profile) -> str:
    """Return which facts nobody has seen on hardware or in the source documents; empty where there are none."""
    places = {"slave_id": profile.slave_id, "baudrate": profile.baudrate, "barrier": profile.barrier}
    unverified = [value.name for value in profile.values if value.unverified]
    if len(unverified) == len(profile.values):
        unverified = ["all values"]
    return ", ".join([*unverified, *(name for name, fact in places.items() if fact is not None and fact.unverified)])


def explain(profile: Profile) -> list[Table]:
    """Return the profile as tables for a person who has never seen a register list."""
    tables = [
        Table(f"{profile.title} (profile {profile.name})", (), tuple(_device(profile))),
        Table(
            "Values in a sample",
            ("name", "registers", "content", "number", "believed", ""),
            tuple(_value(value) for value in profile.values),
        ),
    ]
    if profile.settings:
        tables.append(
            Table(
                "Settings of the device",
                ("name", "register", "content", "allowed", "writable", ""),
                tuple(_setting(setting) for setting in profile.settings),
            )
        )
    remarks = tuple(_remarks(profile))
    if remarks:
        tables.append(Table("Sources and notes", (), remarks))
    return tables


def _device(profile: Profile) -> Iterator[Row]:
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
    yield "framings", ", ".join(profile.framings)
    yield "check of rtu", _alternatives(profile.checksums)
    yield "one read", f"at most {profile.max_words} registers{_ascii_limit(profile)}"
    reads = [_span_of_registers(block.address, block.count) for block in profile.reads()]
    yield "one poll", f"reads {' and '.join(reads)}"
    barrier = profile.barrier
    if barrier is None:
        yield "after silence", "the line rests for twice the time-out, for no read of another length is known"
    else:
        yield "after silence", f"{_span_of_registers(barrier.register, barrier.count)} is read first (the barrier)"
    if profile.run_commands:
        yield "never written", f"{', '.join(map(_register, profile.run_commands))}: run commands"
    if profile.min_interval:
        yield "interval", f"at least {profile.min_interval:g} s"
    if profile.request_gap:
        yield "rest", f"{profile.request_gap:g} s between two exchanges"


def _unless(lock: str | None) -> str:
    return f", unless the {lock} overrules it" if lock else ""


def _alternatives(checksums: Row) -> str:
    usual, others = checksums[0], checksums[1:]
    return f"{usual}, or {' or '.join(others)} by a slave's key checksum" if others else usual


def _ascii_limit(profile: Profile) -> str:
    return f", {profile.ascii_max_data} data bytes in ascii" if profile.ascii_max_data else ""


def _register(address: int) -> str:
    return f"0x{address:04X}"


def _span_of_registers(address: int, count: int) -> str:
    return _register(address) if count == 1 else f"{_register(address)}-{_register(address + count - 1)}"


def _content(value: Value) -> str:
    order = {"high_first": ", high word first", "low_first": ", low word first", None: ""}[value.word_order]
    return f"{value.type}{order}{', bytes swapped' if value.byte_order == 'little' else ''}"


def _number(scale: float, offset: float, unit: str) -> str:
    unit = "" if unit == "1" else unit
    factor = "" if scale == 1 else f"x {scale:.12g}"
    shift = f"{offset:+.12g}" if offset else ""
    return " ".join(part for part in (factor, shift, unit) if part) or "as it is"


def _status(fact: Fact) -> str:
    return "unverified" if fact.unverified else ""


def _value(value: Value) -> Row:
    low, high = value.range or (None, None)
    return (
        value.name,
        READ_FUNCTIONS[value.function] + _span_of_registers(value.register, value.words),
        _content(value),
        _number(value.scale, value.offset, value.unit),
        span(low, high, value.unit),
        _status(value),
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
        *((value.name, value) for value in profile.values),
        *((setting.name, setting) for setting in profile.settings),
        ("barrier", profile.barrier),
    ]
    for name, fact in facts:
        if fact is not None:
            if fact.source:
                yield name, fact.source + (" (unverified on hardware)" if fact.unverified else "")
            if fact.notes:
                yield name, fact.notes
    for note in profile.notes:
        yield "note", note


def _draw(tables: list[Table]) -> None:
    if sys.stdout.isatty():
        _draw_on_terminal(tables)
    else:
        click.echo("\n\n".join("\n".join(_lines(table)) for table in tables))


def _lines(table: Table) -> Iterator[str]:
    if table.title:
        yield table.title
    heads, *rows = (table.heads, *table.rows) if table.heads else table.rows
    indent = "  " if table.title else ""
    for line in columns(heads, rows):
        yield indent + line


def _draw_on_terminal(tables: list[Table]) -> None:
    # Only a terminal needs rich; importing it takes longer than the rest of the verb.
    from rich import box  # noqa: PLC0415 - for a terminal only
    from rich.console import Console  # noqa: PLC0415 - for a terminal only
    from rich.table import Table as Drawing  # noqa: PLC0415 - for a terminal only
    from rich.text import Text  # noqa: PLC0415 - for a terminal only

    console = Console()
    for number, table in enumerate(tables):
        if number:
            console.print()
        drawing = Drawing(
            title=Text(table.title, style="bold") if table.title else None,
            title_justify="left",
            box=box.SIMPLE_HEAD if table.heads else None,
            pad_edge=False,
            show_header=bool(table.heads),
        )
        name, *others = table.heads or ("", "")
        drawing.add_column(name, style="cyan", no_wrap=True)
        for head in others:
            drawing.add_column(head, no_wrap=head.startswith("register"))
        for row in table.rows:
            drawing.add_row(*(Text(cell) for cell in row))
        console.print(drawing)
