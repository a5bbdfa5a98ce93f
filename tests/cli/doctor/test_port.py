"""What the doctor says of a port: each fault that a gateway was seen with, and its cure."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from lfs10d.cli.doctor.port import PortState, Root, judge, look

WELL = PortState(
    path="/dev/serial/by-id/usb-FTDI-port0",
    device="/dev/ttyUSB0",
    is_device=True,
    lasting="/dev/serial/by-id/usb-FTDI-port0",
    group="dialout",
    group_may_use=True,
    driver="ftdi_sio",
    usb_id="0403:6001",
    latency_ms=1,
)


def test_a_port_that_is_well_has_no_advice() -> None:
    found = list(judge(WELL, service=True))
    assert [each.level for each in found] == ["ok", "ok"]
    assert found[0].text == "/dev/serial/by-id/usb-FTDI-port0 is /dev/ttyUSB0 (ftdi_sio 0403:6001)"


@pytest.mark.parametrize(
    ("state", "level", "text", "advice"),
    [
        (PortState("/dev/x"), "fail", "is absent", "ls -l /dev/serial/by-id"),
        (PortState("/dev/x", container=True), "fail", "not in this container", "--device"),
        (replace(WELL, is_device=False), "fail", "is not a device", "ls -l /dev/serial/by-id"),
        (
            replace(WELL, path="/dev/ttyUSB0"),
            "warn",
            "another adapter after a restart",
            "line.port to /dev/serial/by-id",
        ),
        (replace(WELL, group="uucp"), "warn", "is for group uucp", "SupplementaryGroups=uucp"),
        (replace(WELL, group_may_use=False), "warn", "is for group dialout", "SupplementaryGroups"),
        (replace(WELL, holder="mbpoll (process 7)"), "fail", "mbpoll (process 7) holds", "end that program"),
        (replace(WELL, console="a login waits on it"), "fail", "a login waits", "serial-getty@ttyUSB0"),
        (replace(WELL, mini_uart=True), "warn", "mini UART", "PL011"),
        (replace(WELL, latency_ms=16), "warn", "16 ms", "latency_timer"),
        (replace(WELL, running=frozenset({"ModemManager"})), "warn", "AT commands", "disable --now ModemManager"),
        (replace(WELL, running=frozenset({"brltty"})), "warn", "brltty runs", "apt remove brltty"),
        (replace(WELL, usb_id="1a86:7523", running=frozenset({"brltty"})), "fail", "brltty runs", "apt remove brltty"),
    ],
)
def test_each_fault_is_named_with_its_cure(state: PortState, level: str, text: str, advice: str) -> None:
    (found,) = [each for each in judge(state, service=True) if each.advice]
    assert found.level == level
    assert text in found.text
    assert advice in found.advice


def test_a_vanished_ch340_is_explained_by_brltty() -> None:
    found = list(judge(PortState("/dev/ttyUSB0", running=frozenset({"brltty"})), service=True))
    assert [(each.level, "brltty" in each.text) for each in found] == [("fail", False), ("fail", True)]


def test_the_group_is_the_service_s_affair() -> None:
    assert not [each for each in judge(replace(WELL, group="uucp"), service=False) if each.advice]


def test_the_daemon_s_own_hold_is_well() -> None:
    found = list(judge(replace(WELL, holder="lfs10d (process 9)", held_by_daemon=True), service=True))
    assert [each.level for each in found] == ["ok", "ok"]


# What the system's files say


class System:
    """A folder in place of /, with an adapter of a driver in it."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def file(self, name: str, text: str = "") -> Path:
        path = self.folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
        return path

    def link(self, name: str, target: str) -> None:
        path = self.folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.symlink_to(target)

    def adapter(self, latency: str = "16\n") -> None:
        self.file("dev/ttyUSB0")
        self.link("dev/serial/by-id/usb-CH340-port0", "../../ttyUSB0")
        usb = "sys/devices/usb1/1-1"
        self.file(f"{usb}/idVendor", "1a86\n")
        self.file(f"{usb}/idProduct", "7523\n")
        self.file(f"{usb}/1-1:1.0/ttyUSB0/latency_timer", latency)
        self.link(f"{usb}/1-1:1.0/ttyUSB0/driver", "../../../../../drivers/ch341-uart")
        (self.folder / "sys/drivers/ch341-uart").mkdir(parents=True)
        self.link("sys/class/tty/ttyUSB0/device", "../../../devices/usb1/1-1/1-1:1.0/ttyUSB0")

    def look(self, port: str) -> PortState:
        return look(port, Root(self.folder))


@pytest.fixture(name="system")
def _system(tmp_path: Path) -> System:
    return System(tmp_path)


def test_the_system_s_files_are_read(system: System) -> None:
    system.adapter()
    system.file("proc/17/comm", "ModemManager\n")
    system.file("proc/18/comm", "bash\n")
    system.file("run/.containerenv")
    seen = system.look("/dev/serial/by-id/usb-CH340-port0")
    assert seen.device == "/dev/ttyUSB0"
    assert seen.lasting == "/dev/serial/by-id/usb-CH340-port0"
    assert (seen.usb_id, seen.latency_ms, seen.driver) == ("1a86:7523", 16, "ch341-uart")
    assert (seen.running, seen.container, seen.is_device) == (frozenset({"ModemManager"}), True, False)


def test_brltty_beside_a_ch340_of_the_system_is_a_fault(system: System) -> None:
    system.adapter()
    system.file("proc/17/comm", "brltty\n")
    seen = replace(system.look("/dev/serial/by-id/usb-CH340-port0"), is_device=True)
    (found,) = [each for each in judge(seen, service=False) if "brltty" in each.text]
    assert (found.level, "remove brltty" in found.advice) == ("fail", True)


@pytest.mark.parametrize("mark", [".dockerenv", "run/.containerenv", "run/systemd/container"])
def test_every_kind_of_container_is_known(mark: str, system: System) -> None:
    system.file(mark, "systemd-nspawn")
    assert system.look("/dev/ttyUSB9") == PortState("/dev/ttyUSB9", container=True)


def test_a_port_that_is_not_there_is_told_apart(system: System) -> None:
    system.file("proc/17/comm", "brltty\n")
    assert system.look("/dev/ttyUSB9") == PortState("/dev/ttyUSB9", running=frozenset({"brltty"}))


@pytest.mark.parametrize(
    ("line", "console"),
    [
        ("quiet console=ttyAMA0,115200 root=x", "the kernel's console is on it (console=ttyAMA0,115200"),
        ("console=serial0,115200", "the kernel's console is on it (console=serial0,115200"),
        ("console=tty1", ""),
    ],
)
def test_the_kernel_s_console_is_found(line: str, console: str, system: System) -> None:
    system.file("dev/ttyAMA0")
    system.link("dev/serial0", "ttyAMA0")
    system.file("proc/cmdline", line)
    assert system.look("/dev/ttyAMA0").console.startswith(console)
    assert bool(system.look("/dev/ttyAMA0").console) is bool(console)


def test_a_waiting_login_and_the_mini_uart_are_found(system: System) -> None:
    system.file("dev/ttyS0")
    system.file("proc/31/cmdline", "/sbin/agetty\0-o\0--keep-baud\0ttyS0\0")
    system.file("proc/device-tree/model", "Raspberry Pi Zero 2 W Rev 1.0\0")
    seen = system.look("/dev/ttyS0")
    assert seen.console == "a login waits on it (process 31)"
    assert seen.mini_uart
