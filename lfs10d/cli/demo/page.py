"""The demo's page: `lfs10d web` beside the daemon, on the loopback, with a token of its own."""

from __future__ import annotations

import importlib.util
import re
import secrets
import socket
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from lfs10d.cli.demo.broker import LOOPBACK
from lfs10d.cli.demo.processes import PYTHON, Children

USUAL_PORT: Final = 8073
_ADDRESS: Final = re.compile(r"http://[0-9.:]+/")


@dataclass(frozen=True, slots=True)
class Page:
    """The running page: its address, and the token that opens its controls."""

    address: str
    token: str


async def start_page(children: Children, configuration: Path) -> Page | None:
    """Start the page and return it; None where its extra is not installed, or it does not start."""
    if not (importlib.util.find_spec("starlette") and importlib.util.find_spec("uvicorn")):
        return None
    token, token_file = secrets.token_hex(8), children.folder / "web-token"
    token_file.touch(mode=0o600)
    token_file.write_text(token)
    port = USUAL_PORT if _is_free(USUAL_PORT) else 0
    child = children.start(
        "page",
        *(*PYTHON, "-m", "lfs10d", "web", "-c", str(configuration)),
        *("--listen", f"{LOOPBACK}:{port}", "--token-file", str(token_file)),
    )
    if not await children.ready(child, lambda: _ADDRESS.search(child.log.read_text(errors="replace")) is not None):
        await children.discard(child)
        return None
    found = _ADDRESS.search(child.log.read_text(errors="replace"))
    return None if found is None else Page(found[0], token)


def _is_free(port: int) -> bool:
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((LOOPBACK, port))
        except OSError:
            return False
    return True
