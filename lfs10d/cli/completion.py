"""What a shell completes and a wrong word is called, where click itself does not know what a word is."""

from __future__ import annotations

import click
from click.shell_completion import CompletionItem

from lfs10d.profiles.library import builtin_names

PORT = click.Path(readable=False)
"""Any path, completed as one; whether it can be opened is told in our words."""


class SlaveId(click.IntRange):
    """A slave id, and called one when it is wrong."""

    name = "slave id"

    def __init__(self) -> None:
        super().__init__(1, 255)


def profile_names(context: click.Context, parameter: click.Parameter, incomplete: str) -> list[CompletionItem]:
    """Return the built-in profiles that begin so, or else leave it to the shell: the path of a file."""
    from click.shell_completion import CompletionItem  # noqa: PLC0415  # only when a shell asks

    del context, parameter
    fitting = [CompletionItem(name) for name in builtin_names() if name.startswith(incomplete)]
    return fitting or [CompletionItem(incomplete, type="file")]
