"""Options that several verbs share: kinds of arguments, the line's parameters, completion of profiles."""

from __future__ import annotations

import re
from collections.abc import Callable
from math import inf
from typing import Any

import click

from lfs10d.line.jobs.scan_ids import ids_of
from lfs10d.modbus.frames import Framing
from lfs10d.modbus.port_settings import PARITIES, PortSettings
from lfs10d.modbus.timing import LineTiming
from lfs10d.profiles.library import builtin_names
from lfs10d.schema.quantities import BAUDRATES, duration_text, seconds
from lfs10d.system.dataclass import dataclass

_NUMBER = re.compile(r"[0-9]{1,15}(\.[0-9]{1,20})?")

# What an argument may be

PORT = click.Path(readable=False)
"""A path, completed as one; the verb reports whether it can be opened."""


class SlaveId(click.IntRange):
    """A slave id; its errors say so."""

    name = "slave id"

    def __init__(self) -> None:
        super().__init__(1, 255)


class DurationType(click.ParamType):  # type: ignore[type-arg]  # generic in newer versions of click alone
    """A duration such as 200ms or a number of s, in s.

    `example` is what to write, `least` and `most` are the limits in s.
    """

    name = "duration"

    def __init__(self, example: str, least: float = 0.0, most: float = inf) -> None:
        self._example, self._least, self._most = example, least, most

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:  # noqa: ANN401  # click's
        """Return the seconds; raises click.BadParameter."""
        text = str(value)
        try:
            duration = seconds(float(text) if _NUMBER.fullmatch(text) else text)
        except ValueError:
            self.fail(f"{value!r} is not a duration; write {self._example}", param, ctx)
        if not self._least <= duration <= self._most:
            least = duration_text(self._least)
            limits = f"{least} or more" if self._most == inf else f"from {least} to {duration_text(self._most)}"
            self.fail(f"must be {limits}", param, ctx)
        return duration


# How the characters on the line look

FRAMING = click.option("--framing", type=click.Choice(["rtu", "ascii"]), default="rtu", help="How bytes become frames.")
STOPBITS = click.option("--stopbits", type=click.Choice(["1", "2"]), default="1", help="Stop bits per character.")
PARITY = click.option("--parity", type=click.Choice([*PARITIES]), default="none", help="Parity bit.")


@dataclass(frozen=True, slots=True)
class LineOptions:
    """How the characters on the line look; `timeout` in s, None: the verb's own."""

    port: str
    parity: str
    databits: int
    stopbits: int
    framing: Framing
    timeout: float | None

    def settings(self, baudrate: int) -> PortSettings:
        """Return the settings of the port."""
        return PortSettings(self.port, baudrate, self.parity, self.databits, self.stopbits)

    def timing(self, baudrate: int) -> LineTiming:
        """Return the times at a rate."""
        return LineTiming.of(baudrate, databits=self.databits, parity=self.parity, stopbits=self.stopbits)

    @property
    def character(self) -> str:
        """The usual short word for it: `8N1`, `8E1`."""
        return f"{self.databits}{self.parity[0].upper()}{self.stopbits}"


def take(options: dict[str, Any]) -> LineOptions:
    """Remove from a command's parameters what `line_options` added, and return it."""
    framing = Framing(options.pop("framing"))
    databits = options.pop("databits")
    if framing is Framing.RTU and databits == "7":
        raise click.BadParameter("rtu frames need 8 data bits", param_hint="'--databits'")
    usual = "8" if framing is Framing.RTU else "7"
    return LineOptions(
        port=options.pop("port"),
        parity=options.pop("parity"),
        databits=int(databits or usual),
        stopbits=int(options.pop("stopbits")),
        framing=framing,
        timeout=options.pop("timeout"),
    )


def id_list(context: click.Context, parameter: click.Parameter, value: str) -> tuple[int, ...]:
    """Return the ids of text such as 1-8,12: the callback of an option; raises click.BadParameter."""
    try:
        return ids_of(value)
    except ValueError as error:
        raise click.BadParameter(str(error), context, parameter) from error


def baudrate(context: click.Context, parameter: click.Parameter, value: str) -> int:
    """Return the rate that a text names: the callback of an option; raises click.BadParameter."""
    text = value.strip()
    if text not in map(str, BAUDRATES):
        raise click.BadParameter(f"{text!r} is not one of {', '.join(map(str, BAUDRATES))}", context, parameter)
    return int(text)


def line_options(function: Callable[..., Any]) -> Callable[..., Any]:
    """Add the options of the line to a command that has the argument `port`; `take` returns them as one value."""
    for option in (
        click.option(
            "--timeout", type=DurationType("200ms or 1s", 0.01, 10.0), help="How long to wait for each reply."
        ),
        FRAMING,
        STOPBITS,
        click.option(
            "--databits", type=click.Choice(["8", "7"]), help="Data bits per character.  [default: 8; 7 with ascii]"
        ),
        PARITY,
    ):
        function = option(function)
    return function


# What a shell completes


def profile_names(context: click.Context, parameter: click.Parameter, incomplete: str) -> list[Any]:
    """Return the built-in profiles that begin so, or else leave it to the shell to complete a file's path."""
    fitting = [name for name in builtin_names() if name.startswith(incomplete)]
    return fitting or click.Path().shell_complete(context, parameter, incomplete)
