"""Examines the program: Python, the libraries, the configuration."""

from __future__ import annotations

import platform
import sys
from collections.abc import Iterator
from importlib.metadata import PackageNotFoundError, version
from typing import Final

from lfs10d import __version__
from lfs10d.cli.advice import advice
from lfs10d.cli.doctor.finding import Area, Finding
from lfs10d.config.loader import LoadedConfig
from lfs10d.errors import ConfigError
from lfs10d.line.budget import budget

PROGRAM, CONFIGURATION = Area("program"), Area("configuration")

LIBRARIES: Final = ("pymodbus", "paho-mqtt", "pydantic", "PyYAML")
OLDEST_PYTHON: Final = (3, 11)


def versions() -> Iterator[Finding]:
    """Yield the versions of Python, lfs10d and the libraries."""
    libraries = ", ".join(f"{name} {_version(name)}" for name in LIBRARIES)
    text = f"lfs10d {__version__}, Python {platform.python_version()}, {libraries}, in {sys.prefix}"
    if sys.version_info[:2] < OLDEST_PYTHON:
        yield PROGRAM.fail(text, "lfs10d needs Python 3.11 or newer")
    else:
        yield PROGRAM.ok(text)


def _version(library: str) -> str:
    try:
        return version(library)
    except PackageNotFoundError:
        return "(version not known)"


def broken(error: ConfigError) -> Iterator[Finding]:
    """Yield each error of a configuration."""
    for problem in error.problems:
        yield CONFIGURATION.fail(str(problem), "correct it, then: lfs10d check")


def configuration(loaded: LoadedConfig, host: str) -> Iterator[Finding]:
    """Yield that a configuration is valid, and its warnings."""
    found = budget(loaded.config, loaded.profiles)
    slaves = len(loaded.config.slaves)
    yield CONFIGURATION.ok(f"{loaded.path}: valid, {slaves} slaves, load of the line {found.wire_load:.0%}")
    for problem in advice(loaded, found, host):
        place = f"{problem.file}:{problem.line}:{problem.column}: {problem.path}"
        yield CONFIGURATION.warn(f"{place}: {problem.message.removeprefix('warning: ')}", "see lfs10d check")
