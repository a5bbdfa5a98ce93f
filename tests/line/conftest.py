"""A whole line in virtual time: simulated sensors, and a poller that talks to them as the daemon's does."""

from __future__ import annotations

import pytest

from tests.support.lines import Rigs


@pytest.fixture
def rigs() -> Rigs:
    return Rigs()
