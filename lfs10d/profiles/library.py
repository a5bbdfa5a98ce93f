"""Finds profiles: the built-in files of this package, and a user's own by path."""

from __future__ import annotations

from functools import cache
from pathlib import Path

from pydantic import ValidationError

from lfs10d.errors import ConfigError, Problem
from lfs10d.profiles.profile import Profile
from lfs10d.schema import document
from lfs10d.schema.fields import quoted
from lfs10d.system.regular_file import read_regular

BUILTIN_NAMES = (
    "lfs10",
    "ld-e",
    "fuling-dzb",
    "eh600",
    "ecowitt-wn90lp",
    "renke-rs-fxjt",
    "renke-rs-fsjt",
    "pr-3000-fsjt",
    "dfrobot-sen0482",
    "dfrobot-sen0483",
)
"""The profiles that come with lfs10d, the first being a slave's default."""


def builtin_names() -> tuple[str, ...]:
    """Return the names of the built-in profiles."""
    return BUILTIN_NAMES


def load_profile(name_or_path: str, *, relative_to: Path) -> Profile:
    """Return a built-in profile by name, or the one in a YAML file (a path, relative to a folder).

    Raises ConfigError with every problem of the file, each with its line and column; with one at 1:1 where
    there is no such file.
    """
    if name_or_path in BUILTIN_NAMES:
        return _load_builtin(name_or_path)
    path = relative_to / name_or_path
    return parse_profile(_read(path, name_or_path), str(path))


@cache
def _load_builtin(name: str) -> Profile:
    # Beside this module, and not by importlib.resources, whose import costs 20 ms and a megabyte.
    file = Path(__file__).with_name(f"{name}.yaml")
    return parse_profile(file.read_text(encoding="utf-8"), file.name)


def _read(path: Path, wanted: str) -> str:
    try:
        content = read_regular(path, document.LARGEST_FILE + 1)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or "is no path"
        known = ", ".join(BUILTIN_NAMES)
        message = f"profile {quoted(wanted)}: {reason}; write {known}, or the path of a profile's YAML file"
        raise ConfigError((Problem(str(path), 1, 1, "", message),)) from None
    return document.decode(content, str(path))


def parse_profile(text: str, file: str) -> Profile:
    """Return the profile in a YAML text; `file` is its name in problems. Raises ConfigError."""
    source = document.parse(text, file)
    try:
        profile = Profile.model_validate(source.data)
    except ValidationError as error:
        problems = source.problems + source.problems_of(error, Profile)
        raise ConfigError(tuple(sorted(problems))) from None
    if source.problems:
        raise ConfigError(source.problems)
    return profile
