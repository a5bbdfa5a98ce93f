"""Brokers that are not mosquitto, for the tests of the connection."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import AbstractAsyncContextManager

import pytest

from tests.support.discoveries import Site
from tests.support.old_brokers import Answer, OldBroker, serving


@pytest.fixture(name="serving", scope="session")
def _serving() -> Callable[[Answer], AbstractAsyncContextManager[int]]:
    """Give the function that serves whatever is asked for."""
    return serving


@pytest.fixture
def old_broker() -> OldBroker:
    """Give a broker of 3.1.1 only; it listens while it is `running()`."""
    return OldBroker()


@pytest.fixture
def site() -> Iterator[Site]:
    """Give a site."""
    made = Site()
    yield made
    made.loop.close()
