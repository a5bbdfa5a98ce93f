"""The page's addresses: the response of each, and who may request it."""

from __future__ import annotations

import asyncio
import hashlib
import json
import re
import time
from collections.abc import Awaitable, Callable
from importlib import resources
from typing import Any, Final

from starlette.applications import Starlette
from starlette.requests import ClientDisconnect, Request
from starlette.responses import JSONResponse, PlainTextResponse, Response
from starlette.routing import Route
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from lfs10d import __version__
from lfs10d.cli.client import parsed
from lfs10d.commands.message import LARGEST
from lfs10d.schema.fields import Name
from lfs10d.web import metrics
from lfs10d.web.actions import DEEPEST_DATA, Answer
from lfs10d.web.connection import LARGEST_HEAD
from lfs10d.web.guard import (
    HEADER,
    HEADERS,
    HostList,
    Token,
    TokenCheck,
    cookies_of,
    same_origin,
    set_cookie,
    viewer_of,
)
from lfs10d.web.pruned import pruned
from lfs10d.web.viewers import Viewers

BODY_WITHIN: Final = 10.0
"""s for the body of a request."""
LONGEST_QUERY: Final = 1024
MOST_NAMES: Final = 250
_WORD: Final = re.compile(r"[a-z_]{1,32}")
_TYPES: Final = {
    "html": "text/html; charset=utf-8",
    "css": "text/css; charset=utf-8",
    "js": "text/javascript; charset=utf-8",
    "svg": "image/svg+xml",
    "webmanifest": "application/manifest+json",
}

Endpoint = Callable[[Request], Awaitable[Response]]


def application(viewers: Viewers, token: Token, hosts: HostList) -> ASGIApp:
    """Return the application, behind its guard."""
    pages = _Pages(viewers, token)
    routes = [
        Route("/healthz", pages.healthz),
        Route("/metrics", pages.metrics),
        Route("/api/state", pages.state),
        Route("/api/events", viewers.events),
        Route("/api/session", pages.session),
        Route("/api/login", pages.login, methods=["POST"]),
        Route("/api/logout", pages.logout, methods=["POST"]),
        Route("/api/{line}/curve/{device}", pages.curve),
        Route("/api/{line}/request/{noun}", pages.request, methods=["POST"]),
        Route("/api/{line}/request/{noun}/{verb}", pages.request, methods=["POST"]),
        Route("/api/{line}/mounting/{what}", pages.mounting, methods=["POST"]),
        Route("/static/{file}", pages.static),
        Route("/", pages.page),
        Route("/line/{line}", pages.page),
        Route("/device/{line}/{device}", pages.page),
    ]
    return _Guard(Starlette(routes=routes), hosts)


class _Guard:
    """Refuses foreign hosts and puts the security headers on every response."""

    def __init__(self, app: ASGIApp, hosts: HostList) -> None:
        self._app = app
        self._hosts = hosts

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            return
        named = [value.decode("latin-1") for name, value in scope["headers"] if name == b"host"]
        kinds = {name for name, _ in scope["headers"]}
        server = scope.get("server")

        async def guarded(message: Message) -> None:
            if message["type"] == "http.response.start":
                given = {name for name, _ in message["headers"]}
                added = [(name.encode(), value.encode()) for name, value in HEADERS]
                message["headers"] = [*message["headers"], *added]
                if b"cache-control" not in given:
                    message["headers"].append((b"cache-control", b"no-store"))
            await send(message)

        app = self._app
        if len(named) != 1 or not self._hosts.allows(named[0], server[0] if server else None):
            text = "This name is not one of the page's own; start lfs10d web with --allow-host NAME to permit it.\n"
            app = PlainTextResponse(text, 421)
        elif sum(len(name) + len(value) for name, value in scope["headers"]) > LARGEST_HEAD:
            app = PlainTextResponse("The headers are too large.\n", 431)
        elif {b"content-length", b"transfer-encoding"} <= kinds:  # RFC 9112, section 6.1: an attempt at smuggling
            app = PlainTextResponse("The length of the body is given twice.\n", 400, headers={"connection": "close"})
        elif len(scope["query_string"]) > LONGEST_QUERY:
            app = PlainTextResponse("The address is too long.\n", 414)
        await app(scope, receive, guarded)


class _Pages:
    def __init__(self, viewers: Viewers, token: Token) -> None:
        self._viewers = viewers
        self._token = token
        self._files = _static_files()

    async def healthz(self, request: Request) -> Response:
        """Report that the server runs."""
        del request
        return JSONResponse({"status": "ok", "version": __version__, **self._viewers.figures()})

    async def metrics(self, request: Request) -> Response:
        """Return the figures for Prometheus."""
        openmetrics = metrics.openmetrics_wanted(request.headers.get("accept", ""))
        self._viewers.look()
        written = metrics.text(self._viewers.site.lines.values(), time.time(), openmetrics=openmetrics)
        kind = metrics.OPENMETRICS if openmetrics else metrics.PROMETHEUS
        return Response(written, headers={"content-type": kind, "vary": "accept"})

    async def state(self, request: Request) -> Response:
        """Return everything as JSON."""
        del request
        return Response(self._viewers.whole(), media_type="application/json")

    async def curve(self, request: Request) -> Response:
        """Return the last hour of a device."""
        line = self._viewers.site.lines.get(request.path_params["line"])
        curve = None if line is None else line.curves.get(request.path_params["device"])
        points = [] if curve is None else curve.points(0, curve.newest - 1)
        return JSONResponse({"v": 1, "points": points})

    async def session(self, request: Request) -> Response:
        """Return whether this viewer may change anything; a cookie of an older token is removed."""
        checked = self._judge(request)
        body = {"controls": self._token.known, "open": checked is TokenCheck.RIGHT}
        response = _refused(checked) if checked is TokenCheck.LIMITED else JSONResponse(body)
        if checked is TokenCheck.WRONG:
            response.headers["set-cookie"] = set_cookie("", secure=_over_tls(request))
        return response

    async def login(self, request: Request) -> Response:
        """Exchange the token for a cookie."""
        if (foreign := _foreign(request)) is not None:
            return foreign
        content = await _content(request)
        if isinstance(content, Response):
            return content
        given = content.get("token")
        if not self._token.known:
            return _problem(403, "not_allowed", "this page has no token, so it is for reading alone")
        checked = self._token.check(given if isinstance(given, str) else "", _client(request), time.monotonic())
        if checked is not TokenCheck.RIGHT:
            return _refused(checked)
        response = JSONResponse({"status": "ok"})
        response.headers["set-cookie"] = set_cookie(self._token.cookie.reveal(), secure=_over_tls(request))
        return response

    async def logout(self, request: Request) -> Response:
        """Remove the cookie."""
        if (foreign := _foreign(request)) is not None:
            return foreign
        response = JSONResponse({"status": "ok"})
        response.headers["set-cookie"] = set_cookie("", secure=_over_tls(request))
        return response

    async def request(self, request: Request) -> Response:
        """Send a request to a daemon and return its response."""
        words = [request.path_params[key] for key in ("noun", "verb") if key in request.path_params]
        content = await self._permitted(request)
        if isinstance(content, Response):
            return content
        if not all(_WORD.fullmatch(word) for word in words):
            return _problem(404, "unknown_request", "there is no such request")
        actions = self._viewers.actions(request.path_params["line"])
        if actions is None:
            return _problem(404, "unknown_line", "there is no such line")
        return _answered(await actions.request("/".join(words), content))

    async def mounting(self, request: Request) -> Response:
        """Begin or end the mounting of sensors."""
        content = await self._permitted(request)
        if isinstance(content, Response):
            return content
        actions = self._viewers.actions(request.path_params["line"])
        what = request.path_params["what"]
        if actions is None or what not in {"start", "stop"}:
            return _problem(404, "unknown_line", "there is no such line")
        if what == "stop":
            return _answered(await actions.stop_mounting())
        names = content.get("names", [])
        if not isinstance(names, list) or len(names) > MOST_NAMES or len(set(map(str, names))) < len(names):
            return _problem(400, "invalid_param", "names is a list of different names")
        wrong = next((each for each in names if not isinstance(each, str) or not Name.pattern.fullmatch(each)), None)
        if wrong is not None:
            return _problem(400, "invalid_param", f"{str(wrong)[:40]!r} is not {Name().words}")
        return _answered(actions.mount(names))

    async def static(self, request: Request) -> Response:
        """Return a file of the page."""
        found = self._files.get(request.path_params["file"])
        if found is None:
            return _problem(404, "not_found", "there is no such file")
        return _file(found, request)

    async def page(self, request: Request) -> Response:
        """Return the page; which line or device it shows is decided in the browser."""
        return _file(self._files["index.html"], request)

    def _judge(self, request: Request) -> TokenCheck:
        cookies = cookies_of(request.headers.get("cookie", ""))
        return self._token.judge(request.headers, cookies, _client(request), time.monotonic())

    async def _permitted(self, request: Request) -> dict[str, Any] | Response:
        """Return the parameters of a request that may change something, or why it may not."""
        if (foreign := _foreign(request)) is not None:
            return foreign
        if not self._token.known:
            return _problem(403, "not_allowed", "this page has no token, so it is for reading alone")
        checked = self._judge(request)
        return await _content(request) if checked is TokenCheck.RIGHT else _refused(checked)


def _static_files() -> dict[str, tuple[str, bytes, str]]:
    """Return the files of the page by name: type, content, and a tag of the content."""
    files = {}
    for each in resources.files("lfs10d.web").joinpath("static").iterdir():
        kind = _TYPES.get(each.name.rpartition(".")[2])
        if kind is not None:
            content = each.read_bytes()
            files[each.name] = (kind, content, f'"{hashlib.sha256(content).hexdigest()[:16]}"')
    return files


def _file(found: tuple[str, bytes, str], request: Request) -> Response:
    kind, content, tag = found
    headers = {"content-type": kind, "etag": tag, "cache-control": "no-cache"}
    if request.headers.get("if-none-match") == tag:
        return Response(status_code=304, headers=headers)
    return Response(content, headers=headers)


def _foreign(request: Request) -> Response | None:
    """Return the refusal of a request that does not come from our own page."""
    headers, origins = request.headers, request.headers.getlist("origin")
    if len(origins) != 1 or not same_origin(origins[0], headers.get("host")) or HEADER not in headers:
        words = "it needs an Origin equal to the Host, and a header X-Lfs10d"
        return _problem(403, "foreign", f"this request does not come from the page itself: {words}")
    return None


async def _content(request: Request) -> dict[str, Any] | Response:
    """Return the JSON object in the body, empty where there is no body."""
    body = bytearray()
    try:
        async with asyncio.timeout(BODY_WITHIN):
            async for chunk in request.stream():
                body += chunk
                if len(body) > LARGEST:
                    return _problem(413, "too_large", f"the parameters have more than {LARGEST} bytes")
    except (TimeoutError, ClientDisconnect):
        return _problem(408, "timeout", "the request did not come to its end in time")
    content = parsed(bytes(body)) if body else {}
    if not isinstance(content, dict) or not _json(content):
        return _problem(400, "invalid_json", "the body is a JSON object with the parameters")
    return content


def _json(content: object) -> bool:
    """Return whether it can be written as JSON: Python also reads `NaN` and `1e999`, which nobody else does."""
    try:
        json.dumps(content, allow_nan=False)
    except ValueError:
        return False
    return True


def _answered(answer: Answer) -> Response:
    body = answer.body if _json(answer.body) else pruned(answer.body, DEEPEST_DATA)
    return Response(json.dumps(body), answer.code, media_type="application/json")


def _refused(checked: TokenCheck) -> Response:
    if checked is TokenCheck.LIMITED:
        response = _problem(429, "rate_limited", "too many wrong tokens: wait a minute, then try again")
        response.headers["retry-after"] = "60"
        return response
    if checked is TokenCheck.WRONG:
        return _problem(401, "wrong_token", "the token is wrong")
    return _problem(401, "no_token", "this needs the token")


def _problem(code: int, name: str, words: str) -> Response:
    body = {"status": "rejected", "error": {"code": name, "message": words}, "words": f"{words[0].upper()}{words[1:]}."}
    # A body that was not read would be taken for the next request.
    return JSONResponse(body, code, headers={"connection": "close"} if code in {408, 413} else None)


def _client(request: Request) -> str:
    return viewer_of(request.client.host if request.client else "?")


def _over_tls(request: Request) -> bool:
    return request.headers.get("origin", "").startswith("https://")
