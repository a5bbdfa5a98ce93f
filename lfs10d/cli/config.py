"""`lfs10d config`: what is in force, and where each value comes from."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import click

from lfs10d.cli import config_option, json_option
from lfs10d.cli.columns import columns
from lfs10d.config import Config, Section
from lfs10d.configfile import Loaded, leaves, load
from lfs10d.coreschema import render
from lfs10d.document import path_text
from lfs10d.kinds import Duration, Size
from lfs10d.quantities import duration_text, size_text

if TYPE_CHECKING:
    from pathlib import Path

EXAMPLES = """\b
Examples:
  lfs10d config                      every value and its origin
  lfs10d config --merged             YAML to put into the file
  lfs10d config --json               for programs
"""


@click.command("config", epilog=EXAMPLES)
@config_option
@click.option("--merged", is_flag=True, help="Print YAML to put into the file.")
@json_option
def command(config: Path, *, merged: bool, as_json: bool) -> int:
    """Print the effective configuration, each value with its origin.

    Passwords are never shown: the file names a file that holds one.
    """
    if merged and as_json:
        raise click.UsageError("--merged prints YAML; leave --json out")
    loaded = load(config, files=False)
    if merged:
        click.echo(render(loaded.document.data), nl=False)
    elif as_json:
        click.echo(json.dumps(_report(loaded), indent=2, allow_nan=False))
    else:
        rows = [
            (path_text(path), _written(loaded.config, path, value), str(loaded.origins[path_text(path)]))
            for path, value in leaves(loaded.config)
        ]
        for text in columns(("key", "value", "origin"), rows):
            click.echo(text)
    return 0


def _report(loaded: Loaded) -> dict[str, Any]:
    return {
        "config": loaded.config.model_dump(mode="json"),
        "origins": {path: str(origin) for path, origin in loaded.origins.items()},
    }


def _written(config: Config, path: tuple[str | int, ...], value: object) -> str:
    """Return a value as one would write it into the file."""
    kind = _kind(config, path)
    if value is None:
        return "auto" if isinstance(kind, Duration) else "null"
    if isinstance(kind, Duration) and isinstance(value, float):
        return duration_text(value)
    if isinstance(kind, Size) and isinstance(value, int):
        return size_text(value)
    return json.dumps(value, ensure_ascii=False) if isinstance(value, bool | tuple) else str(value)


def _kind(config: Config, path: tuple[str | int, ...]) -> object:
    section: Any = config
    for step in path[:-1]:
        section = section[step] if isinstance(step, int) else getattr(section, step)
    if not isinstance(section, Section):
        return None
    metadata = type(section).model_fields[str(path[-1])].metadata
    return next((kind for kind in metadata if isinstance(kind, Duration | Size)), None)
