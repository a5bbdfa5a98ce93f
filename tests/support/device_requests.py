"""A device and a profile file, for requests on devices."""

from __future__ import annotations

from pathlib import Path

from lfs10d import profiles
from lfs10d.config.models import SlaveConfig
from tests.support.context import FakeContext


def slave(fake: FakeContext, name: str) -> SlaveConfig:
    """Return a device as it holds after a restart."""
    fake.disk.power_cut()
    fake.start()
    found = fake.holding.now.slave(name)
    assert found is not None
    return found


def own_profile(fake: FakeContext) -> None:
    """Put a profile beside the configuration that wants to be polled slowly."""
    text = (Path(profiles.__file__).parent / "ld-e.yaml").read_text()
    fake.file.with_name("own.yaml").write_text(text.replace("name: ld-e", "name: own") + "\nmin_interval: 500ms\n")
