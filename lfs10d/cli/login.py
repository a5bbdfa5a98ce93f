"""How a verb logs in at the broker: with the configuration's login, or with the name and password it is given."""

from __future__ import annotations

import logging
import secrets
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

import click

from lfs10d.cli import ANY_FILE
from lfs10d.config.credentials import DENIED, UnreadableError, password_in, service_password
from lfs10d.config.loader import LoadedConfig, load
from lfs10d.config.models import Config
from lfs10d.daemon.state_directory import service_unit
from lfs10d.errors import ConfigError
from lfs10d.mqtt.settings import BrokerSettings
from lfs10d.mqtt.topics import Topics
from lfs10d.system.dataclass import dataclass
from lfs10d.system.secret import Secret, leave_no_core

REMEDY: Final = "call it as root or as a member of the service's group, or give --username and --password-file"


@dataclass(frozen=True, slots=True)
class Login:
    """The daemon of `config`, reached by the broker of `settings`; `topics` are those of its line."""

    config: Config
    settings: BrokerSettings
    topics: Topics
    missing_password: str = ""
    """Why there is no password where the configuration names a user, in words; empty where there is one."""


def login_options(function: Callable[..., Any]) -> Callable[..., Any]:
    """Add `--username` and `--password-file`, which `log_in` takes."""
    name = click.option("--username", metavar="NAME", help="Log in with this name, not the configuration's.")
    password = click.option(
        "--password-file",
        metavar="FILE",
        type=ANY_FILE,
        help="File whose first line is the password.",
    )
    return name(password(function))


def log_in(file: Path, verb: str, *, username: str | None, password_file: Path | None, needed: bool = True) -> Login:
    """Return the login, with a client id of the verb's own; raises ConfigError.

    A name without a password file logs in without a password: that of the configuration belongs to its own name.
    Otherwise the service's own login is used, as far as the caller may read it: its password file, or the credential
    that systemd hands to it. Where a password file is not `needed`, one that may not be read is left out.
    """
    leave_no_core()
    own = username is not None or password_file is not None
    loaded, missing = _loaded(file, own=own, needed=needed)
    given = None if password_file is None else _password(password_file)
    mqtt = loaded.config.mqtt
    if username is not None:
        mqtt = mqtt.model_copy(update={"username": username})
    elif given is not None and mqtt.username is None:
        raise click.UsageError("--password-file needs a name: give --username")
    known = (given,) if own or missing else None
    if not own and mqtt.username is not None and mqtt.password_file is None and loaded.credential is None:
        found, missing = _service_password(file)
        known = (found,)
    settings = BrokerSettings.of(
        mqtt,
        client_id=f"lfs10d-{verb}-{secrets.token_hex(4)}",  # 23 characters are what every broker takes by 3.1.1
        password=loaded.password if known is None else lambda: known[0],
    )
    # The verb itself reports what a person must know.
    logging.getLogger("lfs10d").addHandler(logging.NullHandler())
    return Login(loaded.config, settings, Topics.of(mqtt.base_topic, loaded.config.line.name), missing)


def _loaded(file: Path, *, own: bool, needed: bool) -> tuple[LoadedConfig, str]:
    """Return the configuration, and why its password file cannot be read; ConfigError if the password is needed."""
    try:
        return load(file, files=not own), ""
    except ConfigError as error:
        denied = [str(each) for each in error.problems if each.path == "mqtt.password_file" and DENIED in each.message]
        if not denied:
            raise
        if needed or len(denied) < len(error.problems):
            click.echo(f"lfs10d: {REMEDY}", err=True)
            raise
        return load(file, files=False), f"{'; '.join(denied)}; {REMEDY}"


def _service_password(file: Path) -> tuple[Secret | None, str]:
    unit = service_unit(file)
    if unit is None:
        return None, ""
    password, why = service_password(unit)
    return password, f"the password of {unit} was not read: {why}; {REMEDY}" if why else ""


def _password(file: Path) -> Secret:
    try:
        return password_in(file)
    except UnreadableError as error:
        raise click.BadParameter(str(error), param_hint="'--password-file'") from None
