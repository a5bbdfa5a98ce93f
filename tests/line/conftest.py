"""Fixtures: a whole line in virtual time, and one that answers a job exchange by exchange."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from lfs10d.modbus.outcome import Outcome
from tests.support.lines import Rigs
from tests.support.sensors import Pretence, outcome_of


@pytest.fixture
def rigs() -> Rigs:
    return Rigs()


@pytest.fixture
def pretence() -> Pretence:
    return Pretence()


@pytest.fixture(name="heard")
def _heard() -> Callable[..., Outcome]:
    """Give the function that makes outcomes."""
    return outcome_of
