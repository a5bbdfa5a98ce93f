"""Where profiles are found: the built-in files of this package, and a user's own by path."""

from __future__ import annotations

from functools import cache
from importlib import resources
from typing import TYPE_CHECKING, Any

import yaml
from pydantic import ValidationError

from lfs10d.errors import ConfigError, Problem
from lfs10d.profiles.schema import Profile

if TYPE_CHECKING:
    from pathlib import Path

BUILTIN_NAMES = ("lfs10", "ld-e", "fuling-dzb", "eh600")
"""The profiles that come with lfs10d, the first being a slave's default."""

LARGEST_FILE = 256 * 1024
"""Bytes; a profile has a few thousand."""


def builtin_names() -> tuple[str, ...]:
    """Return the names that need no file of the user's."""
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
    file = resources.files(__package__).joinpath(f"{name}.yaml")
    return parse_profile(file.read_text(encoding="utf-8"), f"{name}.yaml")


def _read(path: Path, wanted: str) -> str:
    try:
        with path.open("rb") as file:
            content = file.read(LARGEST_FILE + 1)
    except OSError as error:
        reason = error.strerror or str(error)
        known = ", ".join(BUILTIN_NAMES)
        message = f"profile {wanted!r}: {reason}; a profile is one of {known}, or the path of a YAML file"
        raise ConfigError((Problem(str(path), 1, 1, "", message),)) from error
    if len(content) > LARGEST_FILE:
        raise ConfigError((Problem(str(path), 1, 1, "", "more than 256 KiB: this is no profile"),))
    try:
        return content.decode("utf-8")
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        raise ConfigError((Problem(str(path), line, 1, "", "is no UTF-8 text"),)) from error


def parse_profile(text: str, file: str) -> Profile:
    """Return the profile that a YAML text describes; `file` is its name in problems. Raises ConfigError."""
    data: Any = yaml.safe_load(text)
    try:
        return Profile.model_validate(data)
    except ValidationError as error:
        raise ConfigError(
            tuple(
                Problem(file, 1, 1, ".".join(map(str, wrong["loc"])), wrong["msg"])
                for wrong in error.errors()
            )
        ) from error
