"""How it ends: in order, in time, whatever is away."""

from __future__ import annotations

import signal
import socket
import time
from pathlib import Path

import pytest

from tests.support.brokers import Mosquitto
from tests.support.sites import ENDS_WITHIN, Site, View, eventually, good


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_clean_exit_changes_nothing_but_availability(
    site: Site, mosquitto: Mosquitto, view: View, number: int
) -> None:
    site.line()
    site.write()
    run = site.run()
    view.wait("device/slave-1/state", good)
    view.wait_samples("slave-1", 3)

    begun = time.monotonic()
    assert run.ends(number) == 0
    assert time.monotonic() - begun < ENDS_WITHIN
    view.wait("availability", "offline".__eq__)

    last = max(n for n, each in enumerate(view.heard) if each.topic.endswith("line0/availability"))
    assert not [each.topic for each in view.heard[last + 1 :]]
    retained = mosquitto.retained("lfs10d/line0/device/+/availability")
    assert set(retained.values()) == {b"online"}
    assert len(mosquitto.retained("lfs10d/line0/#")) == 5 + 2 * 6 + 1
    assert run.log.splitlines()[-1].endswith("ended")
    assert run.manager.all("STOPPING=1")


def test_killed_it_is_declared_offline_by_its_will(site: Site, view: View) -> None:
    site.write(slaves=[])
    run = site.run()
    view.wait("availability", "online".__eq__)

    run.process.kill()

    view.wait("availability", "offline".__eq__)


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_without_port_and_broker_it_ends_in_time(site: Site, number: int) -> None:
    site.write()
    run = site.run()
    run.says("there is no such device")
    run.says("connection refused")

    begun = time.monotonic()
    assert run.ends(number) == 0
    assert time.monotonic() - begun < ENDS_WITHIN


def test_a_broker_that_answers_nothing_does_not_hold_the_end_up(site: Site) -> None:
    with socket.create_server(("127.0.0.1", site.port)) as deaf:
        site.line()
        site.write()
        run = site.run()
        run.ready()
        connection, _ = deaf.accept()

        begun = time.monotonic()
        assert run.ends(signal.SIGTERM) == 0
        assert time.monotonic() - begun < ENDS_WITHIN
        connection.close()


def test_a_broker_that_hangs_once_it_knew_us_does_not_hold_the_end_up(
    site: Site, mosquitto: Mosquitto, view: View
) -> None:
    site.line()
    site.write()
    run = site.run()
    view.wait("device/slave-1/state", good)
    assert mosquitto.process is not None
    mosquitto.process.send_signal(signal.SIGSTOP)

    begun = time.monotonic()
    assert run.ends(signal.SIGTERM) == 0
    taken = time.monotonic() - begun
    mosquitto.process.send_signal(signal.SIGCONT)

    assert taken < ENDS_WITHIN
    view.wait("availability", "offline".__eq__)


def test_a_clock_service_that_does_not_answer_does_not_hold_the_end_up(site: Site, tmp_path: Path) -> None:
    asked = tmp_path / "asked"
    programs = tmp_path / "programs"
    programs.mkdir()
    (programs / "timedatectl").write_text(f"#!/bin/sh\n: > {asked}\nexec sleep 3\n")
    (programs / "timedatectl").chmod(0o755)
    site.write(slaves=[])
    run = site.run(environment={"PATH": f"{programs}:/usr/bin:/bin"})
    run.ready()
    eventually(asked.exists, "the clock is asked for")

    begun = time.monotonic()
    assert run.ends(signal.SIGTERM) == 0
    assert time.monotonic() - begun < ENDS_WITHIN


def test_asked_to_end_twice_it_ends_once_in_order(site: Site, view: View) -> None:
    site.line()
    site.write()
    run = site.run()
    view.wait("availability", "online".__eq__)

    run.process.send_signal(signal.SIGTERM)
    run.process.send_signal(signal.SIGINT)
    run.process.send_signal(signal.SIGTERM)

    assert run.ends() == 0
    view.wait("availability", "offline".__eq__)


def test_asked_to_end_before_it_began_it_ends_with_0(site: Site) -> None:
    site.write()
    run = site.run(program=("-m", "lfs10d"))
    # Its handlers stand as soon as SIGHUP is ignored, which /proc tells, or caught, if nobody looked in between.
    status = Path(f"/proc/{run.process.pid}/status")

    def hears() -> bool:
        lines = status.read_text(encoding="ascii").splitlines()
        masks = [int(line.split()[1], 16) for line in lines if line.startswith(("SigIgn", "SigCgt"))]
        return any(mask & 1 << signal.SIGHUP - 1 for mask in masks)

    eventually(hears, "SIGHUP ends nothing any more")
    assert run.ends(signal.SIGTERM) == 0
