"""A configuration file: the smallest, loaded, and its problems."""

from __future__ import annotations

from pathlib import Path

import pytest

from lfs10d.config.loader import LoadedConfig, load
from lfs10d.errors import ConfigError

SMALL = "line: {port: /dev/x}\nslaves: [2, 3]\nmqtt: {host: localhost}\n"


def loaded(text: str, *, name: str = "lfs10d.yaml", files: bool = True, **environment: str) -> LoadedConfig:
    Path(name).write_bytes(text.encode())
    return load(Path(name), files=files, environment=environment, host="gateway")


def problems(text: str, *, files: bool = True) -> list[str]:
    with pytest.raises(ConfigError) as refused:
        loaded(text, files=files)
    return [str(problem).removeprefix("lfs10d.yaml:") for problem in refused.value.problems]
