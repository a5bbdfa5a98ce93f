"""`lfs10d web`: the live page and `/metrics` of one or more lines."""

from __future__ import annotations

import contextlib
import importlib.util
import os
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Final

import click

from lfs10d.cli import ANY_FILE, SERVICE_FILE, event_loop, examples
from lfs10d.cli.login import log_in, login_options
from lfs10d.config.credentials import UnreadableError, password_in
from lfs10d.errors import FailedError
from lfs10d.system.secret import Secret
from lfs10d.web.guard import LONGEST_TOKEN, loopback

CREDENTIAL: Final = "web-token"
"""Name of the systemd credential that holds the token."""
SHORT: Final = 16
"""Characters below which a token is worth a warning."""
NEEDED: Final = ("starlette", "uvicorn")

EXAMPLES = examples("""
  lfs10d web                      the service's line, at http://127.0.0.1:8073
  lfs10d web -c a.yaml -c b.yaml  two lines on one page
  lfs10d web --token-file token --listen 192.168.1.20:8073
                                  for phones in the local network
""")


class ListenAddress(click.ParamType):  # type: ignore[type-arg]  # generic in newer versions of click alone
    """An address and port to listen on: `127.0.0.1:8073`, `[::1]:8073`."""

    name = "address"

    def convert(self, value: object, param: click.Parameter | None, ctx: click.Context | None) -> tuple[str, int]:
        """Return host and port; raises click.BadParameter."""
        if isinstance(value, tuple):
            return value
        found = re.fullmatch(r"(\[[0-9A-Fa-f:.]+\]|[A-Za-z0-9._-]+):(\d{1,5})", str(value))
        if found is None or int(found[2]) >= 2**16:
            self.fail(f"{value!r} is no address with a port; write 127.0.0.1:8073 or [::1]:8073", param, ctx)
        return found[1].strip("[]"), int(found[2])


@click.command("web", epilog=EXAMPLES)
@click.option(
    "-c",
    "--config",
    "configs",
    multiple=True,
    envvar="LFS10D_CONFIG",
    show_envvar=True,
    metavar="FILE",
    type=ANY_FILE,
    help=f"A configuration file; may be given several times.  [default: {SERVICE_FILE}]",
)
@click.argument("more", nargs=-1, metavar="[FILE]...", type=ANY_FILE)
@click.option(
    "--listen",
    type=ListenAddress(),
    default="127.0.0.1:8073",
    help="Address and port to listen on; an address that others can reach needs a token.",
)
@click.option(
    "--token-file",
    metavar="FILE",
    type=ANY_FILE,
    help="File with the token for requests. Default: the systemd credential web-token; without, reading only.",
)
@click.option(
    "--allow-host",
    "names",
    multiple=True,
    metavar="NAME",
    help="Host name that viewers may use for the page, besides this machine's own.",
)
@login_options
def command(  # one for each option
    *,
    configs: tuple[Path, ...],
    more: tuple[Path, ...],
    listen: tuple[str, int],
    token_file: Path | None,
    names: tuple[str, ...],
    username: str | None,
    password_file: Path | None,
) -> int:
    """Serve the live page and /metrics of the lines under the base topics of one or more configurations.

    It is an MQTT client of its own, on any machine; a line of this machine is shown from the daemon's status file
    while the broker is away. With a token viewers can send requests, without one they can only read. Exit code 69 if
    the address is in use.
    """
    missing = [each for each in NEEDED if importlib.util.find_spec(each) is None]
    if missing:
        raise FailedError(f"the page needs {' and '.join(missing)}: install lfs10d[web], as docs/web.md shows")
    token = _token(token_file, os.environ)
    if token is None and not loopback(listen[0]):
        raise click.UsageError(
            f"{listen[0]} is reached by others: give a token (--token-file, or the systemd credential {CREDENTIAL})"
        )
    if token is not None and len(token.reveal()) < SHORT:
        click.echo(f"lfs10d: the token has fewer than {SHORT} characters: it can be guessed", err=True)
    files = (*configs, *more) or (SERVICE_FILE,)
    logins = [
        (file, log_in(file, "web", username=username, password_file=password_file, needed=False)) for file in files
    ]
    from lfs10d.web.server import serve  # noqa: PLC0415  # starlette and uvicorn, which may be missing

    with contextlib.suppress(KeyboardInterrupt):
        event_loop.run(serve(logins, listen, token, names))
    return 0


def _token(file: Path | None, environment: Mapping[str, str]) -> Secret | None:
    """Return the token, None where there is none; raises click.BadParameter where it cannot be read."""
    folder = environment.get("CREDENTIALS_DIRECTORY")
    if file is None and folder and Path(folder, CREDENTIAL).exists():
        file = Path(folder, CREDENTIAL)
    if file is None:
        return None
    try:
        token = Secret(password_in(file).reveal().strip())
    except UnreadableError as error:
        words = str(error).replace("the password", "the token")
        raise click.BadParameter(words, param_hint="'--token-file'") from None
    if not 0 < len(token.reveal()) <= LONGEST_TOKEN or not token.reveal().isprintable():
        raise click.BadParameter(
            f"{file} must hold the token in its first line, at most {LONGEST_TOKEN} characters",
            param_hint="'--token-file'",
        )
    return token
