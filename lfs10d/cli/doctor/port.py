"""Examines the serial port: whether it exists, which other programs use it, and the adapter's settings."""

from __future__ import annotations

import grp
import re
import stat
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from lfs10d.cli.doctor.finding import Area, Finding
from lfs10d.cli.port_holder import daemon_behind
from lfs10d.modbus.port_lock import holder
from lfs10d.system.dataclass import dataclass

PORT = Area("port")

CH340: Final = "1a86:7523"
"""USB id that brltty takes for a Braille display, up to Debian 12 and Ubuntu 22.04."""
SLOW_LATENCY: Final = 2
"""Longest latency in ms that costs an exchange less than the silence before it."""
READ_WRITE: Final = stat.S_IRGRP | stat.S_IWGRP
SERVICE_GROUP: Final = "dialout"
"""The unit's SupplementaryGroups=."""
RUNNING: Final = frozenset({"ModemManager", "brltty"})
"""Programs that open serial ports by themselves."""
CONTAINER_MARKS: Final = (".dockerenv", "run/.containerenv", "run/systemd/container")
"""Of docker; of podman and buildah; of LXC, systemd-nspawn and others (systemd's CONTAINER_INTERFACE)."""


@dataclass(frozen=True, slots=True)
class PortState:
    """The state of a port. `""` and None: there is none, or it cannot be seen."""

    path: str
    device: str = ""
    """Where the path leads."""
    is_device: bool = False
    lasting: str = ""
    """The device's name below /dev/serial/by-id or by-path."""
    group: str = ""
    group_may_use: bool = False
    driver: str = ""
    usb_id: str = ""
    latency_ms: int | None = None
    holder: str = ""
    held_by_daemon: bool = False
    console: str = ""
    """Why the port is a console; empty if it is none."""
    mini_uart: bool = False
    running: frozenset[str] = frozenset()
    """Which of `RUNNING` run."""
    container: bool = False


@dataclass(frozen=True, slots=True)
class Root:
    """Where the system's own files are; elsewhere in the tests."""

    path: Path = Path("/")

    def read(self, name: str) -> str:
        """Return a small file's text, "" if it cannot be read."""
        try:
            return (self.path / name).read_text("utf-8", "replace").strip("\0\n ")
        except OSError:
            return ""


def there(path: Path) -> bool:
    """Return whether a path exists; False where that cannot be seen, as in the state of a DynamicUser service."""
    try:
        return path.exists()
    except OSError:
        return False


def look(port: str, root: Root | None = None) -> PortState:
    """Return the state of a port without opening it."""
    root = root or Root()
    running = RUNNING & {root.read(f"proc/{process.name}/comm") for process in (root.path / "proc").glob("[0-9]*")}
    container = any(there(root.path / mark) for mark in CONTAINER_MARKS)
    path = root.path / port.lstrip("/")
    try:
        device = path.resolve(strict=True)
        status = device.stat()
    except (OSError, RuntimeError):
        return PortState(port, running=running, container=container)
    name = device.name
    sys_device = root.path / "sys/class/tty" / name / "device"
    found = holder(str(device), proc=root.path / "proc")
    latency = root.read(f"sys/class/tty/{name}/device/latency_timer")
    return PortState(
        path=port,
        device=f"/{device.relative_to(root.path)}",
        is_device=stat.S_ISCHR(status.st_mode),
        lasting=_lasting(device, root),
        group=_group(status.st_gid),
        group_may_use=status.st_mode & READ_WRITE == READ_WRITE,
        driver=(sys_device / "driver").resolve().name if there(sys_device / "driver") else "",
        usb_id=_usb_id(sys_device, root),
        latency_ms=int(latency) if latency.isdecimal() else None,
        holder="" if found is None else str(found),
        held_by_daemon=found is not None and daemon_behind(found, proc=root.path / "proc") is not None,
        console=_console(name, root),
        mini_uart=name == "ttyS0" and "Raspberry Pi" in root.read("proc/device-tree/model"),
        running=running,
        container=container,
    )


def _lasting(device: Path, root: Root) -> str:
    for folder in ("by-id", "by-path"):
        try:
            links = sorted((root.path / "dev/serial" / folder).iterdir())
        except OSError:
            continue
        for link in links:
            if link.resolve() == device:
                return f"/dev/serial/{folder}/{link.name}"
    return ""


def _group(number: int) -> str:
    try:
        return grp.getgrgid(number).gr_name
    except KeyError:
        return str(number)


def _usb_id(sys_device: Path, root: Root) -> str:
    """Return `vendor:product` of the USB device that a tty belongs to."""
    folder = sys_device.resolve()
    while folder.is_relative_to(root.path) and folder != root.path:
        vendor, product = (root.read(str((folder / name).relative_to(root.path))) for name in ("idVendor", "idProduct"))
        if vendor and product:
            return f"{vendor}:{product}"
        folder = folder.parent
    return ""


def _console(name: str, root: Root) -> str:
    """Return why the port is a console, of the kernel or of a login; empty if it is none."""
    names = {name}
    alias = root.path / "dev/serial0"
    if there(alias) and alias.resolve().name == name:
        names.add("serial0")
    for word in root.read("proc/cmdline").split():
        match = re.fullmatch(r"console=(\w+)(?:,.*)?", word)
        if match and match[1] in names:
            return f"the kernel's console is on it ({word} in its command line)"
    for process in (root.path / "proc").glob("[0-9]*"):
        words = root.read(f"proc/{process.name}/cmdline").split("\0")
        if words[0].endswith("agetty") and names & set(words):
            return f"a login waits on it (process {process.name})"
    return ""


def judge(state: PortState, *, service: bool) -> Iterator[Finding]:
    """Yield the findings about a port; `service`: a service of the system opens it."""
    if not state.device:
        if state.container:
            yield PORT.fail(
                f"{state.path} is not in this container",
                "pass it in (podman, docker: --device): see docs/installation.md",
            )
        else:
            yield PORT.fail(f"{state.path} is absent", "is the adapter plugged in? ls -l /dev/serial/by-id")
        yield from _programs_that_grab(state)
        return
    if not state.is_device:
        yield PORT.fail(f"{state.path} is not a device", "name a serial port: ls -l /dev/serial/by-id")
        return
    kind = " ".join(part for part in (state.driver, state.usb_id) if part)
    yield PORT.ok(f"{state.path} is {state.device}" + (f" ({kind})" if kind else ""))
    if state.lasting and state.path == state.device:
        yield PORT.warn(f"{state.path} may be another adapter after a restart", f"set line.port to {state.lasting}")
    if service and not (state.group == SERVICE_GROUP and state.group_may_use):
        yield PORT.warn(
            f"the service has the group {SERVICE_GROUP}, and {state.device} is for group {state.group}",
            f"sudo systemctl edit lfs10d, section [Service]: SupplementaryGroups={state.group}",
        )
    yield from _holder(state)
    if state.console:
        yield PORT.fail(
            f"{state.device}: {state.console}",
            "Raspberry Pi: sudo raspi-config, Interface, Serial Port: no login shell, hardware on; elsewhere: take "
            f"console= from the kernel's command line and sudo systemctl disable --now serial-getty@{_name(state)}",
        )
    if state.mini_uart:
        yield PORT.warn(
            f"{state.device} is the Pi's mini UART: its rate changes with the processor's clock, and it has no parity",
            "use the PL011 (dtoverlay=disable-bt, port /dev/ttyAMA0) or a USB adapter",
        )
    if state.latency_ms is not None and state.latency_ms > SLOW_LATENCY:
        yield PORT.warn(
            f"the adapter holds bytes back for {state.latency_ms} ms",
            "line.low_latency: true, or the udev rule of docs/installation.md (latency_timer)",
        )
    yield from _programs_that_grab(state)


def _name(state: PortState) -> str:
    return state.device.rpartition("/")[2]


def _holder(state: PortState) -> Iterator[Finding]:
    if state.held_by_daemon:
        yield PORT.ok(f"held by the daemon: {state.holder}")
    elif state.holder:
        yield PORT.fail(f"{state.holder} holds {state.path}", "end that program: only one program may use the line")
    else:
        yield PORT.ok("no other program holds it")


def _programs_that_grab(state: PortState) -> Iterator[Finding]:
    if "ModemManager" in state.running:
        yield PORT.warn(
            "ModemManager runs: it sends AT commands into new serial ports",
            "without a modem: sudo systemctl disable --now ModemManager",
        )
    if "brltty" in state.running:
        level = PORT.fail if state.usb_id == CH340 or not state.device else PORT.warn
        yield level(
            f"brltty runs: it takes CH340 adapters ({CH340}) for Braille displays, and the port vanishes",
            "without a Braille display: sudo apt remove brltty, then plug the adapter in again",
        )
