"""`lfs10d web` and `lfs10d metrics` at a running daemon."""

from __future__ import annotations

import json
import re
import signal
import socket
import subprocess
from collections.abc import Callable
from http.client import HTTPConnection
from pathlib import Path
from typing import Any

import pytest
from prometheus_client.openmetrics.parser import text_string_to_metric_families

from tests.support.brokers import Authority, Mosquitto, path_of
from tests.support.shells import Shell, running, typed
from tests.support.sites import Site, eventually

NAME = "of-the-page"
"""No other daemon of this machine writes the status of a line of this name into /run/lfs10d."""
NAMED = {"name": NAME}
TOKEN = "correct-horse-battery"  # noqa: S105 - of a test
SECRET = "s3cret-and-long-enough"  # noqa: S105 - as above
AT_ONCE = {
    "lfs10d_build_info", "lfs10d_mqtt_connected", "lfs10d_line_exchanges_total",
    "lfs10d_device_online", "lfs10d_device_wind_speed_meters_per_second", "lfs10d_device_polls_total",
    "lfs10d_device_last_good_timestamp_seconds", "lfs10d_store_samples", "lfs10d_store_dropped_total",
}  # fmt: skip
"""Figures that need no statistics, which come every 30 s."""


class Page:
    """The page of a running `lfs10d web`, asked as a program would."""

    def __init__(self, port: int) -> None:
        self.port = port

    def get(self, path: str, accept: str = "*/*") -> str:
        connection = HTTPConnection("127.0.0.1", self.port, timeout=10)
        connection.request("GET", path, headers={"Accept": accept})
        text = connection.getresponse().read().decode()
        connection.close()
        return text

    @property
    def line(self) -> dict[str, Any]:
        lines: dict[str, Any] = json.loads(self.get("/api/state"))["lines"]
        shown: dict[str, Any] = lines[NAME]
        return shown

    def post(self, path: str, content: dict[str, Any]) -> dict[str, Any]:
        connection = HTTPConnection("127.0.0.1", self.port, timeout=30)
        headers = {"Origin": f"http://127.0.0.1:{self.port}", "X-Lfs10d": "1", "Authorization": f"Bearer {TOKEN}"}
        connection.request("POST", f"/api/{NAME}/{path}", json.dumps(content), headers)
        answer: dict[str, Any] = json.loads(connection.getresponse().read())
        connection.close()
        return answer


@pytest.fixture
def page(site: Site, shell: Shell) -> Callable[..., Page]:
    def start(runtime: Path | None = None) -> Page:
        token = site.file.with_name("token")
        token.write_text(TOKEN + "\n")
        serving = shell.pipe("web", "--listen", "127.0.0.1:0", "--token-file", str(token), runtime=runtime)
        serving.says("Ctrl-C ends it")
        found = re.search(r"http://127\.0\.0\.1:(\d+)/", serving.text)
        assert found
        return Page(int(found[1]))

    return start


def test_the_page_follows_the_daemon_sends_its_requests_and_says_when_it_is_gone(
    site: Site, mosquitto: Mosquitto, page: Callable[..., Page]
) -> None:
    del mosquitto
    run = running(site, line=NAMED)
    shown = page()
    eventually(lambda: shown.line["source"]["kind"] == "broker", "live from the broker")
    device = eventually(lambda: shown.line["devices"].get("mast-top"), "mast-top")
    assert device["label"] == "Mast, 10 m"
    answer = shown.post("request/device/read", {"device": "mast-top"})
    assert (answer["status"], answer["words"], answer["data"]["device"]) == ("ok", "Done.", "mast-top")
    refused = shown.post("request/device/read", {"device": "nobody"})
    assert refused["words"].startswith("Nothing was changed: there is no such device.")
    shown.post("mounting/start", {"names": ["new"]})
    eventually(lambda: shown.line["mounting"]["words"] == "Plug in a sensor.", "mounting")
    shown.post("mounting/stop", {})
    assert shown.line["mounting"]["running"] is False
    assert [(each["name"], each["status"]) for each in shown.line["requests"]] == [
        ("device/read", "ok"), ("device/read", "rejected"),
    ]  # fmt: skip
    for figures in (typed(site, "metrics").stdout, shown.get("/metrics", "application/openmetrics-text")):
        names = {each.name for family in text_string_to_metric_families(figures) for each in family.samples}  # type: ignore[no-untyped-call]  # it has no types
        assert names >= AT_ONCE
    promtool = [path_of("promtool"), "check", "metrics"]
    checked = subprocess.run(promtool, input=shown.get("/metrics"), capture_output=True, text=True, check=False)
    assert (checked.returncode, checked.stdout, checked.stderr) == (0, "", "")
    run.process.kill()
    eventually(lambda: shown.line["source"]["kind"] == "none", "not live", within=5.0)
    assert shown.line["daemon"] == "offline"
    assert f'lfs10d_mqtt_connected{{line="{NAME}"}} 0' in shown.get("/metrics")


def test_without_a_broker_the_page_shows_the_status_file(site: Site, page: Callable[..., Page]) -> None:
    site.line((1, 2))
    site.write(line=NAMED, slaves=[1, {"id": 2, "name": "mast-top"}])
    run = site.run()
    run.ready()
    shown = page(run.status.parent)
    eventually(lambda: shown.line["source"]["kind"] == "status", "live from the status file")
    eventually(lambda: shown.line["devices"]["mast-top"]["online"], "mast-top online")


def test_metrics_without_broker_and_daemon_ends_with_69(site: Site) -> None:
    site.write(line=NAMED)
    done = typed(site, "metrics")
    assert (done.returncode, done.stdout) == (69, "")
    assert done.stderr.startswith("lfs10d: broker 127.0.0.1:")


def test_a_busy_address_ends_with_69_and_a_public_one_without_a_token_with_2(site: Site) -> None:
    site.write(line=NAMED)
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        busy = typed(site, "web", "--listen", f"127.0.0.1:{taken.getsockname()[1]}")
    assert busy.returncode == 69
    assert "in use" in busy.stderr
    public = typed(site, "web", "--listen", "192.0.2.1:8073")
    assert public.returncode == 2
    assert "give a token" in public.stderr


def test_the_page_ends_at_once_when_it_is_told_to(site: Site, shell: Shell) -> None:
    site.write(line=NAMED)
    serving = shell.pipe("web", "--listen", "127.0.0.1:0")
    serving.says("reading only")
    found = re.search(r":(\d+)/", serving.text)
    assert found
    with socket.create_connection(("127.0.0.1", int(found[1]))) as stream:
        stream.sendall(f"GET /api/events HTTP/1.1\r\nHost: 127.0.0.1:{found[1]}\r\n\r\n".encode())
        assert stream.recv(100).startswith(b"HTTP/1.1 200")
        assert serving.ends(signal.SIGTERM) == 0


@pytest.mark.needs("openssl", "mosquitto_passwd")
def test_behind_tls_and_a_password_the_page_is_as_live_and_the_password_shows_nowhere(
    site: Site, mosquitto: Mosquitto, page: Callable[..., Page], authority: Authority, program: Callable[[str], str]
) -> None:
    mosquitto.stop()
    passwords, file = mosquitto.folder / "passwords", site.folder / "password"
    known = [program("mosquitto_passwd"), "-c", "-b", str(passwords), "mast", SECRET]
    subprocess.run(known, check=True, capture_output=True)
    certificate, key = authority.issue("broker", "IP:127.0.0.1")
    mosquitto.listener = [f"certfile {certificate}", f"keyfile {key}"]
    mosquitto.configuration = ["allow_anonymous false", f"password_file {passwords}"]
    mosquitto.start()
    file.touch(mode=0o600)
    file.write_text(f"{SECRET}\n")
    running(site, line=NAMED, mqtt={"tls": {"ca": authority.ca}, "username": "mast", "password_file": str(file)})
    file.write_text("wr0ng-and-long-enough\n")
    shown = page()
    refused = eventually(lambda: "not authori" in (words := shown.line["source"]["words"]) and words, "the refusal")
    assert refused.startswith(f"not live: broker 127.0.0.1:{mosquitto.port}: ")
    file.write_text(f"{SECRET}\n")
    eventually(lambda: shown.line["source"]["kind"] == "broker", "live from the broker", within=40.0)
    assert shown.post("request/device/read", {"device": "mast-top"})["words"] == "Done."
    assert SECRET not in shown.get("/api/state")
