"""The page's server with an attacker's inputs: every byte goes over a real socket."""

from __future__ import annotations

import contextlib
import json
import socket
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from lfs10d.web import app, connection
from lfs10d.web.guard import COOKIE, POLICY
from lfs10d.web.viewers import MOST_VIEWERS
from tests.support.pages import TOKEN, PageServer, parsed, received, serving
from tests.web.lines import PLACE, PublishedLine

DESCRIPTORS = Path("/proc/self/fd")
READ = "/api/line0/request/device/read"


@pytest.fixture
def server() -> Iterator[PageServer]:
    with serving() as made:
        made.do(lambda: PublishedLine(line=made.site.line("lfs10d", "line0", PLACE)))
        yield made


def test_what_everybody_may_read(server: PageServer) -> None:
    for path, kind in (
        ("/", "text/html"), ("/line/line0", "text/html"), ("/device/line0/mast", "text/html"),
        ("/static/app.js", "text/javascript"), ("/static/style.css", "text/css"), ("/static/icon.svg", "image/svg+xml"),
        ("/api/state", "application/json"), ("/api/session", "application/json"), ("/healthz", "application/json"),
        ("/metrics", "text/plain"), ("/api/line0/curve/mast", "application/json"),
    ):  # fmt: skip
        status, headers, body = server.ask(f"GET {path}")
        assert (status, headers["content-type"].split(";")[0]) == (200, kind), path
        assert headers["content-security-policy"] == POLICY
        assert headers["x-content-type-options"] == "nosniff"
        assert headers["referrer-policy"] == "no-referrer"
        assert "server" not in headers
        assert body
    assert json.loads(server.ask("GET /api/state")[2])["lines"]["line0"]["order"] == ["mast"]


def test_the_headers_stand_on_refusals_too(server: PageServer) -> None:
    for answer in (server.ask("GET /nothing"), server.ask("GET /", host="evil.example"), server.ask("DELETE /")):
        assert answer[1]["content-security-policy"] == POLICY


def test_the_page_has_no_inline_script_or_style_and_names_no_other_host() -> None:
    import lfs10d.web  # noqa: PLC0415

    folder = Path(lfs10d.web.__file__).parent / "static"
    for file in folder.iterdir():
        text = file.read_text()
        assert "innerHTML" not in text, file.name
        assert "http://" not in text.replace("http://www.w3.org/2000/svg", ""), file.name
        assert "https://" not in text, file.name
    page = (folder / "index.html").read_text()
    assert "style=" not in page
    assert " on" not in page.replace(" on your", "").split("<body>")[0]
    assert page.count("<script") == 1


@pytest.mark.parametrize("host", ["evil.example", "127.0.0.1.evil.example", "", "localhost@evil", "[::1", "a" * 300])
def test_a_foreign_host_gets_nothing(server: PageServer, host: str) -> None:
    for path in ("/", "/api/state", "/metrics"):
        status, _, body = server.ask(f"GET {path}", host=host)
        assert status in {400, 421}
        assert b"line0" not in body


def test_two_hosts_or_none_get_nothing(server: PageServer) -> None:
    two = server.raw(b"GET / HTTP/1.1\r\nHost: localhost\r\nHost: evil.example\r\nConnection: close\r\n\r\n")
    none = server.raw(b"GET / HTTP/1.0\r\n\r\n")
    assert parsed(two)[0] in {400, 421}
    assert parsed(none)[0] == 421


def test_a_request_needs_token_origin_and_header(server: PageServer) -> None:
    sent = server.answers("line0", {}).sent
    assert server.post(READ, b'{"device":"mast"}') == 200
    assert sent == [("device/read", {"device": "mast"})]
    for changed in (
        {"origin": None}, {"origin": "http://evil.example"}, {"origin": "null"}, {"x_lfs10d": None},
        {"origin": f"http://127.0.0.1:{server.port + 1}"}, {"origin": f"http://127.0.0.1:{server.port}.evil.example"},
    ):  # fmt: skip
        assert server.post(READ, **changed) == 403, changed
    assert server.post(READ, token=None) == 401
    assert server.post(READ, token="wrong") == 401  # noqa: S106 - a wrong one
    assert len(sent) == 1, "nothing of that reached the daemon"


def test_nothing_is_changed_by_get(server: PageServer) -> None:
    sent = server.answers("line0", {}).sent
    for path in (READ, "/api/login", "/api/logout", "/api/line0/mounting/start"):
        status, _, _ = server.ask(f"GET {path}", f"authorization: Bearer {TOKEN}", f"origin: {server.address}")
        assert status == 405
    assert sent == []


def test_without_a_token_the_page_is_for_reading_alone() -> None:
    with serving(token=None) as server:
        server.do(lambda: server.site.line("lfs10d", "line0", PLACE))
        assert server.post(READ) == 403
        assert server.post("/api/login", b'{"token":""}') == 403
        assert json.loads(server.ask("GET /api/session")[2]) == {"controls": False, "open": False}
        assert server.ask("GET /api/state")[0] == 200


def test_the_token_is_exchanged_for_a_cookie_that_opens_the_controls(server: PageServer) -> None:
    server.answers("line0", {})
    headers = (f"origin: {server.address}", "x-lfs10d: 1")
    status, answer, _ = server.ask("POST /api/login", *headers, body=json.dumps({"token": TOKEN}).encode())
    cookie = answer["set-cookie"]
    assert status == 200
    assert "HttpOnly" in cookie
    assert "SameSite=Strict" in cookie
    assert TOKEN not in cookie
    value = cookie.split(f"{COOKIE}=")[1].split(";")[0]
    assert server.ask(f"POST {READ}", *headers, f"cookie: {COOKIE}={value}", body=b"{}")[0] == 200
    assert json.loads(server.ask("GET /api/session", f"cookie: {COOKIE}={value}")[2])["open"] is True
    status, answer, _ = server.ask("GET /api/session", f"cookie: {COOKIE}=old")
    assert (status, "Max-Age=0" in answer["set-cookie"]) == (200, True), "a cookie of an older token is taken back"
    assert "Max-Age=0" in server.ask("POST /api/logout", *headers, body=b"{}")[1]["set-cookie"]


def test_after_five_wrong_tokens_even_the_right_one_waits(server: PageServer) -> None:
    server.answers("line0", {})
    for number in range(5):
        assert server.post("/api/login", json.dumps({"token": f"guess-{number}"}).encode()) == 401
    assert server.post("/api/login", json.dumps({"token": TOKEN}).encode()) == 429
    assert server.post(READ) == 429
    assert server.ask("GET /api/state")[0] == 200, "reading goes on"


@pytest.mark.parametrize(
    "path",
    [
        "/static/../app.py", "/static/..%2fapp.py", "/static/%2e%2e/app.py", "/static//etc/passwd", "/static/",
        "/static/%00", "/static/app.py", "/..", "//etc/passwd", "/line/../../etc/passwd", "/api/line0/curve/../state",
        "/static/..\\app.py", "/static/app.js%00.py", "/%2e%2e/%2e%2e/etc/passwd",
    ],
)  # fmt: skip
def test_no_path_leads_out_of_the_page(server: PageServer, path: str) -> None:
    status, _, body = server.ask(f"GET {path}")
    assert status in {400, 404} or body.startswith(b"<!doctype html>")
    assert b"root:" not in body
    assert b"import" not in body[:2000] or body.startswith(b"<!doctype html>")


@pytest.mark.parametrize(
    "path", ["/api/line0/request/DEVICE/read", "/api/line0/request/device/%2b", "/api/line0/request/%23/x",
             "/api/nothing/request/device/read", "/api/line0/mounting/explode"],
)  # fmt: skip
def test_what_is_no_request_is_not_sent(server: PageServer, path: str) -> None:
    sent = server.answers("line0", {}).sent
    assert server.post(path) == 404
    assert sent == []


@pytest.mark.parametrize(
    ("body", "status"),
    [
        (b"[]", 400),
        (b"nonsense", 400),
        (b'{"a":' * 800, 400),
        (b'{"a":"' + b"x" * 5000 + b'"}', 413),
        (b"\xff\xfe", 400),
    ],
)
def test_what_is_no_object_of_parameters_is_refused(server: PageServer, body: bytes, status: int) -> None:
    sent = server.answers("line0", {}).sent
    assert server.post(READ, body) == status
    assert sent == []


@pytest.mark.parametrize(
    "names", ['"x"', '["a","a"]', '["UPPER"]', "[7]", '["../x"]', json.dumps([f"n{each}" for each in range(251)])]
)
def test_names_that_are_none_are_refused(server: PageServer, names: str) -> None:
    assert server.post("/api/line0/mounting/start", f'{{"names":{names}}}'.encode()) == 400


def test_a_large_head_a_long_address_and_no_http_at_all_are_refused(server: PageServer) -> None:
    assert server.ask("GET /", "x: " + "a" * 40_000)[0] in {0, 400, 431}
    assert server.ask("GET /api/state?" + "a" * 2000)[0] == 414
    assert parsed(server.raw(b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03\r\n\r\n"))[0] in {0, 400}
    assert server.ask("GET /healthz")[0] == 200


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


def test_streams_are_limited_and_the_page_is_still_there(server: PageServer) -> None:
    streams = []
    try:
        for _ in range(MOST_VIEWERS):
            stream = server.connect()
            streams.append(stream)
            stream.sendall(f"GET /api/events HTTP/1.1\r\nHost: {server.host}\r\n\r\n".encode())
            assert stream.recv(65536).startswith(b"HTTP/1.1 200")
        assert server.ask("GET /api/events")[0] == 503
        assert server.ask("GET /healthz")[0] == 200
    finally:
        for stream in streams:
            stream.close()


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


def test_a_viewer_that_comes_back_resumes_its_stream(server: PageServer) -> None:
    def first_events(*headers: str) -> str:
        with server.connect() as stream:
            lines = ["GET /api/events HTTP/1.1", f"Host: {server.host}", *headers, "", ""]
            stream.sendall("\r\n".join(lines).encode())
            text = ""
            while "data: " not in text or not text.endswith("\n\n\r\n"):
                text += stream.recv(65536).decode()
            return text

    seen = first_events()
    assert "event: state" in seen
    last = seen.split("id: ")[1].split("\n")[0]
    server.do(lambda: PublishedLine(line=server.site.lines["line0"]).measure(1, 7.5))
    again = first_events(f"Last-Event-ID: {last}")
    assert "event: state" not in again
    assert "event: change" in again
    assert "event: state" in first_events("Last-Event-ID: nonsense")


def test_an_unchanged_file_is_not_sent_again(server: PageServer) -> None:
    status, headers, _ = server.ask("GET /static/app.js")
    assert server.ask("GET /static/app.js", f"if-none-match: {headers['etag']}")[0] == 304
    assert status == 200


def test_the_server_uses_no_more_descriptors_afterwards(server: PageServer) -> None:
    before = len(list(DESCRIPTORS.iterdir()))
    for _ in range(50):
        server.ask("GET /api/state")
    assert len(list(DESCRIPTORS.iterdir())) <= before + 2


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
        while server.do(lambda: len(server._server.server_state.connections)) > connection.MOST_PER_ADDRESS:
            assert time.monotonic() < deadline, "more than permitted"
            time.sleep(0.05)
        assert parsed(received(held[-1]))[0] in {0, 503}
        with socket.create_connection(("127.0.0.1", server.port), 10.0, ("127.0.0.2", 0)) as other:
            other.sendall(f"GET /healthz HTTP/1.1\r\nHost: {server.host}\r\nConnection: close\r\n\r\n".encode())
            assert parsed(received(other))[0] == 200
    finally:
        for each in held:
            each.close()
