"""`python -m docs.generate.manual`: the manual page, made from what every verb says of itself by --help."""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Iterator
from datetime import UTC, date, datetime

import click

from lfs10d import __version__
from lfs10d.cli import lfs10d


def escaped(text: str) -> str:
    """Return text as roff takes it literally: a leading dot or quote begins a request."""
    text = text.replace("\\", "\\e").replace("-", "\\-")
    return re.sub(r"^([.'])", r"\\&\1", text, flags=re.MULTILINE)


def page(built: date) -> Iterator[str]:
    """Yield the lines of lfs10d(1)."""
    yield f'.TH LFS10D 1 {built} "lfs10d {__version__}" "User Commands"'
    yield ".SH NAME"
    yield "lfs10d \\- RS485 (Modbus RTU) wind sensors to MQTT"
    yield ".SH SYNOPSIS"
    yield ".B lfs10d\n.I VERB\n[\\fIOPTIONS\\fR]"
    yield ".SH DESCRIPTION"
    yield from help_of(lfs10d, "lfs10d", [])
    for words, command in verbs():
        yield f'.SS "lfs10d {" ".join(words)}"'
        yield from help_of(command, "lfs10d", words)
    yield ".SH FILES"
    for file, meaning in (
        ("/etc/lfs10d/lfs10d.yaml", "The configuration; one more file beside it for each further line."),
        ("/var/lib/lfs10d", "The state: what requests changed, the journal of changes, the backlog."),
        ("/run/lfs10d/status.json", "What the daemon shows while the broker is away."),
    ):
        yield f".TP\n.I {escaped(file)}\n{escaped(meaning)}"
    yield ".SH EXIT STATUS"
    yield escaped(
        "0 done; 1 the thing asked for failed; 2 usage; 69 broker or port not reachable, or busy; "
        "78 configuration error."
    )
    yield ".SH SEE ALSO"
    yield ".I /usr/share/doc/lfs10d"


def verbs() -> Iterator[tuple[list[str], click.Command]]:
    """Yield each verb, and behind it the verbs it has itself."""
    context = click.Context(lfs10d)
    for verb in lfs10d.list_commands(context):
        command = lfs10d.get_command(context, verb)
        assert command is not None  # noqa: S101  # it was listed
        yield [verb], command
        if isinstance(command, click.Group):
            for inner in command.list_commands(context):
                yield [verb, inner], command.commands[inner]


def help_of(command: click.Command, program: str, words: list[str]) -> Iterator[str]:
    """Yield the help of a command as it stands, in a block that is not filled."""
    context = click.Context(command, info_name=" ".join([program, *words]), terminal_width=72, max_content_width=72)
    yield f".nf\n{escaped(command.get_help(context))}\n.fi"


if __name__ == "__main__":
    seconds = int(os.environ.get("SOURCE_DATE_EPOCH", "0"))
    sys.stdout.write("\n".join(page(datetime.fromtimestamp(seconds, UTC).date())) + "\n")
