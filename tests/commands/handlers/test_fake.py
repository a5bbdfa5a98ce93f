"""The fake that handlers are tested with takes what the daemon's own parts take."""

from __future__ import annotations

import inspect

import pytest

from lfs10d.commands.line_access import LineAccess
from lfs10d.mqtt.publisher import Publisher
from lfs10d.reconfiguration.reconfiguration import Reconfiguration
from tests.support.context import FakeContext

PARTS = {
    LineAccess: ("read", "trace", "scan", "pause", "cancel", "ping", "access"),
    Reconfiguration: ("reserved", "readdress", "baudrate", "adopt"),
    Publisher: ("health", "republish", "applied"),
}


@pytest.mark.parametrize(("part", "name"), [(part, name) for part, names in PARTS.items() for name in names])
def test_a_method_of_the_fake_is_called_as_the_real_one(part: type, name: str) -> None:
    real, fake = getattr(part, name), getattr(FakeContext, name)
    assert list(inspect.signature(fake).parameters.values()) == list(inspect.signature(real).parameters.values())
    assert inspect.iscoroutinefunction(fake) is inspect.iscoroutinefunction(real)
