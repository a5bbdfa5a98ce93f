"""The demo's broker: which one, and on which port."""

from __future__ import annotations

import asyncio
import os
import socket
import sys
from pathlib import Path

import pytest

from lfs10d.cli.demo import broker
from lfs10d.cli.demo.broker import is_free, known, listens, start_broker
from lfs10d.cli.demo.processes import Children
from lfs10d.errors import FailedError


def test_a_port_somebody_listens_on_is_not_free(unused_port: int) -> None:
    assert is_free(unused_port)
    with socket.create_server(("127.0.0.1", unused_port)):
        assert not is_free(unused_port)


def test_whoever_listens_on_a_port_is_known() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
        assert listens(os.getpid(), port)
        assert not listens(os.getppid(), port)
    assert not listens(os.getpid(), port)


def test_a_process_that_is_gone_does_not_listen() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        assert not listens(2**22 + 1, server.getsockname()[1])


def test_mosquitto_is_preferred_and_can_be_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("shutil.which", lambda name, path: f"{path}/{name}")
    assert known() == ("mosquitto", "amqtt")
    assert known("amqtt") == ("amqtt",)
    monkeypatch.setattr("shutil.which", lambda name, path: None)  # noqa: ARG005  # the signature of which
    assert known() == ("amqtt",)
    assert known("mosquitto") == ()


def test_without_a_broker_it_says_what_to_install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(broker, "known", lambda _: ())
    with pytest.raises(FailedError, match="apt install mosquitto, or pip install amqtt"):
        asyncio.run(start_broker(Children(tmp_path)))


def test_a_broker_that_does_not_start_is_tried_on_other_ports_and_its_last_words_are_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(broker, "known", lambda _: ("mosquitto",))
    ports = []

    def failing(_: str, port: int, __: Children) -> tuple[str, ...]:
        ports.append(port)
        return (sys.executable, "-S", "-c", "print('no\\x1bway'); raise SystemExit(3)")

    monkeypatch.setattr(broker, "_command", failing)
    with pytest.raises(FailedError, match=r"mosquitto: no\\x1bway"):
        asyncio.run(start_broker(Children(tmp_path)))
    assert len(set(ports)) >= broker.TRIES
