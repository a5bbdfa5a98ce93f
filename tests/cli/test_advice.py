"""The warnings of `lfs10d check`."""

from __future__ import annotations

from pathlib import Path

import pytest

from lfs10d.cli.advice import advice, loopback
from lfs10d.config.loader import load
from lfs10d.line.budget import budget


@pytest.fixture(autouse=True)
def in_a_folder_of_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def warnings(text: str, *, host: str = "gateway", name: str = "lfs10d.yaml") -> list[str]:
    Path(name).write_text(text)
    found = load(Path(name), files=False, environment={}, host=host)
    told = advice(found, budget(found.config, found.profiles), host)
    assert all(warning.message.startswith("warning: ") for warning in told)
    return [f"{warning.line}:{warning.column}: {warning.path}: {warning.message[9:]}" for warning in told]


LINE = "line: {port: /dev/x}\n"
REMOTE = "mqtt: {host: broker, base_topic: site, username: me, tls: {}}\n"


@pytest.mark.parametrize(
    ("text", "beginnings"),
    [
        (LINE + "slaves: [2]", []),
        (LINE + "slaves: [2]\n" + REMOTE, []),
        (
            LINE + f"slaves: {list(range(1, 42))}",
            ["2:9: slaves: the intervals ask for 102.5% of what the line carries: every"],
        ),
        (
            LINE + f"poll: {{interval: 100ms}}\nslaves: {list(range(1, 5))}",
            ["2:18: poll.interval: the intervals ask for 120.0% of what the line carries if the devices take 5ms to"],
        ),
        (
            LINE + "slaves: [2, {id: 3, interval: 250ms, request_gap: 500ms}]",
            ["2:13: slaves[1]: one poll takes 526ms with the rest before each request (request_gap): it will be"],
        ),
        (LINE + "slaves: [{id: 3, request_gap: 500ms}]", []),
        (LINE, ["1:1: slaves: there are no slaves"]),
        (LINE + "slaves: [{id: 2, enabled: false}]", ["2:9: slaves: no slave is enabled"]),
        (
            LINE + "slaves: [2]\nmqtt: {host: broker, base_topic: site}",
            ["3:14: mqtt.host: the broker is remote and needs no login"],
        ),
        (
            LINE + "slaves: [2]\nmqtt: {host: broker, base_topic: site, username: me}",
            ["3:50: mqtt.username: the password crosses the network unencrypted"],
        ),
        (LINE + "slaves: [2]\nmqtt: {host: broker, base_topic: site, tls: {cert: c}}", []),
        (
            LINE + "slaves: [2]\nmqtt: {host: broker, username: me, tls: {}}",
            ["3:7: mqtt: line.name and mqtt.base_topic are both defaults"],
        ),
        ("line: {port: x, name: a}\nslaves: [2]\nmqtt: {host: broker, username: me, tls: {}}", []),
        (
            LINE + "slaves: [2]\nwind: {every: 10s}\nhomeassistant: {discovery: true}",
            [],
        ),
    ],
)
def test_what_is_allowed_but_hardly_meant_is_told(text: str, beginnings: list[str]) -> None:
    found = warnings(text)
    assert len(found) == len(beginnings)
    for warning, beginning in zip(found, beginnings, strict=True):
        assert warning.startswith(beginning)


@pytest.mark.parametrize(
    ("client_id", "host", "warned"),
    [
        ("", "raspberrypi", True),
        (", client_id: null", "raspberrypi", True),
        (", client_id: wind-%H", "raspberrypi", True),
        (", client_id: north", "raspberrypi", False),
        ("", "gateway", False),
    ],
)
def test_a_client_id_made_of_a_host_name_that_many_have_is_told(client_id: str, host: str, *, warned: bool) -> None:
    text = LINE + f"slaves: [2]\nmqtt: {{host: broker, base_topic: site, username: me, tls: {{}}{client_id}}}\n"
    found = warnings(text, host=host)
    assert [warning.split(": ")[1] for warning in found] == (["mqtt.client_id"] if warned else [])


def test_a_broker_that_nobody_configured_is_this_host_s() -> None:
    assert warnings(LINE + "slaves: [2]", host="raspberrypi") == []


def test_a_file_whose_name_is_no_name_for_a_line_is_told() -> None:
    assert warnings(LINE + "slaves: [2]", name="North Mast.yaml") == [
        '1:7: line: the file\'s name "North Mast" is no name for a line, so line.name is north-mast; set it'
    ]


@pytest.mark.parametrize(
    ("host", "here"),
    [
        ("localhost", True),
        ("LOCALHOST.", True),
        ("broker.localhost", True),
        ("127.0.0.1", True),
        ("127.8.0.1", True),
        ("::1", True),
        ("192.0.2.7", False),
        ("broker", False),
        ("localhost.example.org", False),
    ],
)
def test_a_loopback_is_known_by_its_name(host: str, *, here: bool) -> None:
    assert loopback(host) is here


WITH_FILES = LINE + "slaves: [2]\nmqtt: {host: localhost, username: me, password_file: pw, tls: {ca: ca.pem}}"


@pytest.mark.parametrize(("content", "count"), [("hunter2\n", 0), ("hunter2 \n", 1), ("\u00e4\t", 1)])
def test_a_password_that_ends_with_a_space_is_told_and_never_shown(content: str, count: int) -> None:
    Path("pw").write_text(content)
    message = "the password ends with a space, which is part of it: remove it unless it is meant"
    assert warnings(WITH_FILES) == [f"3:54: mqtt.password_file: {message}"] * count


def test_an_authority_that_strict_clients_refuse_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("lfs10d.cli.advice.missing_in_authorities", lambda _file: ("key usage", "a horse"))
    (told,) = warnings(WITH_FILES)
    assert told.startswith("3:68: mqtt.tls.ca: an authority without key usage and a horse (RFC 5280")


@pytest.mark.parametrize(
    ("hosts", "count"),
    [("localhost", 0), ("[localhost, 127.0.0.1]", 0), ("[localhost, broker]", 1), ("[broker, b]", 1)],
)
def test_a_broker_is_remote_where_one_of_its_nodes_is(hosts: str, count: int) -> None:
    told = warnings(LINE + f"slaves: [2]\nmqtt: {{host: {hosts}, base_topic: site}}")
    assert len(told) == count
    assert all(": the broker is remote and needs no login" in each for each in told)
