"""Fixtures: a line that answers a procedure exchange by exchange."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from lfs10d.modbus.outcome import Outcome
from tests.support.sensors import Pretence, outcome_of


@pytest.fixture
def pretence() -> Pretence:
    return Pretence()


@pytest.fixture(name="outcome_of")
def _outcome_of() -> Callable[..., Outcome]:
    """Give the function that makes outcomes."""
    return outcome_of
