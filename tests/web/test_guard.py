"""Host, Origin and token with an attacker's inputs."""

from __future__ import annotations

import pytest

from lfs10d.system.secret import Secret
from lfs10d.web.guard import (
    COOKIE,
    LONGEST_TOKEN,
    MOST_ADDRESSES,
    POLICY,
    WRONG_IN_ALL,
    Authority,
    HostList,
    Token,
    TokenCheck,
    cookies_of,
    loopback,
    same_origin,
    set_cookie,
    viewer_of,
)

TOKEN = "correct-horse-battery"  # noqa: S105 - of a test
HERE = "192.0.2.1"


def verdict(token: Token, given: str, now: float = 0.0, client: str = HERE) -> TokenCheck:
    return token.judge({"authorization": f"Bearer {given}"}, {}, client, now)


@pytest.mark.parametrize(
    "host",
    ["localhost", "LOCALHOST:8073", "localhost.", "127.0.0.1:8073", "[::1]:8073", "roof.example:80", "10.0.0.5:8073"],
)
def test_an_own_name_is_allowed(host: str) -> None:
    assert HostList(["roof.example"]).allows(host, "10.0.0.5")


@pytest.mark.parametrize(
    "host",
    [
        None, "", "evil.example", "evil.example:8073", "localhost.evil.example", "127.0.0.1.evil.example", "127.0.0.2",
        "10.0.0.6", "localhost:99999", "localhost:", "localhost:80:80", "localhost/", "user@localhost", "local host",
        "localhost\r\nx: y", "[::1", "[::1]x", "0x7f.1", "a" * 300, "xn--lcalhost-0za",
    ],
)  # fmt: skip
def test_a_foreign_name_is_refused(host: str | None) -> None:
    assert not HostList(["roof.example"]).allows(host, "10.0.0.5")


def test_without_an_own_address_only_names_count() -> None:
    assert not HostList([]).allows("10.0.0.5", None)


def test_a_viewer_is_an_address_and_of_ipv6_a_whole_network() -> None:
    assert [viewer_of(each) for each in ("192.0.2.7", "2001:db8:1:2:3:4:5:6", "::1")] == [
        "192.0.2.7", "2001:db8:1:2", "::1",
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("origin", "host"),
    [
        ("http://localhost:8073", "localhost:8073"),
        ("http://roof.example", "roof.example"),
        ("http://roof.example:80", "roof.example"),
        ("https://roof.example", "roof.example:443"),
        ("https://roof.example", "roof.example"),
        ("http://[::1]:8073", "[::1]:8073"),
    ],
)
def test_our_own_origin(origin: str, host: str) -> None:
    assert same_origin(origin, host)


@pytest.mark.parametrize(
    ("origin", "host"),
    [
        (None, "localhost:8073"), ("", "localhost:8073"), ("null", "localhost:8073"),
        ("http://evil.example", "localhost:8073"), ("http://localhost", "localhost:8073"),
        ("http://localhost:8074", "localhost:8073"), ("ftp://localhost:8073", "localhost:8073"),
        ("http://localhost:8073/", "localhost:8073"), ("http://localhost:8073@evil.example", "localhost:8073"),
        ("http://localhost:8073", None), ("http://localhost:8073", ""), ("http://roof.example", "roof.example:443"),
        ("file://", "localhost:8073"), ("http://localhost.evil.example:8073", "localhost:8073"),
    ],
)  # fmt: skip
def test_a_foreign_origin(origin: str | None, host: str | None) -> None:
    assert not same_origin(origin, host)


def test_an_authority_without_brackets_and_in_lower_case() -> None:
    assert Authority.of("[2001:DB8::1]:80") == Authority("2001:db8::1", 80)


@pytest.mark.parametrize(
    ("host", "own"),
    [
        ("127.0.0.1", True), ("127.9.9.9", True), ("::1", True), ("localhost", True), (".".join("0000"), False),
        ("::", False), ("192.168.1.2", False), ("roof", False),
    ],
)  # fmt: skip
def test_which_addresses_others_reach(host: str, own: bool) -> None:  # noqa: FBT001 - a claim
    assert loopback(host) is own


def test_the_right_token_and_its_cookie_open_the_controls() -> None:
    token = Token(Secret(TOKEN))
    assert verdict(token, TOKEN) is TokenCheck.RIGHT
    assert token.judge({"authorization": f"bearer  {TOKEN} "}, {}, HERE, 0.0) is TokenCheck.RIGHT
    assert token.judge({}, {COOKIE: token.cookie.reveal()}, HERE, 0.0) is TokenCheck.RIGHT
    assert token.known


def test_the_cookie_does_not_give_the_token_away_and_ends_with_it() -> None:
    cookie = Token(Secret(TOKEN)).cookie.reveal()
    assert TOKEN not in cookie
    assert Token(Secret("another-token-of-mine")).judge({}, {COOKIE: cookie}, HERE, 0.0) is TokenCheck.WRONG


@pytest.mark.parametrize("given", ["", "x", TOKEN[:-1], TOKEN + "x", TOKEN.upper(), "x" * (LONGEST_TOKEN + 1), "é"])
def test_a_wrong_token_opens_nothing(given: str) -> None:
    assert verdict(Token(Secret(TOKEN)), given) is TokenCheck.WRONG


def test_nothing_given_is_no_attempt() -> None:
    token = Token(Secret(TOKEN))
    for _ in range(100):
        assert token.judge({"authorization": "Basic eDp5"}, {}, HERE, 0.0) is TokenCheck.ABSENT
    assert verdict(token, TOKEN) is TokenCheck.RIGHT


def test_without_a_token_nothing_is_right() -> None:
    token = Token(None)
    assert not token.known
    assert verdict(token, "") is TokenCheck.WRONG
    assert token.judge({}, {COOKIE: token.cookie.reveal()}, HERE, 0.0) is TokenCheck.WRONG


def test_after_five_wrong_tokens_in_a_minute_the_right_one_is_refused_too() -> None:
    token = Token(Secret(TOKEN))
    assert [verdict(token, "wrong", now) for now in range(5)] == [TokenCheck.WRONG] * 5
    assert verdict(token, TOKEN, 5.0) is TokenCheck.LIMITED
    assert token.judge({}, {COOKIE: token.cookie.reveal()}, HERE, 59.9) is TokenCheck.LIMITED
    assert verdict(token, TOKEN, 6.0, "192.0.2.2") is TokenCheck.RIGHT, "another address goes on"
    assert verdict(token, TOKEN, 60.1) is TokenCheck.RIGHT, "a minute after the first of them"


def test_cookies_are_guessed_no_faster_than_tokens() -> None:
    token = Token(Secret(TOKEN))
    verdicts = [token.judge({}, {COOKIE: f"guess-{number}"}, HERE, 0.0) for number in range(6)]
    assert verdicts == [TokenCheck.WRONG] * 5 + [TokenCheck.LIMITED]


def test_many_addresses_together_are_limited_too() -> None:
    token = Token(Secret(TOKEN))
    for number in range(WRONG_IN_ALL):
        assert verdict(token, "wrong", 0.0, f"2001:db8::{number}") is TokenCheck.WRONG
    assert verdict(token, TOKEN, 1.0) is TokenCheck.LIMITED
    assert verdict(token, TOKEN, 61.0) is TokenCheck.RIGHT


def test_addresses_are_forgotten_after_a_minute() -> None:
    token = Token(Secret(TOKEN))
    for number in range(MOST_ADDRESSES + 10):
        verdict(token, "wrong", number * 2.0, f"192.0.2.{number}")
    assert len(token._wrong) < 100


def test_the_policy_allows_no_foreign_source_and_no_inline_script() -> None:
    assert POLICY.startswith("default-src 'none'")
    assert "unsafe" not in POLICY
    assert "http" not in POLICY
    assert "*" not in POLICY


def test_cookies_as_they_come() -> None:
    assert cookies_of(f"a=1; {COOKIE}=x=y; {COOKIE}=z; nonsense; =") == {"a": "1", COOKIE: "x=y", "": ""}
    assert len(cookies_of("; ".join(f"c{number}=1" for number in range(1000)))) == 50


def test_the_cookie_is_of_this_site_alone_and_hidden_from_scripts() -> None:
    made = set_cookie("v", secure=False)
    assert made.startswith(f"{COOKIE}=v; ")
    assert "HttpOnly" in made
    assert "SameSite=Strict" in made
    assert "Secure" not in made
    assert set_cookie("v", secure=True).endswith("; Secure")
    assert "Max-Age=0" in set_cookie("", secure=False)
