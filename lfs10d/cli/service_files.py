"""A service of systemd for one installation: its files, and the calls of systemctl. A thin shell over `unit_file`."""

from __future__ import annotations

import stat
import subprocess
from collections.abc import Sequence
from pathlib import Path

from lfs10d.errors import FailedError
from lfs10d.system.dataclass import dataclass
from lfs10d.system.shipped import shipped
from lfs10d.system.unit_file import for_installation, for_user, is_unchanged, marked

UNITS = ("lfs10d.service", "lfs10d@.service", "lfs10d-web.service")
_HIDDEN = (Path("/home"), Path("/root"), Path("/run/user"))
"""ProtectHome=yes hides them from the service."""


@dataclass(frozen=True, slots=True)
class Installation:
    """Where the program is installed: `prefix` has `bin/lfs10d`, `base` the Python that it runs on."""

    prefix: Path
    base: Path
    version: str

    @property
    def lasting(self) -> Path:
        """The prefix, or a link beside it that points to it: an upgrade lets the link point elsewhere."""
        links = (each for each in sorted(self.prefix.parent.glob("lfs10d*")) if each.is_symlink())
        return next((link for link in links if link.resolve() == self.prefix.resolve()), self.prefix)

    def unit(self, name: str, configurations: Path | None) -> str:
        """Return a unit's text; for a user's services `configurations` is the folder of theirs. Raises FailedError."""
        prefix = self.lasting
        try:
            template = shipped(f"systemd/{name}", self.prefix).read_text(encoding="utf-8")
            text = for_installation(template, prefix / "bin/lfs10d", prefix / "share/doc/lfs10d")
            return marked(text if configurations is None else for_user(text, configurations), self.version)
        except (OSError, ValueError) as error:
            raise FailedError(str(error)) from None

    def obstacle(self) -> str | None:
        """Return why a service of the system could not run this installation; None where it can."""
        for path in (self.prefix / "bin/lfs10d", self.base):
            real = path.resolve()
            for hidden in _HIDDEN:
                if real.is_relative_to(hidden):
                    return f"{real} is below {hidden}, which services do not see"
            for folder in real.parents:
                if not folder.stat().st_mode & stat.S_IXOTH:
                    return f"{folder} is closed to other users, so the service could not run {real}"
        return None


@dataclass(frozen=True, slots=True)
class ServicePlaces:
    """Where units and configurations go, and how systemctl is called."""

    units: Path
    configurations: Path
    systemctl: Sequence[str]
    user: bool = False

    def running_beside_the_main_unit(self) -> list[str]:
        """Return the units of further lines, and of the page, that run. Raises FailedError."""
        words = ("list-units", "--plain", "--no-legend", "--state=active,activating,reloading")
        listed = self.call(*words, "lfs10d@*.service", "lfs10d-web.service")
        return [line.split()[0] for line in listed.splitlines() if line.strip()]

    def call(self, *arguments: str) -> str:
        """Call systemctl and return its output; raises FailedError with what it says."""
        command = [*self.systemctl, *arguments]
        try:
            done = subprocess.run(command, check=False, capture_output=True, text=True)  # noqa: S603  # our own words
        except OSError as error:
            raise FailedError(
                f"{command[0]} cannot be called: {error.strerror}; is this a system with systemd?"
            ) from None
        if done.returncode:
            said = " ".join(done.stderr.split()) or f"exit code {done.returncode}"
            raise FailedError(f"{' '.join(command)}: {said}")
        return done.stdout


def install_units(installation: Installation, places: ServicePlaces) -> list[str]:
    """Write the units that are absent or unchanged by a person, and return what was done as sentences."""
    told = []
    for name in UNITS:
        file = places.units / name
        text = installation.unit(name, places.configurations if places.user else None)
        before = _content(file)
        if before == text:
            told.append(f"{file} is up to date")
        elif before is not None and not is_unchanged(before):
            told.append(f"{file} was changed by hand and is left alone; this version's: lfs10d service print")
        else:
            _write(file, text)
            told.append(f"{file} written")
    return told


def install_sample(file: Path) -> bool:
    """Write the sample configuration where there is no file, and tell whether it was written."""
    if file.exists():
        return False
    try:
        _write(file, shipped("config/lfs10d.sample.yaml").read_text(encoding="utf-8"))
    except FileNotFoundError as error:
        raise FailedError(str(error)) from None
    return True


def remove_units(places: ServicePlaces) -> list[str]:
    """Remove the units that no person changed, and return what was done as sentences."""
    told = []
    for name in UNITS:
        file = places.units / name
        text = _content(file)
        if text is None:
            continue
        if is_unchanged(text):
            file.unlink()
            told.append(f"{file} removed")
        else:
            told.append(f"{file} was changed by hand and is left alone")
    return told


def _content(file: Path) -> str | None:
    try:
        return file.read_text(encoding="utf-8", errors="replace")
    except FileNotFoundError:
        return None
    except OSError as error:
        raise FailedError(f"{file} cannot be read: {error.strerror}") from None


def _write(file: Path, text: str) -> None:
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        new = file.with_name(f".{file.name}.new")
        new.write_text(text, encoding="utf-8")
        new.chmod(0o644)
        new.replace(file)
    except OSError as error:
        raise FailedError(f"{file} cannot be written: {error.strerror}; run it with sudo") from None
