"""What the service manager is told, by a real socket."""

from __future__ import annotations

import os
import socket
import time
from typing import TYPE_CHECKING

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lfs10d.systemd import Notifier, notify_address, watchdog_seconds

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path


class Manager:
    """The service manager's end."""

    def __init__(self, address: str) -> None:
        self.socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self.socket.bind(address)
        self.socket.settimeout(10)

    def heard(self) -> list[str]:
        """Return the assignments of the next message."""
        return self.socket.recv(4096).decode().split("\n")


@pytest.fixture
def manager(tmp_path: Path) -> Iterator[Manager]:
    """Give a service manager that listens at a path."""
    listening = Manager(str(tmp_path / "notify"))
    yield listening
    listening.socket.close()


@pytest.fixture
def notifier(manager: Manager) -> Iterator[Notifier]:
    """Give a notifier that talks to it."""
    talking = Notifier({"NOTIFY_SOCKET": manager.socket.getsockname()})
    yield talking
    talking.close()


def test_ready_is_told_with_a_status(manager: Manager, notifier: Notifier) -> None:
    assert notifier.ready("8 of 8 online")
    assert manager.heard() == ["READY=1", "STATUS=8 of 8 online"]

    assert notifier.ready()
    assert manager.heard() == ["READY=1"]


def test_a_reload_carries_the_time_that_systemd_compares_with(manager: Manager, notifier: Notifier) -> None:
    before = time.clock_gettime_ns(time.CLOCK_MONOTONIC) // 1000
    assert notifier.reloading()
    after = time.clock_gettime_ns(time.CLOCK_MONOTONIC) // 1000

    state, stamp = manager.heard()

    assert state == "RELOADING=1"
    assert stamp.startswith("MONOTONIC_USEC=")
    assert before <= int(stamp.partition("=")[2]) <= after


def test_the_status_the_watchdog_and_the_end_are_told(manager: Manager, notifier: Notifier) -> None:
    assert notifier.status("7 of 8 online, load 61 %, broker connected")
    assert manager.heard() == ["STATUS=7 of 8 online, load 61 %, broker connected"]
    assert notifier.feed()
    assert manager.heard() == ["WATCHDOG=1"]
    assert notifier.stopping("closing the port")
    assert manager.heard() == ["STOPPING=1", "STATUS=closing the port"]


def test_a_status_cannot_say_anything_else(manager: Manager, notifier: Notifier) -> None:
    notifier.status("mast\nREADY=1")

    assert manager.heard() == ["STATUS=mast\\nREADY=1"]


def test_an_empty_status_is_not_told(notifier: Notifier) -> None:
    assert not notifier.status("")


def test_an_abstract_socket_is_reached() -> None:
    name = f"lfs10d-test-{os.getpid()}"
    manager = Manager(f"\0{name}")
    notifier = Notifier({"NOTIFY_SOCKET": f"@{name}"})

    assert notifier.feed()
    assert manager.heard() == ["WATCHDOG=1"]

    notifier.close()
    manager.socket.close()


@pytest.mark.parametrize(
    "variables", [{}, {"NOTIFY_SOCKET": ""}, {"NOTIFY_SOCKET": "vsock:2:1"}, {"NOTIFY_SOCKET": "@"}]
)
def test_without_a_service_manager_everything_is_silent(variables: dict[str, str]) -> None:
    notifier = Notifier(variables)

    assert not notifier.ready()
    assert not notifier.feed()
    assert notifier.watchdog is None
    notifier.close()


def test_by_default_the_environment_of_the_process_counts(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("WATCHDOG_USEC", "30000000")
    monkeypatch.setenv("WATCHDOG_PID", str(os.getpid()))
    monkeypatch.delenv("NOTIFY_SOCKET", raising=False)

    assert Notifier().watchdog == 30.0


def test_a_service_manager_that_is_gone_is_no_error(manager: Manager, notifier: Notifier) -> None:
    manager.socket.close()

    assert not notifier.feed()


def test_a_service_manager_that_does_not_listen_holds_nobody_up(manager: Manager, notifier: Notifier) -> None:
    told = 0
    while notifier.feed():
        told += 1
        assert told < 100_000

    assert manager.heard() == ["WATCHDOG=1"]
    assert notifier.feed()  # there is room again


def test_a_closed_notifier_is_silent(notifier: Notifier) -> None:
    notifier.close()
    notifier.close()

    assert not notifier.ready()


@pytest.mark.parametrize(
    ("variables", "seconds"),
    [
        ({}, None),
        ({"WATCHDOG_USEC": "2500000"}, 2.5),
        ({"WATCHDOG_USEC": "2500000", "WATCHDOG_PID": "42"}, 2.5),
        ({"WATCHDOG_USEC": "2500000", "WATCHDOG_PID": "43"}, None),
        ({"WATCHDOG_USEC": "2500000", "WATCHDOG_PID": ""}, None),
        ({"WATCHDOG_USEC": "0", "WATCHDOG_PID": "42"}, None),
        ({"WATCHDOG_USEC": "soon"}, None),
        ({"WATCHDOG_USEC": "-1"}, None),
        ({"WATCHDOG_USEC": "\u0663"}, None),
    ],
)
def test_the_watchdog_watches_the_process_it_names(variables: dict[str, str], seconds: float | None) -> None:
    assert watchdog_seconds(variables, 42) == seconds


@given(name=st.text(max_size=50))
def test_no_variable_is_too_odd(name: str) -> None:
    name = name.encode("utf-8", "ignore").decode()
    address = notify_address({"NOTIFY_SOCKET": name})

    assert address is None or name[0] in "/@"
