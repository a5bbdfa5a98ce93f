"""`lfs10d profiles`: the device profiles in a list, one explained in tables, both as JSON."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path

import click

from lfs10d.cli import json_option
from lfs10d.cli.options import profile_names
from lfs10d.cli.render.profile_tables import Table, explain
from lfs10d.cli.render.table import columns
from lfs10d.profiles.library import builtin_names, load_profile
from lfs10d.profiles.profile import Profile

EXAMPLES = """\b
Examples:
  lfs10d profiles                       the devices that lfs10d knows
  lfs10d profiles show lfs10            one of them, explained
  lfs10d profiles show ./wind-vane.yaml your own
"""


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
    """Return which facts are not verified on hardware or in the source documents; empty if all are."""
    places = {"slave_id": profile.slave_id, "baudrate": profile.baudrate, "barrier": profile.barrier}
    unverified = [value.name for value in profile.values if value.unverified]
    if len(unverified) == len(profile.values):
        unverified = ["all values"]
    return ", ".join([*unverified, *(name for name, fact in places.items() if fact is not None and fact.unverified)])


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
