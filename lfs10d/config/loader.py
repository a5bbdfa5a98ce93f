"""Reads the configuration file with its profiles and secrets, validates it as a whole, and notes each origin."""

from __future__ import annotations

import os
import socket
from collections.abc import Iterable, Mapping
from itertools import chain
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ValidationError

from lfs10d.config.credentials import (
    CREDENTIAL,
    UnreadableError,
    credential_file,
    password_in,
    readable,
    reason,
    unreadable,
)
from lfs10d.config.defaults import resolved, unfit
from lfs10d.config.models import Config, MqttConfig
from lfs10d.config.validation import contradictions
from lfs10d.errors import ConfigError, Problem
from lfs10d.profiles.library import builtin_names, load_profile
from lfs10d.profiles.profile import Profile
from lfs10d.schema.document import Document, decode, parse, path_text
from lfs10d.schema.fields import quoted, shown
from lfs10d.schema.messages import KeyPath
from lfs10d.system.dataclass import dataclass
from lfs10d.system.regular_file import read_regular
from lfs10d.system.secret import Secret


@dataclass(frozen=True, slots=True)
class Origin:
    """Where a value comes from: `file` (with its line), `default`, or `credential`."""

    kind: str
    place: str = ""

    def __str__(self) -> str:
        return self.place or self.kind


DEFAULT = Origin("default")


@dataclass(frozen=True)
class LoadedConfig:
    """A valid file: the complete `config`, `profiles` by `SlaveConfig.profile`, `origins` by path in words."""

    path: Path
    document: Document
    config: Config
    profiles: Mapping[str, Profile]
    origins: Mapping[str, Origin]
    credential: Path | None

    def password(self) -> Secret | None:
        """Read the broker's password anew; None if there is none. Raises ConfigError if it cannot be read."""
        named = self.config.mqtt.password_file
        file = self.credential if named is None else Path(named)
        try:
            return None if file is None else password_in(file)
        except UnreadableError as error:
            key = ("mqtt", "password_file")
            at = Problem(str(file), 1, 1, "", str(error)) if named is None else self.document.problem(key, str(error))
            raise ConfigError((at,)) from None


def load(
    path: Path,
    *,
    files: bool = True,
    environment: Mapping[str, str] | None = None,
    host: str | None = None,
) -> LoadedConfig:
    """Return the configuration in a file; raises ConfigError with all its problems, in order of place.

    With `files`, password and certificate files must be readable (a verb that logs in with credentials of its own
    does without). `environment` and `host` are those of the process unless given.
    """
    environment = os.environ if environment is None else environment
    document = parse(decode(_content(path), str(path)), str(path))
    if not isinstance(document.data, dict):
        message = f"must be a mapping with line, slaves and mqtt, not {shown(document.data)}"
        raise ConfigError(tuple(sorted((*document.problems, document.problem((), message)))))
    config, problems, wrong = _validated(document)
    folder = path.parent.absolute()
    profiles, more = _profiles(document, config, folder, wrong)
    problems += more
    problems += (
        document.problem(each.path, each.message, key=each.key)
        for each in contradictions(config, profiles)
        if not any(_concerns(key, wrong) for key in each.on)
    )
    config = _anchored(config, folder)
    complete = resolved(config, stem=path.stem, host=socket.gethostname() if host is None else host)
    found = chain(unfit(config, complete), unreadable(config.mqtt) if files else ())
    problems += (document.problem(keys, message) for keys, message in found if not _concerns(keys, wrong))
    credential = credential_file(environment)
    if files and credential is not None and (config.mqtt.username, config.mqtt.password_file) == (None, None):
        message = f"is missing: the systemd credential {CREDENTIAL} is a password, never sent without a user name"
        problems.append(document.problem(("mqtt", "username"), message))
    if problems:
        # The file itself first, profile files after it.
        raise ConfigError(tuple(sorted(set(problems), key=lambda found: (found.file != document.file, found))))
    loaded = LoadedConfig(path, document, complete, profiles, _origins(document, complete, credential), credential)
    if files:
        loaded.password()
    return loaded


def _content(path: Path) -> bytes:
    try:
        return read_regular(path, LARGEST_READ)
    except FileNotFoundError:
        message = "there is no such file; name another with -c FILE or $LFS10D_CONFIG"
    except (OSError, ValueError) as error:
        message = f"the file cannot be read: {reason(error)}"
    raise ConfigError((Problem(str(path), 1, 1, "", message),))


LARGEST_READ = 2**20
"""Bytes: enough for `decode` to see that a file is too large."""


def _validated(document: Document) -> tuple[Config, list[Problem], frozenset[KeyPath]]:
    """Return the configuration, its problems, and the wrong paths, which have defaults."""
    problems = list(document.problems)
    try:
        return Config.model_validate(document.data), problems, frozenset()
    except ValidationError as error:
        problems += document.problems_of(error, Config)
        wrong = frozenset(tuple(detail["loc"]) for detail in error.errors(include_url=False))
    return Config.model_validate(_mended(document.data, wrong)), problems, wrong


def _mended(data: Any, wrong: Iterable[KeyPath]) -> dict[str, Any]:  # noqa: ANN401  # any YAML
    """Return the data without wrong values, so that the rest can be checked; required keys get a placeholder."""
    bad = frozenset(wrong)

    def keep(value: Any, path: KeyPath) -> Any:  # noqa: ANN401 - YAML of any shape
        if isinstance(value, dict):
            return {key: keep(item, (*path, key)) for key, item in value.items() if not _cut(path, key, item, bad)}
        if isinstance(value, list) and path == ("slaves",):
            return [keep(item, (*path, index)) for index, item in enumerate(value)]
        return value

    mended: dict[str, Any] = keep(data, ())
    mended.setdefault("line", {}).setdefault("port", "/dev/null")
    mended["slaves"] = [
        {"id": 1, **item} if isinstance(item, dict) else {"id": 1} if _concerns(("slaves", index), bad) else item
        for index, item in enumerate(mended.get("slaves", ()))
    ]
    return mended


def _cut(path: KeyPath, key: str | int, item: object, bad: frozenset[KeyPath]) -> bool:
    """Return whether a key is left out: its value, or an item of a list that is one value, is wrong."""
    place = (*path, key)
    if not isinstance(key, str) or place in bad:
        return True
    return isinstance(item, list) and place != ("slaves",) and any(step[: len(place)] == place for step in bad)


def _concerns(key: KeyPath, wrong: frozenset[KeyPath]) -> bool:
    """Return whether a key, its section, or a part of it is wrong."""
    return any(key[: len(path)] == path[: len(key)] for path in wrong)


def _profiles(
    document: Document, config: Config, folder: Path, wrong: frozenset[KeyPath]
) -> tuple[dict[str, Profile], list[Problem]]:
    profiles: dict[str, Profile] = {}
    problems: list[Problem] = []
    tried: set[str] = set()
    for index, slave in enumerate(config.slaves):
        name, keys = slave.profile, ("slaves", index, "profile")
        if name in tried or _concerns(keys, wrong):
            continue
        tried.add(name)
        try:
            if name not in builtin_names():
                readable(folder / name)
            profiles[name] = load_profile(name, relative_to=folder)
        except UnreadableError as error:
            known = ", ".join(builtin_names())
            message = f"no profile {quoted(name)}: {error}; built in are {known}; else the path of a profile YAML"
            problems.append(document.problem(keys, message))
        except ConfigError as error:
            problems += error.problems
    return profiles, problems


def _anchored(config: Config, folder: Path) -> Config:
    """Return the configuration with absolute paths."""
    mqtt: MqttConfig = config.mqtt
    line = config.line.model_copy(update={"port": str(folder / config.line.port)})
    update: dict[str, Any] = {}
    if mqtt.password_file is not None:
        update["password_file"] = str(folder / mqtt.password_file)
    if mqtt.tls is not None:
        paths = {key: str(folder / value) for key, value in mqtt.tls.model_dump().items() if value is not None}
        update["tls"] = mqtt.tls.model_copy(update=paths)
    return config.model_copy(update={"line": line, "mqtt": mqtt.model_copy(update=update)})


def leaves(model: BaseModel, path: KeyPath = ()) -> Iterable[tuple[KeyPath, Any]]:
    """Yield every value with its path; lists of words and null are values, sections are not."""
    for key in type(model).model_fields:
        value = getattr(model, key)
        if isinstance(value, BaseModel):
            yield from leaves(value, (*path, key))
        elif isinstance(value, tuple) and value and isinstance(value[0], BaseModel):
            for index, item in enumerate(value):
                yield from leaves(item, (*path, key, index))
        else:
            yield (*path, key), value


def _origins(document: Document, config: Config, credential: Path | None) -> dict[str, Origin]:
    origins = {path_text(path): _origin(document, path) for path, _ in leaves(config)}
    if credential is not None and config.mqtt.password_file is None:
        origins["mqtt.password_file"] = Origin("credential", f"systemd credential {CREDENTIAL}")
    return origins


def _origin(document: Document, path: KeyPath) -> Origin:
    inherited: KeyPath = ("poll", path[-1])
    short = path[-1] == "id" and document.holds(path[:-1])
    if document.holds(path) or short:
        return Origin("file", f"{document.file}:{document.line_of(path)}")
    if path[0] == "slaves" and path[-1] in {"interval", "response_timeout"} and document.holds(inherited):
        return Origin("file", f"{document.file}:{document.line_of(inherited)} (poll.{path[-1]})")
    return DEFAULT
