"""The line thread on a real pseudo terminal: it talks, wakes up, survives its port, and gives it back."""

from __future__ import annotations

import os
import threading
import time
import tty
from collections.abc import Iterator
from pathlib import Path

import pytest

from lfs10d.line.device import DeviceSpec, PollRules
from lfs10d.line.poller import Poller
from lfs10d.line.scheduler import Scheduler
from lfs10d.line.thread import IDLE_MOST, WAKING, LineThread
from lfs10d.modbus.bus import Bus, LineRules, Wait
from lfs10d.modbus.frames import Codec, Framing
from lfs10d.modbus.port import SerialPort
from lfs10d.modbus.port_settings import PortSettings
from lfs10d.modbus.timing import LineTiming
from lfs10d.profiles.library import load_profile
from lfs10d.reading import Event, PortChanged, Reading

PATIENCE = 10.0
"""Seconds after which something awaited counts as not happening."""
PULLED = b"pulled"
ANSWER = bytes.fromhex("010304414FD70A002F")
LFS10 = load_profile("lfs10", relative_to=Path())


class FarEnd:
    """The other end of a pty: answers every request with one value until it is closed."""

    def __init__(self, link: Path) -> None:
        self._link = link
        self.fd = -1
        self.plug_in()

    def plug_in(self) -> None:
        self.fd, slave = os.openpty()
        tty.setraw(slave)
        self._link.unlink(missing_ok=True)
        self._link.symlink_to(os.ttyname(slave))
        self._slave = slave
        self._answering = threading.Thread(target=self._answer)
        self._answering.start()

    def _answer(self) -> None:
        while os.read(self.fd, 256) != PULLED:
            os.write(self.fd, ANSWER)

    def pull_out(self) -> None:
        if self.fd < 0:
            return
        while self._answering.is_alive():  # it must not sit in a read: that would keep the pty alive
            os.write(self._slave, PULLED)
            self._answering.join(0.01)
        os.close(self._slave)
        os.close(self.fd)
        self.fd = -1


class Rig:
    """A line thread whose events can be awaited."""

    def __init__(self, path: Path, interval: float) -> None:
        self.events: list[Event] = []
        self.failure: BaseException | None = None
        self._told = threading.Condition()
        bus = Bus(SerialPort(PortSettings(str(path))), LineRules(), time.monotonic)
        scheduler = Scheduler(LineTiming.of(9600), time.monotonic())
        spec = DeviceSpec("mast", 1, LFS10, Codec(Framing.RTU), interval)
        scheduler.replace([spec], PollRules(), time.monotonic())
        self.poller = Poller(bus, scheduler, self._tell, time.monotonic)
        self.prepared: list[threading.Thread] = []
        self.thread = LineThread(
            self.poller, prepare=lambda: self.prepared.append(threading.current_thread()), failed=self._fail
        )

    def _tell(self, events: list[Event]) -> None:
        with self._told:
            self.events += events
            self._told.notify_all()

    def _fail(self, error: BaseException) -> None:
        self.failure = error

    def await_readings(self, count: int, *, good: bool = True) -> None:
        def enough() -> bool:
            readings = [event for event in self.events if isinstance(event, Reading)]
            return sum((reading.fault is None) is good for reading in readings) >= count

        with self._told:
            assert self._told.wait_for(enough, PATIENCE)


@pytest.fixture
def far_end(tmp_path: Path) -> Iterator[FarEnd]:
    end = FarEnd(tmp_path / "port")
    yield end
    end.pull_out()


@pytest.fixture
def rig(far_end: FarEnd, tmp_path: Path) -> Iterator[Rig]:
    assert far_end.fd >= 0
    rig = Rig(tmp_path / "port", 0.05)
    yield rig
    if rig.thread.is_alive():
        rig.thread.stop()
        rig.thread.join(PATIENCE)


def test_it_polls_and_gives_the_port_back(rig: Rig) -> None:
    rig.thread.start()
    rig.await_readings(5)
    rig.thread.stop()
    rig.thread.join(PATIENCE)
    assert not rig.thread.is_alive()
    assert rig.poller.bus.port.fileno() == -1
    assert rig.prepared == [rig.thread]
    assert rig.failure is None


def test_a_wake_up_ends_an_idle_wait(rig: Rig) -> None:
    rig.poller.replace([], PollRules())
    rig.thread.start()
    done = threading.Event()
    time.sleep(0.05)  # most likely it waits by now; the claim holds either way
    for _ in range(100_000):  # more than the pipe holds
        rig.thread.wake()
    rig.poller.post(lambda _: done.set())
    rig.thread.wake()
    assert done.wait(IDLE_MOST / 2)


def test_it_survives_a_port_that_hangs_up_and_comes_back_as_another_descriptor(rig: Rig, far_end: FarEnd) -> None:
    rig.thread.start()
    rig.await_readings(3)
    far_end.pull_out()
    rig.await_readings(1, good=False)
    far_end.plug_in()
    before = len([event for event in rig.events if isinstance(event, Reading) and event.fault is None])
    rig.await_readings(before + 3)
    changes = [event.fault is None for event in rig.events if isinstance(event, PortChanged)]
    assert changes[0]
    assert changes[-1]
    assert False in changes
    assert rig.failure is None


def test_what_it_declares_is_never_long_past(rig: Rig) -> None:
    rig.thread.start()
    rig.await_readings(2)
    assert rig.thread.declared <= time.monotonic() + IDLE_MOST


def test_a_mistake_is_told_and_the_port_given_back(rig: Rig) -> None:
    def mistake(_: float) -> None:
        raise RuntimeError("a mistake")

    rig.thread.start()
    rig.await_readings(1)
    rig.poller.post(mistake)
    rig.thread.wake()
    rig.thread.join(PATIENCE)
    assert isinstance(rig.failure, RuntimeError)
    assert rig.poller.bus.port.fileno() == -1


def test_a_descriptor_that_cannot_be_watched_costs_a_short_pause_and_a_look(rig: Rig) -> None:
    began = time.monotonic()
    assert rig.thread._select([-1], 5.0) == [-1]
    os.close(gone := os.open("/dev/null", os.O_RDONLY))
    assert rig.thread._select([gone], 5.0) == [gone]
    assert time.monotonic() - began < IDLE_MOST


def test_bytes_that_can_decide_nothing_do_not_wake_it(rig: Rig, far_end: FarEnd) -> None:
    rig.poller.bus.port.open()
    os.write(far_end.fd, b"\xff")
    now = time.monotonic()
    rig.thread._wait(Wait(now + 0.06, listen=True, not_before=now + 0.05))
    assert time.monotonic() >= now + 0.05 - WAKING
    rig.thread.wake()
    rig.thread._wait(Wait(now + 60.0, listen=True, not_before=now + 50.0))
    assert time.monotonic() < now + 30.0
    rig.poller.bus.close()


def test_it_says_whether_the_port_has_something_to_read(rig: Rig, far_end: FarEnd) -> None:
    rig.poller.bus.port.open()
    assert not rig.thread._wait(Wait(time.monotonic() + 0.01, listen=True))
    os.write(far_end.fd, b"\xff")
    assert rig.thread._wait(Wait(time.monotonic() + PATIENCE, listen=True))
    assert rig.thread._wait(Wait(time.monotonic(), listen=True))  # even when no time is left
    assert not rig.thread._wait(Wait(time.monotonic(), listen=False))
    rig.poller.bus.close()


def test_it_is_back_early_enough_for_a_turn_and_then_waits_to_the_moment(rig: Rig) -> None:
    rig.poller.bus.port.open()
    until = time.monotonic() + WAKING / 2
    rig.thread._wait(Wait(until, listen=True))
    assert time.monotonic() >= until
    rig.poller.bus.close()


@pytest.mark.parametrize("listen", [True, False])
def test_where_nothing_is_hurried_it_sleeps_to_the_moment(rig: Rig, *, listen: bool) -> None:
    rig.poller.bus.port.open()
    rig.thread.waking = IDLE_MOST / 2
    moment = time.monotonic() + 0.05
    assert not rig.thread._wait(Wait(moment, listen=listen, not_before=moment - 0.02, hurried=False))
    assert time.monotonic() >= moment
    rig.poller.bus.close()


@pytest.mark.parametrize("listen", [True, False])
def test_how_early_it_is_back_can_be_set(rig: Rig, *, listen: bool) -> None:
    rig.poller.bus.port.open()
    rig.thread.waking = IDLE_MOST / 2
    moment = time.monotonic() + IDLE_MOST / 2 + 0.05
    rig.thread._wait(Wait(moment, listen=listen))
    assert time.monotonic() < moment - WAKING  # as early as that it is back by default
    rig.poller.bus.close()


def test_how_early_it_listens_for_what_may_come_can_be_set(rig: Rig, far_end: FarEnd) -> None:
    rig.poller.bus.port.open()
    os.write(far_end.fd, b"\xff")
    rig.thread.waking = IDLE_MOST / 2
    moment = time.monotonic() + IDLE_MOST / 2 + 0.05
    assert rig.thread._wait(Wait(moment + IDLE_MOST / 2, listen=True, not_before=moment))
    assert time.monotonic() < moment - WAKING
    rig.poller.bus.close()
