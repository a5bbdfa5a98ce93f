"""Fixtures: a line that answers a procedure exchange by exchange."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from lfs10d.modbus.outcome import Outcome
from tests.support.sensors import Pretence, heard


@pytest.fixture
def pretence() -> Pretence:
    return Pretence()


@pytest.fixture(name="heard")
def _heard() -> Callable[..., Outcome]:
    """Give the function that makes outcomes."""
    return heard
