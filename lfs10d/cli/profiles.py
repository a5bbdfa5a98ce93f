"""`lfs10d profiles`: the device profiles in a list, one explained in tables, both as JSON."""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path

import click

from lfs10d.cli import examples, json_option
from lfs10d.cli.options import profile_names
from lfs10d.cli.render import table
from lfs10d.cli.render.profile_tables import explain
from lfs10d.profiles.library import builtin_names, load_profile
from lfs10d.profiles.profile import Profile

EXAMPLES = examples("""
  lfs10d profiles                       the devices that lfs10d knows
  lfs10d profiles show lfs10            one of them, explained
  lfs10d profiles show ./wind-vane.yaml your own
""")


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
        table.show([_overview(known)])


@command.command("show", short_help="Explain a profile: a built-in one, or a YAML file.", epilog=EXAMPLES)
@click.argument("name", shell_complete=profile_names)
@json_option
def show(name: str, *, as_json: bool) -> None:
    """Explain the profile NAME: a built-in one, or the path of a profile's YAML file."""
    profile = load_profile(name, relative_to=Path())
    if as_json:
        click.echo(json.dumps(profile.model_dump(mode="json", by_alias=True), indent=2))
    else:
        table.show(explain(profile))
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


def _overview(known: Iterable[Profile]) -> table.Table:
    rows = tuple(
        (profile.name, profile.title, ", ".join(profile.value_names), ", ".join(profile.framings), seen(profile))
        for profile in known
    )
    return table.Table("", ("name", "device", "values", "framings", "not verified"), rows)


def seen(profile: Profile) -> str:
    """Return which facts are not verified on hardware or in the source documents; empty if all are."""
    places = {"slave_id": profile.slave_id, "baudrate": profile.baudrate, "barrier": profile.barrier}
    unverified = [value.name for value in profile.values if value.unverified]
    if len(unverified) == len(profile.values):
        unverified = ["all values"]
    return ", ".join([*unverified, *(name for name, fact in places.items() if fact is not None and fact.unverified)])
