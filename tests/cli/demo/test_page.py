"""The demo's page."""

from __future__ import annotations

import asyncio
import importlib.util
import json
import re
import socket
import urllib.request
from pathlib import Path

import pytest

from lfs10d.cli.demo import page
from lfs10d.cli.demo.page import begin_page, finish_page
from lfs10d.cli.demo.processes import Children


def _read(address: str) -> str:
    with urllib.request.urlopen(address) as answer:  # noqa: S310  # of our own
        text: str = answer.read().decode()
    return text


async def _shown(folder: Path) -> tuple[str, str, int]:
    """Return the page's address and what it says of itself, and the mode of its token's file."""
    configuration = folder / "lfs10d.yaml"
    configuration.write_text("line: {port: /dev/null}\nslaves: [2]\nmqtt: {host: 127.0.0.1, port: 1}\n")
    children = Children(folder)
    try:
        running = await finish_page(children, begin_page(children, configuration))
        assert running is not None
        text = await asyncio.to_thread(_read, running.address + "healthz")
        return running.address, text, (folder / "web-token").stat().st_mode & 0o777
    finally:
        await children.end()


def test_the_page_is_on_the_loopback_and_its_token_is_for_us_alone(tmp_path: Path) -> None:
    address, text, mode = asyncio.run(_shown(tmp_path))
    assert re.fullmatch(r"http://127\.0\.0\.1:\d+/", address)
    assert json.loads(text)["status"] == "ok"
    assert mode == 0o600


def test_where_another_took_the_usual_port_at_the_last_moment_it_is_on_another(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(page, "is_free", lambda _: True)
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        taken = other.getsockname()[1]
        monkeypatch.setattr(page, "USUAL_PORT", taken)
        address, text, _ = asyncio.run(_shown(tmp_path))
        assert not address.endswith(f":{taken}/")
        assert json.loads(text)["status"] == "ok"


def test_without_its_extra_there_is_no_page(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(importlib.util, "find_spec", lambda _: None)
    assert begin_page(Children(tmp_path), tmp_path / "lfs10d.yaml") is None
    assert asyncio.run(finish_page(Children(tmp_path), None)) is None
