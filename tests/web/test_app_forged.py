"""Requests that no browser of ours sends: foreign origins, tokens elsewhere, two lengths, other protocols."""

from __future__ import annotations

import json

import pytest

from lfs10d.web.guard import COOKIE
from tests.support.pages import TOKEN, PageServer, parsed
from tests.web.lines import READ


@pytest.mark.parametrize("method", ["DELETE", "PUT", "PATCH", "OPTIONS", "TRACE", "CONNECT", "PROPFIND", "GET\tX"])
def test_other_methods_do_nothing_and_allow_no_other_origin(server: PageServer, method: str) -> None:
    sent = server.answers("line0", {}).sent
    for path in (READ, "/api/state", "/"):
        status, headers, _ = server.ask(
            f"{method} {path}", "Origin: http://evil.example", f"Authorization: Bearer {TOKEN}", "X-Lfs10d: 1"
        )
        assert status in {400, 404, 405}
        assert not [name for name in headers if name.startswith("access-control-")]
    assert sent == []


def test_the_right_cookie_from_a_foreign_page_opens_nothing(server: PageServer) -> None:
    sent = server.answers("line0", {}).sent
    cookie = f"cookie: {COOKIE}={server.do(server.token.cookie.reveal)}"
    for headers in (
        ("origin: http://evil.example", "x-lfs10d: 1"), (f"origin: {server.address}",), ("x-lfs10d: 1",),
        (f"referer: {server.address}/", "x-lfs10d: 1"), ("origin: null", "x-lfs10d: 1"),
        (f"origin: https://{server.host}", "x-lfs10d: 1", "origin: http://evil.example"),
    ):  # fmt: skip
        assert server.ask(f"POST {READ}", cookie, *headers, body=b"{}")[0] == 403, headers
    assert sent == []


def test_the_token_is_taken_from_nowhere_else(server: PageServer) -> None:
    sent = server.answers("line0", {}).sent
    own = (f"origin: {server.address}", "x-lfs10d: 1")
    for path, headers, body in (
        (f"{READ}?token={TOKEN}", own, b"{}"), (READ, own, json.dumps({"token": TOKEN}).encode()),
        (READ, (*own, f"x-token: {TOKEN}"), b"{}"), (READ, (*own, f"cookie: token={TOKEN}"), b"{}"),
        (READ, (*own, f"authorization: Basic {TOKEN}"), b"{}"), (READ, (*own, f"cookie: {COOKIE}={TOKEN}"), b"{}"),
    ):  # fmt: skip
        assert server.ask(f"POST {path}", *headers, body=body)[0] == 401, (path, headers)
    assert sent == []


@pytest.mark.parametrize(
    "given", ['"\\ud800"', '"\\u0000"', "7", "null", "[]", '"' + "x" * 2000 + '"', '""'], ids=lambda given: given[:9]
)
def test_a_token_that_can_be_none_is_wrong(server: PageServer, given: str) -> None:
    assert server.post("/api/login", f'{{"token":{given}}}'.encode(), token=None) == 401


def test_a_forged_address_does_not_help_to_guess(server: PageServer) -> None:
    for number in range(5):
        forged = (
            f"x-forwarded-for: 192.0.2.{number}",
            f"forwarded: for=192.0.2.{number}",
            f"x-real-ip: 192.0.2.{number}",
        )
        head = (*forged, f"origin: {server.address}", "x-lfs10d: 1", "authorization: Bearer wrong")
        assert server.ask(f"POST {READ}", *head, body=b"{}")[0] == 401
    assert server.post(READ, x_forwarded_for="192.0.2.77") == 429


@pytest.mark.parametrize("body", [b'{"a":NaN}', b'{"a":[1e999]}', b'{"a":-Infinity}'])
def test_what_only_python_takes_for_json_is_refused(server: PageServer, body: bytes) -> None:
    sent = server.answers("line0", {}).sent
    assert server.post(READ, body) == 400
    assert sent == []


def test_an_answer_that_is_no_json_is_made_some(server: PageServer) -> None:
    server.answers(
        "line0", {"device/read": {"status": "ok", "data": {"value": float("nan"), "more": 1}, "words": "Done."}}
    )
    head = (f"origin: {server.address}", "x-lfs10d: 1", f"authorization: Bearer {TOKEN}")
    assert json.loads(server.ask(f"POST {READ}", *head, body=b"{}")[2])["data"] == {"value": None, "more": 1}


@pytest.mark.parametrize(
    "head",
    [
        b"content-length: 2\r\ncontent-length: 44\r\n\r\n{}",
        b"content-length: 2\r\ntransfer-encoding: chunked\r\n\r\n0\r\n\r\n",
        b"transfer-encoding: xchunked\r\n\r\n0\r\n\r\n", b"content-length: -1\r\n\r\n", b"content-length: 1e3\r\n\r\n",
        b"transfer-encoding : chunked\r\n\r\n0\r\n\r\n", b"x: a\rb\r\n\r\n", b"x: a\0b\r\n\r\n",
    ],
)  # fmt: skip
def test_a_request_of_which_two_readers_would_differ_is_refused(server: PageServer, head: bytes) -> None:
    sent = server.answers("line0", {}).sent
    lines = f"POST {READ} HTTP/1.1\r\nHost: {server.host}\r\nOrigin: {server.address}\r\nX-Lfs10d: 1\r\n"
    smuggled = f"GET /api/state HTTP/1.1\r\nHost: {server.host}\r\n\r\n".encode()
    answer = server.raw(f"{lines}Authorization: Bearer {TOKEN}\r\n".encode() + head + smuggled)
    assert parsed(answer)[0] == 400
    assert answer.count(b"HTTP/1.1 ") == 1, "what follows is not read"
    assert sent == []


def test_the_rest_of_a_body_that_is_too_large_is_no_next_request(server: PageServer) -> None:
    lines = f"POST {READ} HTTP/1.1\r\nHost: {server.host}\r\nOrigin: {server.address}\r\nX-Lfs10d: 1\r\n"
    body = b'{"a":"' + b"x" * 5000 + f"GET /api/state HTTP/1.1\r\nHost: {server.host}\r\n\r\n".encode()
    for sized in (f"Content-Length: {10 * len(body)}\r\n\r\n".encode() + body,
                  f"Transfer-Encoding: chunked\r\n\r\n{len(body):x}\r\n".encode() + body + b"\r\n"):  # fmt: skip
        answer = server.raw(f"{lines}Authorization: Bearer {TOKEN}\r\n".encode() + sized)
        assert parsed(answer)[0] == 413
        assert answer.count(b"HTTP/1.1 ") == 1


@pytest.mark.parametrize(
    "target", ["http://evil.example/", "evil.example:80", "*", "/%0d%0aset-cookie:x=y", "/line/\u00e9"]
)
def test_a_strange_target_gets_no_more_than_a_page(server: PageServer, target: str) -> None:
    status, headers, body = server.ask(f"GET {target}")
    assert status in {400, 404} or body.startswith(b"<!doctype html>")
    assert "set-cookie" not in headers
    assert "location" not in headers


def test_no_other_protocol_is_spoken(server: PageServer) -> None:
    upgrade = ("Upgrade: websocket", "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==", "Sec-WebSocket-Version: 13")
    for path in ("/api/events/", "/", "/api/state"):
        assert server.ask(f"GET {path}", *upgrade)[0] != 101
    assert parsed(server.raw(b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n"))[0] in {0, 400, 421}
