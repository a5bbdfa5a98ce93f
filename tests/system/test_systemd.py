"""What the service manager is told, by a real socket; and our units as it judges them."""

from __future__ import annotations

import os
import socket
import subprocess
import sys
import time
import tomllib
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lfs10d.system.systemd import Notifier, notify_address, watchdog_seconds


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


UNITS = Path(__file__).parents[2] / "systemd"
LARGEST_EXPOSURE = 15
"""Tenths of systemd-analyze's exposure level (contract, section 6)."""


def analysed(program: Callable[[str], str], *arguments: str) -> str:
    """Return what systemd-analyze prints; it must be content."""
    done = subprocess.run(
        [program("systemd-analyze"), *arguments], check=False, capture_output=True, text=True, timeout=60
    )
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr
    return done.stdout + done.stderr


@pytest.mark.needs("systemd-analyze")
@pytest.mark.parametrize("unit", ["lfs10d.service", "lfs10d@.service", "lfs10d-web.service"])
def test_a_unit_is_sandboxed(unit: str, program: Callable[[str], str]) -> None:
    told = analysed(program, "security", "--offline=true", f"--threshold={LARGEST_EXPOSURE}", str(UNITS / unit))

    assert "Overall exposure level" in told


@pytest.mark.needs("systemd-analyze")
@pytest.mark.parametrize("unit", ["lfs10d.service", "lfs10d@roof.service", "lfs10d-web.service"])
def test_a_unit_is_understood_without_a_complaint(unit: str, tmp_path: Path, program: Callable[[str], str]) -> None:
    text = (UNITS / unit.replace("roof", "")).read_text()
    # It looks whether the program is there; on the machine of the test it is not.
    (tmp_path / unit).write_text(text.replace("/opt/lfs10d/bin/lfs10d", "/bin/true"))

    told = analysed(program, "verify", "--man=no", str(tmp_path / unit))

    assert not [line for line in told.splitlines() if "lfs10d" in line]


@pytest.mark.parametrize(
    ("text", "code"), [("line: {port: /dev/null}\nslaves: [2]\nmqtt: {host: localhost}\n", 0), ("line: 7\n", 78)]
)
def test_a_reload_is_begun_only_where_the_file_is_right_and_says_on_one_line_what_is_wrong(
    text: str, code: int, tmp_path: Path
) -> None:
    """The unit's own command, with this program and this file."""
    file = tmp_path / "lfs10d.yaml"
    file.write_text(text)
    reloads = [line for line in (UNITS / "lfs10d.service").read_text().splitlines() if line.startswith("ExecReload=")]
    assert reloads[1:] == ["ExecReload=/bin/kill -HUP $MAINPID"], "the daemon is told after the file was found right"
    command = reloads[0].removeprefix("ExecReload=/bin/sh -c '").removesuffix("'")
    command = command.replace("/opt/lfs10d/bin/lfs10d", f"{sys.executable} -m lfs10d")
    command = command.replace("/etc/lfs10d/lfs10d.yaml", str(file))
    done = subprocess.run(["/bin/sh", "-c", command], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (code, "")
    assert bool(done.stderr) is bool(code)
    if code:
        assert done.stderr.startswith(f"{file}:1:7: line: ")


def test_the_documentation_that_a_unit_names_comes_with_the_wheel() -> None:
    wheel = tomllib.loads((UNITS.parent / "pyproject.toml").read_text())["tool"]["hatch"]["build"]["targets"]["wheel"]
    named = {
        line for unit in UNITS.glob("*.service") for line in unit.read_text().splitlines() if "Documentation" in line
    }
    sources = {target: source for source, target in wheel["shared-data"].items()}
    assert len(named) == 2, "that of the daemon and that of the page"
    for url in named:
        assert (UNITS.parent / sources[url.removeprefix("Documentation=file:///opt/lfs10d/")]).is_file()


def test_the_page_has_the_daemons_sandbox_and_no_device() -> None:
    daemon, page = (
        {line for line in (UNITS / name).read_text().splitlines() if line and not line.startswith("#")}
        for name in ("lfs10d.service", "lfs10d-web.service")
    )
    lacking = {line.partition("=")[0] for line in daemon - page}
    assert lacking <= {
        "Description", "Documentation", "After", "Wants", "Type", "NotifyAccess", "ExecStart", "ExecReload",
        "RestartPreventExitStatus", "TimeoutStartSec", "WatchdogSec", "SupplementaryGroups", "StateDirectory",
        "StateDirectoryMode",
        "RuntimeDirectory", "RuntimeDirectoryMode", "ConfigurationDirectory", "DeviceAllow",
    }  # fmt: skip
    assert {"PrivateDevices=yes", "DevicePolicy=closed", "DynamicUser=yes"} <= page


def test_the_units_differ_in_nothing_but_their_instance() -> None:
    plain, instance = ((UNITS / name).read_text().splitlines() for name in ("lfs10d.service", "lfs10d@.service"))

    different = [
        (one, other) for one, other in zip(plain, instance, strict=True) if one != other and not one.startswith("#")
    ]

    assert different == [
        ("Description=lfs10d: RS485 wind sensors to MQTT", "Description=lfs10d: RS485 wind sensors to MQTT (%i)"),
        (
            "ExecStart=/opt/lfs10d/bin/lfs10d run -c /etc/lfs10d/lfs10d.yaml",
            "ExecStart=/opt/lfs10d/bin/lfs10d run -c /etc/lfs10d/%i.yaml",
        ),
        (
            "ExecReload=/bin/sh -c 'exec /opt/lfs10d/bin/lfs10d check -c /etc/lfs10d/lfs10d.yaml >/dev/null'",
            "ExecReload=/bin/sh -c 'exec /opt/lfs10d/bin/lfs10d check -c /etc/lfs10d/%i.yaml >/dev/null'",
        ),
        ("StateDirectory=lfs10d", "StateDirectory=lfs10d-%i"),
        ("RuntimeDirectory=lfs10d", "RuntimeDirectory=lfs10d-%i"),
    ]
