"""Direct access to the line: how a verb leaves it."""

from __future__ import annotations

import time
from pathlib import Path

from lfs10d.cli.direct_line import DirectLine
from lfs10d.line.device import DeviceSpec, PollRules
from lfs10d.modbus.frames import Codec, Framing
from lfs10d.modbus.port_settings import PortSettings
from lfs10d.profiles.library import load_profile
from lfs10d.reading import Exchanged
from lfs10d.simulator.pty import PtyLine


def test_a_verb_ends_the_exchange_under_way_before_it_leaves(sensors: PtyLine) -> None:
    """Else who opens the port next hears an answer that is not its own, or speaks too soon after the request."""
    spec = DeviceSpec("north", 2, load_profile("lfs10", relative_to=Path()), Codec(Framing.RTU), 1.0)
    with DirectLine(PortSettings(sensors.path)) as line:
        line.poll([spec], PollRules())
        while sensors.line.judge.counts.total() == 0:  # slave 2 does not exist: this exchange takes 200 ms
            time.sleep(0.001)
    told = list(iter(lambda: line.events(0.1), []))
    assert sum(isinstance(event, Exchanged) for events in told for event in events) == sensors.line.judge.counts.total()
