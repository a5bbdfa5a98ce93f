"""The daemon from outside: a simulated line on a pseudo terminal, a real broker, the daemon as a process of its own.

What it publishes is heard by an independent subscriber, what it tells the service manager by a socket, what it logs
by its standard error. Nothing here looks inside.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.support.brokers import Mosquitto
from tests.support.operators import Operator, operator_of
from tests.support.sites import Site, View


@pytest.fixture
def site(tmp_path: Path, request: pytest.FixtureRequest, unused_port: int) -> Iterator[Site]:
    """Give a site at the test's mosquitto if it has one, else at a broker that is not there."""
    with_broker = "mosquitto" in request.fixturenames
    port = request.getfixturevalue("mosquitto").port if with_broker else unused_port
    made = Site(tmp_path, port)
    yield made
    made.close()


@pytest.fixture
def view(mosquitto: Mosquitto) -> View:
    """Give an independent subscriber to everything."""
    return View(mosquitto.subscribe())


@pytest.fixture
def operator(site: Site, mosquitto: Mosquitto) -> Operator:
    site.line()
    return operator_of(site, mosquitto)
