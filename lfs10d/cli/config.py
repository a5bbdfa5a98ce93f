"""`lfs10d config`: prints the effective configuration and the origin of each value."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import click

from lfs10d.cli import EXIT_FAILED, config_option, examples, json_option, print_lines, printing_option, state_option
from lfs10d.cli.effective_file import with_changes
from lfs10d.cli.json_text import json_text
from lfs10d.cli.render.table import columns
from lfs10d.config.changes import Changes
from lfs10d.config.credentials import DENIED
from lfs10d.config.effective import Effective, effective, merged_data
from lfs10d.config.json_schema import json_schema
from lfs10d.config.loader import LoadedConfig, leaves, load
from lfs10d.config.models import Config
from lfs10d.errors import FailedError, StateError
from lfs10d.schema.document import path_text
from lfs10d.schema.fields import Duration, Size
from lfs10d.schema.quantities import duration_text, size_text
from lfs10d.schema.yaml12 import render
from lfs10d.system.logs import escape

EXAMPLES = examples("""
  lfs10d config           every value and its origin
  lfs10d config --merged  YAML to put into the file
  lfs10d config --json    for programs
  lfs10d config --schema  JSON Schema of the file, for editors
""")


def _schema() -> list[str]:
    return [json.dumps(json_schema(), indent=2, ensure_ascii=False)]


@click.command("config", epilog=EXAMPLES)
@config_option
@click.option("--merged", is_flag=True, help="Print YAML to put into the file.")
@printing_option("--schema", "Print the JSON Schema of the file; nothing is read.", _schema)
@state_option
@json_option
def command(config: Path, state_dir: Path | None, *, merged: bool, as_json: bool) -> int:
    """Print the effective configuration, each value with its origin.

    That is the file with the changes that requests made, which the daemon keeps in its state directory. If you may not
    read that, only the file's values are printed, with the reason; exit code 1. Passwords are never shown: the file
    names a file that holds one.
    """
    if merged and as_json:
        raise click.UsageError("--merged prints YAML; leave --json out")
    file = load(config, files=False)
    missing = None
    try:
        now = with_changes(file, state_dir)
    except StateError as error:
        if merged or DENIED not in str(error):
            raise
        now, missing = effective(file, Changes()), str(error)
    if merged:
        _refuse_conflicts(now, config)
        click.echo(render(merged_data(now)), nl=False)
    elif as_json:
        click.echo(json.dumps(_report(now.loaded, missing), indent=2, allow_nan=False))
    else:
        loaded = now.loaded
        rows = [
            (path_text(path), _written(loaded.config, path, value), str(loaded.origins[path_text(path)]))
            for path, value in leaves(loaded.config)
        ]
        print_lines(columns(("key", "value", "origin"), rows))
    print_lines((f"lfs10d: {warning}" for warning in _warnings(now)), err=True)
    if missing is not None:
        click.echo(f"lfs10d: {missing}; the changes made by request are missing here: call it as root", err=True)
        return EXIT_FAILED
    return 0


def _refuse_conflicts(now: Effective, file: Path) -> None:
    """Raise FailedError where no file can express the configuration: two devices would have one slave id."""
    for name, why in now.conflicts.items():
        raise FailedError(f"{file}: no file can express the effective configuration: {name} is not polled, for {why}")


def _warnings(now: Effective) -> Iterator[str]:
    """Yield a warning for each change that no longer fits the file: the daemon will drop it."""
    for lost in now.dropped:
        yield f"{lost.key}: {lost.message}: the change made by request is dropped at the next start or reload"
    for name, why in {**now.suspended, **now.conflicts}.items():
        yield f"{name}: {why}"


def _report(loaded: LoadedConfig, missing: str | None) -> dict[str, Any]:
    """Return the configuration for JSON; `missing` is why the changes by request are not in it."""
    report = {} if missing is None else {"missing": missing}
    return {
        **report,
        "config": loaded.config.model_dump(mode="json"),
        "origins": {path: str(origin) for path, origin in loaded.origins.items()},
    }


def _written(config: Config, path: tuple[str | int, ...], value: object) -> str:
    """Return a value as it is written in the file."""
    kind = _kind(config, path)
    if value is None:
        return "auto" if isinstance(kind, Duration) else "null"
    if isinstance(kind, Duration) and isinstance(value, float):
        return duration_text(value)
    if isinstance(kind, Size) and isinstance(value, int):
        return size_text(value)
    if isinstance(value, dict):
        return json_text({name: entry.model_dump() for name, entry in value.items()})
    return json_text(value) if isinstance(value, bool | tuple) else escape(str(value))


def _kind(config: Config, path: tuple[str | int, ...]) -> object:
    section: Any = config
    for step in path[:-1]:
        section = section[step] if isinstance(step, int) else getattr(section, step)
    metadata = type(section).model_fields[str(path[-1])].metadata
    return next((kind for kind in metadata if isinstance(kind, Duration | Size)), None)
