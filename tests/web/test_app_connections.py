"""Many, slow and deaf clients of the page's server, over real sockets."""

from __future__ import annotations

import contextlib
import select
import socket
import time

import pytest

from lfs10d.web import app, connection
from lfs10d.web.viewers import MOST_OF_ONE, MOST_VIEWERS
from tests.support.pages import PageServer, parsed, received


def test_two_hundred_idle_connections_keep_nobody_out(server: PageServer) -> None:
    with server.connect() as viewer:
        viewer.sendall(f"GET /api/events HTTP/1.1\r\nHost: {server.host}\r\n\r\n".encode())
        seen = b""
        while b"event: state" not in seen:
            seen += viewer.recv(65536)
        idle = [server.connect() for _ in range(200)]
        try:
            assert server.ask("GET /healthz")[0] == 200
            viewer.settimeout(5.0)
            assert viewer.recv(65536), "who watches goes on watching"
        finally:
            for each in idle:
                each.close()


def stream(server: PageServer, address: str) -> socket.socket:
    """Return a stream of a viewer at another address of this machine, with the status line read."""
    viewer = socket.create_connection(("127.0.0.1", server.port), timeout=10.0, source_address=(address, 0))
    viewer.sendall(f"GET /api/events HTTP/1.1\r\nHost: {server.host}\r\n\r\n".encode())
    return viewer


def test_streams_are_limited_in_all_and_of_one_address_and_the_page_is_still_there(server: PageServer) -> None:
    streams = []

    def opened(address: str) -> bool:
        streams.append(stream(server, address))
        return streams[-1].recv(65536).startswith(b"HTTP/1.1 200")

    try:
        assert all(opened("127.0.0.2") for _ in range(MOST_OF_ONE))
        assert not opened("127.0.0.2")
        assert all(opened("127.0.0.3") for _ in range(MOST_VIEWERS - MOST_OF_ONE)), "another is not kept out"
        assert not opened("127.0.0.4")
        assert server.ask("GET /healthz")[0] == 200
    finally:
        for each in streams:
            each.close()


def test_who_sends_slowly_is_disconnected(server: PageServer, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(connection, "HEAD_WITHIN", 0.5)
    began = time.monotonic()
    with server.connect() as slow:
        slow.sendall(b"GET / HTTP/1.1\r\nHost: loc")
        assert received(slow) == b""
    with server.connect() as idle:
        assert received(idle) == b""
    assert time.monotonic() - began < 10


def test_who_does_not_read_is_disconnected(server: PageServer, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(connection, "WRITES_WITHIN", 0.5)
    with server.connect() as deaf:
        for _ in range(3000):
            try:
                deaf.sendall(f"GET /static/style.css HTTP/1.1\r\nHost: {server.host}\r\n\r\n".encode())
            except OSError:
                break
            if server.do(lambda: not server._server.server_state.connections):
                break
        deadline = time.monotonic() + 10
        while server.do(lambda: bool(server._server.server_state.connections)):
            assert time.monotonic() < deadline, "the connection is still there"
            time.sleep(0.05)


def test_who_sends_a_body_slowly_is_answered_and_disconnected(
    server: PageServer, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(app, "BODY_WITHIN", 0.5)
    for sized in ("Content-Length: 40\r\n\r\n{", "Transfer-Encoding: chunked\r\n\r\n1\r\n{\r\n"):
        lines = f"POST /api/login HTTP/1.1\r\nHost: {server.host}\r\nOrigin: {server.address}\r\nX-Lfs10d: 1\r\n{sized}"
        assert parsed(server.raw(lines.encode()))[0] == 408


def test_two_hundred_bodies_that_never_end_keep_out_nobody_from_another_address(server: PageServer) -> None:
    lines = f"POST /api/login HTTP/1.1\r\nHost: {server.host}\r\nOrigin: {server.address}\r\nX-Lfs10d: 1\r\n"
    held = []
    try:
        for _ in range(200):
            held.append(server.connect())
            with contextlib.suppress(OSError):  # it was refused
                held[-1].sendall(f"{lines}Content-Length: 40\r\n\r\n{{".encode())
        deadline = time.monotonic() + 10
        # The kernel does not hand them over in the order in which they came: which are refused is not known.
        while len(refused := select.select(held, [], [], 0)[0]) < len(held) - connection.MOST_PER_ADDRESS:
            assert time.monotonic() < deadline, "more than permitted"
            time.sleep(0.05)
        while server.do(lambda: len(server._server.server_state.connections)) > connection.MOST_PER_ADDRESS:
            assert time.monotonic() < deadline, "more than permitted"
            time.sleep(0.05)
        assert {parsed(received(each))[0] for each in refused} <= {0, 503}
        with socket.create_connection(("127.0.0.1", server.port), 10.0, ("127.0.0.2", 0)) as other:
            other.sendall(f"GET /healthz HTTP/1.1\r\nHost: {server.host}\r\nConnection: close\r\n\r\n".encode())
            assert parsed(received(other))[0] == 200
    finally:
        for each in held:
            each.close()
