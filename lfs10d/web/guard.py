"""Access to the page: host names, origins, the token. Pure; `now` is monotonic seconds.

Rules
-----
1. A request whose Host is not on the list is refused: a foreign name that was pointed at this machine (DNS rebinding)
   gets nothing. An address is no name, so the address that the connection came to is allowed.
2. A request that changes something comes from our own page: its Origin is its Host, and it carries a header that no
   form and no link can send (`X-Lfs10d`).
3. It carries the token, in a header or by the cookie that the token was exchanged for; both are compared in constant
   time. After five wrong ones within a minute from one address every token from there is refused for a while, the right
   one too.
"""

from __future__ import annotations

import base64
import hashlib
import hmac
import ipaddress
import re
from collections import deque
from collections.abc import Iterable, Mapping
from enum import StrEnum
from typing import Final

from lfs10d.system.dataclass import dataclass
from lfs10d.system.secret import Secret

COOKIE: Final = "lfs10d_session"
HEADER: Final = "x-lfs10d"
"""Carried by every request that changes something; any value."""
WRONG_PER_MINUTE: Final = 5
WRONG_IN_ALL: Final = 60
"""A minute, from all addresses together."""
MINUTE: Final = 60.0
MOST_ADDRESSES: Final = 1024
LONGEST_TOKEN: Final = 1024

POLICY: Final = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self'; connect-src 'self'; manifest-src 'self'; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
HEADERS: Final = (
    ("content-security-policy", POLICY),
    ("x-content-type-options", "nosniff"),
    ("referrer-policy", "no-referrer"),
    ("x-frame-options", "DENY"),
    ("cross-origin-opener-policy", "same-origin"),
    ("cross-origin-resource-policy", "same-origin"),
    ("permissions-policy", "camera=(), geolocation=(), microphone=(), payment=(), usb=()"),
)
"""On every response."""

_HOST: Final = re.compile(r"(?P<name>\[[0-9A-Fa-f:.]{2,45}\]|[A-Za-z0-9._-]{1,253}?)\.?(?::(?P<port>\d{1,5}))?")


class TokenCheck(StrEnum):
    """The result of comparing a token."""

    RIGHT = "right"
    WRONG = "wrong"
    ABSENT = "absent"
    LIMITED = "limited"
    """Too many wrong ones: nothing was compared."""


@dataclass(frozen=True, slots=True)
class Authority:
    """Host and port of a Host header or an Origin; the name in lower case, an IPv6 address without brackets."""

    name: str
    port: int | None

    @classmethod
    def of(cls, text: str) -> Authority | None:
        """Return it; None for what is none."""
        found = _HOST.fullmatch(text)
        if found is None:
            return None
        port = int(found["port"]) if found["port"] else None
        name = found["name"].lower().strip("[]")
        return None if port is not None and port >= 2**16 else cls(name, port)


def loopback(host: str) -> bool:
    """Return whether an address to listen on is reached from this machine alone."""
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host.lower().rstrip(".") == "localhost"


def viewer_of(host: str) -> str:
    """Return the key of a viewer: its address, or of IPv6 its network."""
    return ":".join(host.split(":")[:4]) if host.count(":") > 3 else host  # noqa: PLR2004 - 64 of 128 bits


class HostList:
    """The names under which the page may be asked for."""

    def __init__(self, names: Iterable[str]) -> None:
        self._names = {name.lower().rstrip(".") for name in names} | {"localhost", "127.0.0.1", "::1"}

    def allows(self, host: str | None, arrived_at: str | None) -> bool:
        """Return whether a Host header is on the list; `arrived_at` is our own address of this connection."""
        authority = Authority.of(host) if host is not None else None
        return authority is not None and (authority.name in self._names or authority.name == arrived_at)


def same_origin(origin: str | None, host: str | None) -> bool:
    """Return whether an Origin header names the host that was asked (RFC 6454); a proxy may add TLS before us."""
    scheme, _, rest = (origin or "").partition("://")
    usual = {"http": 80, "https": 443}.get(scheme)
    there, here = Authority.of(rest), Authority.of(host or "")
    if usual is None or there is None or here is None:
        return False
    return there.name == here.name and (there.port or usual) == (here.port or usual)


class Token:
    """The token and the cookie made of it; None: there is none, and nothing may be changed."""

    def __init__(self, token: Secret | None) -> None:
        self._token = token
        self._wrong: dict[str, deque[float]] = {}
        self._all: deque[float] = deque(maxlen=WRONG_IN_ALL)

    @property
    def known(self) -> bool:
        """Whether there is a token."""
        return self._token is not None

    @property
    def cookie(self) -> Secret:
        """What the token is exchanged for: it does not give the token away, and ends with it."""
        key = b"" if self._token is None else self._token.reveal().encode()
        digest = hmac.new(key, b"lfs10d web session", hashlib.sha256).digest()
        return Secret(base64.urlsafe_b64encode(digest).decode().rstrip("="))

    def judge(self, headers: Mapping[str, str], cookies: Mapping[str, str], client: str, now: float) -> TokenCheck:
        """Return what the token of a request is worth: `Authorization: Bearer`, or else the cookie."""
        scheme, _, given = headers.get("authorization", "").partition(" ")
        if scheme.lower() == "bearer":
            return self.check(given.strip(), client, now)
        if COOKIE in cookies:
            return self._compared(cookies[COOKIE], self.cookie, client, now)
        return TokenCheck.ABSENT

    def check(self, given: str, client: str, now: float) -> TokenCheck:
        """Compare a token that was given."""
        return self._compared(given, self._token or Secret(""), client, now)

    def _compared(self, given: str, right: Secret, client: str, now: float) -> TokenCheck:
        if self.limited(client, now):
            return TokenCheck.LIMITED
        if self._token is not None and len(given) <= LONGEST_TOKEN and given.isprintable() and Secret(given) == right:
            return TokenCheck.RIGHT
        if client not in self._wrong and len(self._wrong) >= MOST_ADDRESSES:
            self._wrong = {each: times for each, times in self._wrong.items() if now - times[-1] < MINUTE}
        self._wrong.setdefault(client, deque(maxlen=WRONG_PER_MINUTE)).append(now)
        self._all.append(now)
        return TokenCheck.WRONG

    def limited(self, client: str, now: float) -> bool:
        """Return whether there were too many wrong tokens within the last minute, from there or in all."""
        return _many(self._wrong.get(client), WRONG_PER_MINUTE, now) or _many(self._all, WRONG_IN_ALL, now)


def _many(times: deque[float] | None, most: int, now: float) -> bool:
    return times is not None and len(times) >= most and now - times[0] < MINUTE


def cookies_of(header: str) -> dict[str, str]:
    """Return the cookies of a Cookie header; of two of one name the first, as RFC 6265 orders them."""
    cookies: dict[str, str] = {}
    for each in header.split(";")[:50]:
        name, equals, value = each.strip().partition("=")
        if equals:
            cookies.setdefault(name, value)
    return cookies


def set_cookie(value: str, *, secure: bool) -> str:
    """Return the Set-Cookie header; an empty value removes the cookie."""
    age = 400 * 86_400 if value else 0
    return f"{COOKIE}={value}; Max-Age={age}; Path=/; HttpOnly; SameSite=Strict{'; Secure' if secure else ''}"
