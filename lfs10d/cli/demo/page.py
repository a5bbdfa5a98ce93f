"""The demo's page: `lfs10d web` beside the daemon, on the loopback, with a token of its own."""

from __future__ import annotations

import importlib.util
import re
import secrets
from pathlib import Path
from typing import Final

from lfs10d.cli.demo.broker import LOOPBACK, is_free
from lfs10d.cli.demo.processes import PYTHON, Child, Children
from lfs10d.system.dataclass import dataclass

USUAL_PORT: Final = 8073
_KEY_FILE: Final = "web-token"
_ADDRESS: Final = re.compile(r"http://[0-9.:]+/")


@dataclass(frozen=True, slots=True)
class Page:
    """The running page: its address, and the token that opens its controls."""

    address: str
    token: str


@dataclass(frozen=True, slots=True)
class StartingPage:
    """The page's process, the file it takes its lines from, and the token it was given."""

    child: Child
    configuration: Path
    token: str


def begin_page(children: Children, configuration: Path) -> StartingPage | None:
    """Start the page's process; None where its extra is not installed."""
    if not (importlib.util.find_spec("starlette") and importlib.util.find_spec("uvicorn")):
        return None
    token, token_file = secrets.token_hex(8), children.folder / _KEY_FILE
    token_file.touch(mode=0o600)
    token_file.write_text(token)
    child = _start(children, configuration, USUAL_PORT if is_free(USUAL_PORT) else 0)
    return StartingPage(child, configuration, token)


def _start(children: Children, configuration: Path, port: int) -> Child:
    return children.start(
        "page",
        *(*PYTHON, "-m", "lfs10d", "web", "-c", str(configuration)),
        *("--listen", f"{LOOPBACK}:{port}", "--token-file", str(children.folder / _KEY_FILE)),
    )


async def finish_page(children: Children, starting: StartingPage | None) -> Page | None:
    """Wait for the page; None where there is none, or it does not start."""
    if starting is None:
        return None
    address = await _address(children, starting.child)
    if address is None:  # another program took the usual port in between, such as a second demo
        address = await _address(children, _start(children, starting.configuration, 0))
    return None if address is None else Page(address, starting.token)


async def _address(children: Children, child: Child) -> str | None:
    """Wait for the address that the page prints; None where it does not start, and is ended."""

    def printed() -> str | None:
        found = _ADDRESS.search(child.log.read_text(errors="replace"))
        return None if found is None else found[0]

    await children.ready(child, lambda: printed() is not None)
    address = printed()
    if address is None:
        await children.discard(child)
    return address
