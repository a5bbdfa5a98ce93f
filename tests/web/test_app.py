"""The page's server with an attacker's inputs: every byte goes over a real socket."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from lfs10d.web.guard import COOKIE, POLICY
from tests.support.pages import TOKEN, PageServer, parsed, serving
from tests.web.lines import PLACE, READ, PublishedLine

DESCRIPTORS = Path("/proc/self/fd")


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
    server.answers("line0", {})
    assert server.post("/api/line0/mounting/start", f'{{"names":{names}}}'.encode()) == 400


def test_a_large_head_a_long_address_and_no_http_at_all_are_refused(server: PageServer) -> None:
    assert server.ask("GET /", "x: " + "a" * 40_000)[0] in {0, 400, 431}
    assert server.ask("GET /api/state?" + "a" * 2000)[0] == 414
    assert parsed(server.raw(b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03\r\n\r\n"))[0] in {0, 400}
    assert server.ask("GET /healthz")[0] == 200


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
