"""`lfs10d service`: the systemd unit for this installation, installed, printed or removed."""

from __future__ import annotations

import os
import re
import sys
from pathlib import Path
from typing import Any

import click

from lfs10d import __version__
from lfs10d.cli import EXIT_FAILED, SERVICE_FILE, examples, print_lines
from lfs10d.cli.service_files import (
    Installation,
    ServicePlaces,
    install_sample,
    install_units,
    remove_units,
)
from lfs10d.config.loader import load
from lfs10d.errors import ConfigError, FailedError

EXAMPLES = examples("""
  sudo lfs10d service install                  install and start it
  sudo lfs10d service install --instance roof  for /etc/lfs10d/roof.yaml
  lfs10d service print                         print the unit only
  sudo lfs10d service remove                   stop it, remove the units
""")
INSTANCE = re.compile(r"[a-z0-9_-]{1,32}")
SYSTEM_UNITS = Path("/etc/systemd/system")
PACKAGED_UNITS = Path("/usr/lib/systemd/system/lfs10d.service")


def _instance(context: click.Context, parameter: click.Parameter, value: str | None) -> str | None:
    del context
    if value is not None and not INSTANCE.fullmatch(value):
        raise click.BadParameter("must be 1 to 32 of a-z 0-9 _ -, as a line's name is", param=parameter)
    return value


def _options(function: Any) -> Any:  # noqa: ANN401  # click's decorators
    user = click.option("--user", is_flag=True, help="A service of your own, without root; it ends when you log out.")
    instance = click.option(
        "--instance", metavar="NAME", callback=_instance, help="The line of /etc/lfs10d/NAME.yaml: lfs10d@NAME."
    )
    return user(instance(function))


@click.group("service", epilog=EXAMPLES)
def command() -> None:
    """Install, print or remove the systemd unit for this installation."""


@command.command("install", short_help="Write the units, start what is configured.", epilog=EXAMPLES)
@_options
def install(*, user: bool, instance: str | None) -> int:
    """Write the units and a sample configuration, and start the service if it is configured.

    Nothing that a person changed is overwritten. Without --instance other lines and the page are restarted where they
    run, so that after an upgrade all run the new version.
    """
    installation, places = _installation(), _places(user=user)
    if not user:
        _need_root(installation)
        if PACKAGED_UNITS.exists():
            raise FailedError(f"{PACKAGED_UNITS} is there: the Debian package of lfs10d brings its own units")
        if obstacle := installation.obstacle():
            raise FailedError(
                f"{obstacle}; install into /opt/lfs10d (python3 -m venv /opt/lfs10d), or by sudo pipx with "
                "PIPX_HOME=/opt/pipx PIPX_BIN_DIR=/usr/local/bin, or use --user"
            )
    print_lines(install_units(installation, places))
    file = _file(places, instance)
    if install_sample(file):
        click.echo(f"{file} written: a sample")
    places.call("daemon-reload")
    others = places.running_beside_the_main_unit() if instance is None else []
    well = _start(file, _unit(instance), places)
    for other in others:
        click.echo(f"{other} runs too: restarting it ...")
        well = _restarted(other, places) and well
    return 0 if well else EXIT_FAILED


@command.command("print", short_help="Print the unit as it would be written.", epilog=EXAMPLES)
@_options
def print_unit(*, user: bool, instance: str | None) -> int:
    """Print the unit for this installation; nothing is changed."""
    name = "lfs10d.service" if instance is None else "lfs10d@.service"
    places = _places(user=user)
    click.echo(_installation().unit(name, places.configurations if user else None), nl=False)
    return 0


@command.command("remove", short_help="Stop the service, remove the units.", epilog=EXAMPLES)
@_options
def remove(*, user: bool, instance: str | None) -> int:
    """Stop and disable the service, and remove its units; configuration and state stay.

    With --instance only that line's service is stopped and disabled.
    """
    installation, places = _installation(), _places(user=user)
    if not user:
        _need_root(installation)
    if instance is not None:
        places.call("disable", "--now", _unit(instance))
        click.echo(f"{_unit(instance)} stopped and disabled")
        return 0
    wanted = sorted(places.units.glob("*.wants/lfs10d.service")) + sorted(places.units.glob("*.wants/lfs10d@*.service"))
    for unit in sorted({"lfs10d.service", "lfs10d-web.service", *(each.name for each in wanted)}):
        if "@" in unit or (places.units / unit).exists():
            places.call("disable", "--now", unit)
            click.echo(f"{unit} stopped and disabled")
    places.call("stop", "lfs10d@*.service")
    print_lines(remove_units(places) or ["no units of lfs10d service install were found"])
    places.call("daemon-reload")
    click.echo(f"Configuration and state stay: {places.configurations}, {_state(user=user)}")
    return 0


def _start(file: Path, unit: str, places: ServicePlaces) -> bool:
    """Enable and start a unit if its configuration is complete; False where it does not start."""
    try:
        load(file)
    except ConfigError as error:
        manager = "systemctl --user" if places.user else "sudo systemctl"
        click.echo(f"Not started, for the configuration is not complete:\n{error}")
        click.echo(f"Then: {manager} enable --now {unit}")
        return True
    places.call("enable", "--quiet", unit)
    click.echo(f"Starting {unit} ...")
    if not _restarted(unit, places):
        return False
    click.echo(f"{unit} runs. Watch it: lfs10d watch{'' if file == SERVICE_FILE else f' -c {file}'}")
    if places.user:
        click.echo("It ends with your last session, unless: sudo loginctl enable-linger $USER")
    return True


def _restarted(unit: str, places: ServicePlaces) -> bool:
    try:
        places.call("restart", unit)
    except FailedError as error:
        journal = "journalctl --user -u" if places.user else "journalctl -u"
        click.echo(f"lfs10d: {error}\nThe reason: {journal} {unit} -n 20", err=True)
        return False
    return True


def _installation() -> Installation:
    return Installation(Path(sys.prefix), Path(sys.base_prefix), __version__)


def _places(*, user: bool) -> ServicePlaces:
    if not user:
        return ServicePlaces(SYSTEM_UNITS, SERVICE_FILE.parent, ("systemctl",))
    home = Path(os.environ.get("XDG_CONFIG_HOME") or Path.home() / ".config")
    return ServicePlaces(home / "systemd/user", home / "lfs10d", ("systemctl", "--user"), user=True)


def _need_root(installation: Installation) -> None:
    if os.geteuid() != 0:
        raise FailedError(
            f"a service of the system needs root: sudo {installation.prefix / 'bin/lfs10d'} {' '.join(sys.argv[1:])}"
        )


def _file(places: ServicePlaces, instance: str | None) -> Path:
    return places.configurations / f"{instance or SERVICE_FILE.stem}.yaml"


def _unit(instance: str | None) -> str:
    return "lfs10d.service" if instance is None else f"lfs10d@{instance}.service"


def _state(*, user: bool) -> str:
    return "~/.local/state/lfs10d" if user else "/var/lib/lfs10d*"
