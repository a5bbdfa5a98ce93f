"""The demo's broker: mosquitto where it is installed, else amqtt; on the loopback, on a port that is free."""

from __future__ import annotations

import importlib.util
import os
import shutil
import socket
from collections.abc import Iterator
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Final

from lfs10d.cli.demo.processes import PYTHON, Children
from lfs10d.errors import FailedError
from lfs10d.system.dataclass import dataclass

LOOPBACK: Final = "127.0.0.1"
USUAL_PORT: Final = 1883
_LISTEN: Final = "0A"
"""TCP_LISTEN in hexadecimal, as /proc/net/tcp writes it."""
TRIES: Final = 3
"""Starts of a broker whose port was taken by another program just before."""

_PLACES: Final = os.pathsep.join((os.environ.get("PATH", os.defpath), "/usr/local/sbin", "/usr/sbin", "/sbin"))
"""Debian keeps daemons in /usr/sbin, which is not on a user's PATH."""


@dataclass(frozen=True, slots=True)
class Broker:
    """A running broker; `speaks` is the newest version of MQTT it knows."""

    name: str
    speaks: str
    port: int


def known(wanted: str = "auto") -> tuple[str, ...]:
    """Return the brokers that are installed, the better first; only `wanted` if that is one of them."""
    found = {"mosquitto": shutil.which("mosquitto", path=_PLACES), "amqtt": importlib.util.find_spec("amqtt")}
    return tuple(name for name, there in found.items() if there and wanted in {"auto", name})


async def start_broker(children: Children, wanted: str = "auto") -> Broker:
    """Start the first broker that runs; raises FailedError if none does."""
    last_words = []
    for name in known(wanted):
        for port in _ports():
            child = children.start(name, *_command(name, port, children))
            if await children.ready(child, partial(listens, child.process.pid, port)):
                return Broker(name, "5" if name == "mosquitto" else "3.1.1", port)
            last_words.append(f"{name}: {child.last_words()}")
            await children.discard(child)
    reasons = "".join(f" ({words})" for words in last_words[-1:])
    raise FailedError(
        f"no broker could be started{reasons}: apt install mosquitto, or pip install amqtt into "
        + os.environ.get("VIRTUAL_ENV", "this environment")
    )


def _command(name: str, port: int, children: Children) -> tuple[str, ...]:
    if name == "amqtt":
        return (*PYTHON, "-m", "lfs10d.cli.demo.amqtt_broker", str(port))
    lines = [f"listener {port} {LOOPBACK}", "allow_anonymous true", "persistence false", "log_dest stderr"]
    if os.geteuid() == 0:
        lines.append("user root")  # by itself it would change to another, and no longer end with its parent
    file = children.folder / "mosquitto.conf"
    file.write_text("\n".join(lines) + "\n")
    return (str(shutil.which(name, path=_PLACES)), "-c", str(file))


def _ports() -> Iterator[int]:
    """Yield the usual port if it is free, then others that are."""
    if is_free(USUAL_PORT):
        yield USUAL_PORT
    for _ in range(TRIES):
        with socket.socket() as probe:
            probe.bind((LOOPBACK, 0))
            port = int(probe.getsockname()[1])
        yield port


def is_free(port: int) -> bool:
    """Say whether a program of ours could listen on this port of the loopback now."""
    try:
        # It sets SO_REUSEADDR, as brokers do: a connection of before that is still fading away is no hindrance.
        socket.create_server((LOOPBACK, port)).close()
    except OSError:
        return False
    return True


def listens(process: int, port: int) -> bool:
    """Return whether this process listens on this TCP port: another program may have taken it."""
    # proc(5): local address, state and inode are columns 1, 3 and 9.
    rows = [line.split() for line in Path("/proc/net/tcp").read_text("ascii").splitlines()[1:]]
    listening = {f"socket:[{row[9]}]" for row in rows if row[1].endswith(f":{port:04X}") and row[3] == _LISTEN}
    with suppress(OSError):  # it may have ended
        return any(str(descriptor.readlink()) in listening for descriptor in Path(f"/proc/{process}/fd").iterdir())
    return False
