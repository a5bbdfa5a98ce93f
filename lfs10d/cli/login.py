"""How a verb logs in at the broker: as the configuration says, or with a name and a password of its own."""

from __future__ import annotations

import logging
import secrets
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from lfs10d.configfile import load
from lfs10d.credentials import UnreadableError, password_in
from lfs10d.mqtt.settings import BrokerSettings
from lfs10d.mqtt.topics import Topics
from lfs10d.secret import leave_no_core

if TYPE_CHECKING:
    from collections.abc import Callable

    from lfs10d.config import Config
    from lfs10d.secret import Secret


@dataclass(frozen=True, slots=True)
class Login:
    """Whom a verb visits: the daemon of `config`, by the broker of `settings`; `topics` are those of its line."""

    config: Config
    settings: BrokerSettings
    topics: Topics


def login_options(function: Callable[..., Any]) -> Callable[..., Any]:
    """Add `--username` and `--password-file`, which `login` takes."""
    name = click.option("--username", metavar="NAME", help="Log in with this name, not the file's.")
    password = click.option(
        "--password-file",
        metavar="FILE",
        type=click.Path(path_type=Path, readable=False),  # whether it can be read is told in our words
        help="Its first line is the password, not the file's.",
    )
    return name(password(function))


def login(file: Path, verb: str, *, username: str | None, password_file: Path | None) -> Login:
    """Return whom to visit with a client id of our own; raises ConfigError.

    A name without a password file logs in without a password: that of the configuration belongs to its own name.
    """
    leave_no_core()
    own = username is not None or password_file is not None
    loaded = load(file, files=not own)
    given = None if password_file is None else _password(password_file)
    mqtt = loaded.config.mqtt
    if username is not None:
        mqtt = mqtt.model_copy(update={"username": username})
    elif given is not None and mqtt.username is None:
        raise click.UsageError("--password-file needs a name: give --username")
    settings = BrokerSettings.of(
        mqtt,
        client_id=f"lfs10d-{verb}-{secrets.token_hex(4)}",  # 23 characters are what every broker takes by 3.1.1
        password=(lambda: given) if own else loaded.password,
    )
    # The verb itself tells what a person must know.
    logging.getLogger("lfs10d").addHandler(logging.NullHandler())
    return Login(loaded.config, settings, Topics.of(mqtt.base_topic, loaded.config.line.name))


def _password(file: Path) -> Secret:
    try:
        return password_in(file)
    except UnreadableError as error:
        raise click.BadParameter(str(error), param_hint="'--password-file'") from None
