"""`lfs10d request`: sends a request to the running daemon and shows its response."""

from __future__ import annotations

import asyncio
import json
import re
import secrets
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import click
from pydantic import ValidationError

from lfs10d.cli import (
    EXIT_FAILED,
    config_option,
    event_loop,
    examples,
    json_option,
    print_lines,
    printing_option,
    request_words,
    requested_scan,
)
from lfs10d.cli.adopt_loop import AdoptLoop
from lfs10d.cli.adopt_repeat import ADOPT, repeat
from lfs10d.cli.client import RETAINED_WITHIN, CommandClient, at_daemon, parsed
from lfs10d.cli.json_text import json_text
from lfs10d.cli.login import Login, log_in, login_options
from lfs10d.cli.options import DurationType
from lfs10d.cli.render.live_lines import health
from lfs10d.cli.render.response import content_lines, status_line
from lfs10d.cli.render.spinner import spinning
from lfs10d.cli.requested_scan import SCAN
from lfs10d.commands.handlers.registry import HANDLERS
from lfs10d.commands.message import LARGEST, Parameters
from lfs10d.config.loader import load
from lfs10d.errors import ConfigError, FailedError
from lfs10d.mqtt.messages import Filter
from lfs10d.profiles.library import builtin_names
from lfs10d.schema.fields import Name
from lfs10d.schema.quantities import duration_text
from lfs10d.system.dataclass import dataclass
from lfs10d.telemetry.publication import DEVICES

USUAL_TIMEOUT = 10.0
"""Seconds to wait for the response without --timeout."""
UNLIMITED = frozenset({"line/scan", "line/baudrate", "line/adopt", "device/readdress"})
"""Requests without a time limit: scans and changes of sensors."""

IDS = ("id", "transaction")
"""Parameters that are text even if they look like a number."""
_HEXADECIMAL = re.compile(r"0x[0-9A-Fa-f]{1,8}")
_LEADING_ZEROS = re.compile(r"0[0-9]{1,19}")

EXAMPLES = examples("""
  lfs10d request --list                       all requests and parameters
  lfs10d request device/options --help        what one of them takes
  lfs10d request health                       how daemon, line and sensors are
  lfs10d request device/read device=mast-top  poll one sensor now
  lfs10d request line/trace for=1m            a minute of frames, on a topic
  lfs10d request line/adopt --repeat          adopt one sensor after the other
  lfs10d request config/reload -c site.yaml   another daemon reads its file
  lfs10d request device/read device=2 --json  the response as JSON
""")


def _name(context: click.Context, parameter: click.Parameter, value: str) -> str:
    levels = value.split("/")
    if not value.isprintable() or "+" in value or "#" in value or "" in levels:
        known = ", ".join(sorted(HANDLERS))
        raise click.BadParameter(f"{value!r} is not a request; known are: {known}", context, parameter)
    return value


def _complete(context: click.Context, parameter: click.Parameter, incomplete: str) -> list[str]:
    del context, parameter
    return [name for name in sorted(HANDLERS) if name.startswith(incomplete)]


def _complete_parameter(context: click.Context, parameter: click.Parameter, incomplete: str) -> list[str]:
    del parameter
    name, given = context.params.get("name") or "", context.params.get("parameters") or ()
    known = {"device": configured_devices(context.params.get("config")), "profile": builtin_names()}
    return request_words.completions(name, given, incomplete, known)


def configured_devices(file: object) -> tuple[str, ...]:
    """Return the names of the devices in a configuration file; none where it cannot be read."""
    try:
        return tuple(slave.name for slave in load(Path(str(file)), files=False).config.slaves)
    except ConfigError:
        return ()


class _Command(click.Command):
    """Shows the help of a request that is named beside `--help`, which click handles first."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Parse what was typed."""
        ctx.meta[__name__] = next((word for word in args if word in HANDLERS), None)
        return super().parse_args(ctx, args)

    def format_help(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the help of the request that was named, or of the verb."""
        name = ctx.meta.get(__name__)
        if name is None:
            super().format_help(ctx, formatter)
        else:
            formatter.write("\n".join(request_words.help_of(name)) + "\n")


@click.command("request", cls=_Command, epilog=EXAMPLES)
@click.argument("name", callback=_name, shell_complete=_complete)
@click.argument("parameters", nargs=-1, metavar="[KEY=VALUE]...", shell_complete=_complete_parameter)
@printing_option("--list", "Print every request with its parameters.", request_words.listing)
@config_option
@click.option(
    "--timeout",
    type=DurationType("500ms or 10s"),
    help=f"Longest wait for the response: {duration_text(USUAL_TIMEOUT)}; none for scans and changes of sensors.",
)
@click.option(
    "--repeat",
    is_flag=True,
    help="With line/adopt: one sensor after the other, until Ctrl-C; name=NAME,NAME,... gives each its name.",
)
@login_options
@json_option
def command(**values: Any) -> int:  # noqa: ANN401  # nine options; `_RequestOptions` names and types them
    """Send the request NAME to the running daemon; print its response.

    NAME is for example device/read: --list prints all requests, NAME --help the parameters of one. A VALUE is text, a
    number, true, a duration or JSON, as the parameter requires; a device may be given by its slave id. Exit code 0 if
    it was carried out, 1 if not or if no response came in time, 69 if the broker or the daemon is away.
    """
    options = _RequestOptions(**values)
    if options.repeat:
        loop = options.adopt_loop
        login = log_in(options.config, "adopt", username=options.username, password_file=options.password_file)
        return event_loop.run(repeat(login, loop, as_json=options.as_json))
    content = options.content
    login = log_in(options.config, "request", username=options.username, password_file=options.password_file)
    if options.name == SCAN:
        work = requested_scan.scan(login, content, options.time_limit, quiet=options.as_json)
    else:
        work = _ask(options, login, content)
    return show(options.name, event_loop.run(work), as_json=options.as_json)


def show(name: str, response: Mapping[str, Any], *, as_json: bool) -> int:
    """Print the response to a request; return the exit code."""
    done = response.get("status") == "ok"
    if as_json:
        click.echo(json_text(response, indent=2))
    else:
        click.echo(status_line(response), err=not done)
        data = response.get("data")
        if name == SCAN:
            requested_scan.show(response)
        elif name == "health" and isinstance(data, dict):
            print_lines(health(data))
        else:
            print_lines(content_lines(response))
    return 0 if done else EXIT_FAILED


@dataclass(frozen=True, slots=True)
class _RequestOptions:
    """The options as given; `timeout` in s."""

    name: str
    parameters: tuple[str, ...]
    config: Path
    timeout: float | None
    username: str | None
    password_file: Path | None
    as_json: bool
    repeat: bool

    @property
    def adopt_loop(self) -> AdoptLoop:
        """The loop for `--repeat`."""
        if self.name != ADOPT:
            raise click.UsageError(f"--repeat goes with {ADOPT} alone")
        if self.timeout is not None:
            raise click.UsageError("--repeat has no --timeout: it goes on until Ctrl-C")
        names: list[str] = []
        others: list[str] = []
        for parameter in self.parameters:
            key, _, value = parameter.partition("=")
            if key == "name":
                names += value.split(",")
            elif key in (*IDS, "to"):
                raise click.UsageError(f"{key} cannot be the same for every sensor: leave it out with --repeat")
            else:
                others.append(parameter)
        wrong = next((name for name in names if not Name.pattern.fullmatch(name)), None)
        if wrong is not None:
            raise click.UsageError(f"name: {wrong!r} is not {Name().words}")
        if len(set(names)) < len(names):
            raise click.UsageError("a name is given twice; each sensor needs a name of its own")
        return AdoptLoop(names, self._parsed(others))

    @property
    def time_limit(self) -> float | None:
        """How long to wait for the response in s; None: until it comes."""
        if self.timeout is not None or self.name in UNLIMITED:
            return self.timeout
        return USUAL_TIMEOUT

    @property
    def content(self) -> dict[str, Any]:
        """The payload; it has an id, by which a daemon that speaks 3.1.1 is understood."""
        content = self._parsed(self.parameters)
        if not any(content.get(key) for key in IDS):
            content["id"] = secrets.token_hex(6)
        if len(json.dumps(content).encode()) > LARGEST:
            raise click.UsageError(f"these parameters are more than the {LARGEST} bytes that a request may have")
        return content

    def _parsed(self, parameters: Sequence[str]) -> dict[str, Any]:
        known = HANDLERS.get(self.name)
        return content_of(parameters, None if known is None else known.spec.parameters)


async def _ask(options: _RequestOptions, login: Login, content: dict[str, Any]) -> dict[str, Any]:
    devices: list[object] = []
    by_id = request_words.is_slave_id(content.get("device"))
    filters = [Filter(login.topics.full(DEVICES), qos=0, retain_as_published=False)] if by_id else []
    client = CommandClient(login, filters, lambda message: devices.append(parsed(message.payload)))
    try:
        async with spinning(f"{options.name} ..."), at_daemon(client):
            if by_id:
                await client.wait_until(lambda: bool(devices), RETAINED_WITHIN)
                device = request_words.named_device(content["device"], devices[-1] if devices else None)
                content = {**content, "device": device}
            response = await client.request(options.name, content, options.time_limit)
    except asyncio.CancelledError:  # Ctrl-C, SIGTERM
        if client.request_sent:
            click.echo(f"lfs10d: {options.name} was sent; this does not cancel it", err=True)
        raise
    if response is None:
        message = f"no response to {options.name} within {duration_text(options.time_limit or 0)}"
        raise FailedError(f"{message}; it may or may not have been carried out")
    return response


# What is typed as the parameters of a request


class KeyValueError(click.UsageError):
    """An argument is no `KEY=VALUE`, or its key came before."""


def content_of(arguments: Iterable[str], form: type[Parameters] | None) -> dict[str, Any]:
    """Return the parameters given by the arguments; `form` is None for an unknown request.

    What no reading of a value makes right is passed on as it is: the daemon says what is wrong with it.
    """
    content: dict[str, Any] = {}
    for argument in arguments:
        key, equals, text = argument.partition("=")
        if not key or not equals:
            raise KeyValueError(f"{argument!r} is not KEY=VALUE; write device=mast-top for example")
        if key in content:
            raise KeyValueError(f"{key} is given twice")
        content[key] = text if key in IDS else _value(key, text, form)
    return content


def _value(key: str, text: str, form: type[Parameters] | None) -> Any:  # noqa: ANN401  # any JSON
    readings = list(_readings(text))
    if form is not None:
        return next((value for value in (*readings, _items(text)) if _fits(key, value, form)), readings[-1])
    return readings[-1]


def _items(text: str) -> list[Any]:
    """Return text with commas as a list."""
    return [list(_readings(item.strip()))[-1] for item in text.split(",")]


def _readings(text: str) -> Iterator[Any]:
    """Yield the possible values of a text: null, the text itself, a number as in YAML, JSON; the last if none fits."""
    if text == "null":
        yield None
    yield text
    if _HEXADECIMAL.fullmatch(text):  # as registers are written in manuals and profiles
        yield int(text, 16)
    if _LEADING_ZEROS.fullmatch(text):
        yield int(text)
    try:
        yield json.loads(text, parse_constant=_refuse)
    except (ValueError, RecursionError):
        return


def _refuse(constant: str) -> None:
    raise ValueError(constant)  # NaN and Infinity are no JSON


def _fits(key: str, value: object, form: type[Parameters]) -> bool:
    try:
        form.model_validate({key: value})
    except ValidationError as error:
        return all(detail["loc"][:1] != (key,) for detail in error.errors(include_url=False))
    return True
