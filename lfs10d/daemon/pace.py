"""The times of a daemon that no configuration changes; tests that are about something else give shorter ones."""

from __future__ import annotations

from lfs10d.outbox.backlog import HISTORY_AFTER
from lfs10d.reconfiguration.procedure_run import CHANGE_SHARE
from lfs10d.system.dataclass import dataclass


@dataclass(frozen=True, slots=True)
class Pace:
    """Seconds from a connect to the first history, and the share of the line that a change of a sensor takes."""

    history_wait: float = HISTORY_AFTER
    change_share: float = CHANGE_SHARE


USUAL = Pace()
