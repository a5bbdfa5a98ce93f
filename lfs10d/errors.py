"""Every error that can reach a person, with its policy: exit code, retries, topic.

::

    Lfs10dError                 message for the person who must act: what happened, where, what to do
    |-- ConfigError             exit 78; carries every problem, each with file, line and column
    |-- PortError               the port cannot be used now; tried again for ever; exit 69 for client verbs
    |   |-- PortLostError       absent, denied, hung up: published as `port_lost`
    |   |   `-- PortGoneError   of these, absent or hung up: after a hang-up its absence is no news
    |   `-- PortBusyError       locked by another program: published as `port_busy`
    |-- BrokerError             the broker cannot be used now; `run` tries again for ever; exit 69 for client verbs
    |-- StateError              the state directory cannot be used; exit 1 for verbs, `storage_full` for `run`
    `-- FailedError             the thing asked for failed; exit 1

A failing poll is no error but a value: `lfs10d.reading.Fault`.
"""

from __future__ import annotations

from lfs10d.system.dataclass import dataclass


class Lfs10dError(Exception):
    """Base of all; `str()` is one line for the person who must act."""


@dataclass(frozen=True, slots=True, order=True)
class Problem:
    """One error in a file; `line` and `column` count from 1."""

    file: str
    line: int
    column: int
    path: str
    message: str

    def __str__(self) -> str:
        """Return `FILE:LINE:COLUMN: path.to.key: message` (without the path where it is the whole file)."""
        place = f"{self.file}:{self.line}:{self.column}"
        return f"{place}: {self.path}: {self.message}" if self.path else f"{place}: {self.message}"


class ConfigError(Lfs10dError):
    """A configuration or profile file is wrong. Not retried; exit 78."""

    def __init__(self, problems: tuple[Problem, ...]) -> None:
        super().__init__("\n".join(str(problem) for problem in problems))
        self.problems = problems


class PortError(Lfs10dError):
    """The port cannot be used now. Tried again for ever by `run`."""

    def __init__(self, path: str, message: str) -> None:
        super().__init__(f"{path}: {message}")
        self.path = path
        self.message = message


class PortLostError(PortError):
    """The port is absent, denied or hung up: published as `port_lost`."""


class PortGoneError(PortLostError):
    """The device is not there: unplugged, reset, or never plugged in."""


class PortBusyError(PortError):
    """The port is locked by another program: published as `port_busy`."""


class BrokerError(Lfs10dError):
    """The broker cannot be used now. Tried again for ever by `run`, exit 69 for client verbs."""


class StateError(Lfs10dError):
    """The state directory cannot be read or written."""


class FailedError(Lfs10dError):
    """A verb could not do what was asked; exit 1."""
