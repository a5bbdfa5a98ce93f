"""The family of bad lines once in real time: the daemon's process, a pseudo terminal at 115200 baud, a real broker.

What the broker's subscriber heard is held to the simulated line's log, as in virtual time (`soak.attestation`).
"""

from __future__ import annotations

import signal
import time
from functools import partial

import pytest

from lfs10d.simulator.burst import MASTER
from lfs10d.simulator.line import SimulatedLine
from lfs10d.simulator.pty import PtyLine
from lfs10d.simulator.wire import SECOND, Format
from soak.attestation import Oracle, epoch_of, parsed
from soak.troubles import KINDS
from tests.support.faulty_sensors import add_fault
from tests.support.queued_sensor import QueuedSensor
from tests.support.sites import Site, View, eventually, tell

pytestmark = pytest.mark.needs("mosquitto")

SLAVES = (1, 2, 3, 4)
RATE = 115200
EACH = 70
"""Exchanges under each kind of fault; the line counts them, no clock."""
WELL = 100
"""Exchanges before the first and after the last."""
SHARE = 0.3
WITHIN = 120.0
OWN = {
    "silent": "timeout",
    "noisy": "crc",
    "truncated": "malformed",
    "wrong_id": "wrong_slave",
    "wrong_function": "wrong_function",
    "exception": "exception",
    "nan": "not_finite",
}
"""The code that a kind of fault is told by, whatever else comes of it."""


class Recorded:
    """The line of this test on a terminal; `handed` is what its adapter gave the master, with the time."""

    def __init__(self, site: Site) -> None:
        self.line = SimulatedLine([QueuedSensor(slave, format=Format(RATE)) for slave in SLAVES], format=Format(RATE))
        self.served = PtyLine(self.line, link=site.tty)
        self.handed: list[tuple[float, bytes]] = []
        collect = self.served.adapter.collect

        def recording(now: int) -> bytes:
            data = collect(now)
            if data:
                self.handed.append((now / SECOND, data))
            return data

        self.served.adapter.collect = recording  # type: ignore[method-assign]  # it is all that hands over
        site.lines.append(self.served)
        self.served.start()
        self.epoch = epoch_of(self.served.now)

    @property
    def exchanges(self) -> int:
        return sum(request.speaker is MASTER for request in list(self.line.log))

    def carry(self, count: int) -> None:
        """Wait until the line has carried so many more requests."""
        wanted = self.exchanges + count
        eventually(lambda: self.exchanges >= wanted, f"{count} more exchanges", within=WITHIN)


def ail(line: SimulatedLine, kind: str) -> None:
    """Let two neighbours show it now and then, and nobody anything else."""
    for sensor in line.sensors:
        sensor.faults.clear()
        sensor.hung = False
    for slave in (2, 3):
        add_fault(line.sensor(slave), kind, SHARE, **KINDS[kind])


def heal(line: SimulatedLine) -> None:
    for sensor in line.sensors:
        sensor.faults.clear()
        sensor.hung = False


def told(view: View, begun: int, code: str) -> bool:
    """Whether a sample with this error was heard since so many messages."""
    word = f'"{code}"'.encode()
    return any(word in each.payload and each.topic.endswith("/telemetry") for each in view.heard[begun:])


@pytest.mark.long(60)
def test_under_every_fault_in_turn_the_broker_is_told_no_wrong_number_and_every_poll(site: Site, view: View) -> None:
    bad = Recorded(site)
    site.write(
        line={"baudrate": RATE},
        # Nobody goes offline, who would be asked once a second and miss the next kinds; without retries each is told.
        poll={"interval": 0, "offline_after": 100, "retries": 0},
        slaves=list(SLAVES),
    )
    run = site.run()
    run.ready()
    bad.carry(WELL)
    for kind in KINDS:
        begun = len(view.heard)
        tell(bad.served, partial(ail, kind=kind))
        bad.carry(EACH)
        if kind in OWN:  # who answers oddly is left alone for a while: others are asked meanwhile
            eventually(partial(told, view, begun, OWN[kind]), f"{OWN[kind]} of {kind}", within=WITHIN)
    tell(bad.served, heal)
    healed = round(time.time() * 1000)
    for slave in SLAVES:
        view.wait(f"device/slave-{slave}/state", lambda state: state["quality"] == "good" and state["ts"] > healed)
    bad.carry(WELL)
    assert run.ends(signal.SIGTERM) == 0
    eventually(lambda: view.newest("availability") == "offline", "the end")
    devices = parsed((each.topic, each.payload) for each in view.heard)
    oracle = Oracle(bad.line.log, bad.handed, epoch=bad.epoch)
    good = 0
    for slave in SLAVES:
        samples = devices[f"slave-{slave}"]
        assert samples.judge(max(samples.by_seq)) == []
        found = oracle.judge(f"slave-{slave}", slave, samples.in_order())
        assert found.wrong == []
        good += found.good
    codes = {sample["error"] for samples in devices.values() for sample in samples.in_order() if sample["error"]}
    assert codes >= set(OWN.values())
    assert good > bad.exchanges / 2
    assert bad.exchanges >= 2 * WELL + len(KINDS) * EACH
