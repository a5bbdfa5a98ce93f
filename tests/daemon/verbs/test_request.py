"""`lfs10d request`."""

from __future__ import annotations

import json
import re
import signal
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.support.brokers import Mosquitto
from tests.support.shells import BASE, Shell, running, typed
from tests.support.sites import Site, View, eventually


def test_a_request_prints_what_came_of_it_for_people(site: Site, mosquitto: Mosquitto) -> None:
    del mosquitto
    running(site)
    done = typed(site, "request", "device/read", "device=mast-top")
    assert (done.returncode, done.stderr) == (0, "")
    first, second = done.stdout.splitlines()
    assert re.fullmatch(r"device/read: ok, \d+ ms", first)
    assert re.fullmatch(
        r"mast-top: wind_speed [\d.]+ m/s, good, answered in [\d.]+ ms, at [-\d]+ [\d:.]+ [A-Z]+", second
    )


def test_a_request_prints_the_whole_response_for_programs(site: Site, mosquitto: Mosquitto) -> None:
    del mosquitto
    running(site)
    done = typed(site, "request", "device/read", "device=mast-top", "id=a1", "--json")
    response = json.loads(done.stdout)
    assert (done.returncode, response["id"], response["status"]) == (0, "a1", "ok")
    assert response["data"]["device"] == "mast-top"
    refused = typed(site, "request", "device/read", "device=nobody", "--json")
    assert (refused.returncode, refused.stderr) == (1, "")
    assert json.loads(refused.stdout)["error"]["code"] == "unknown_device"


def test_a_request_that_is_not_obeyed_says_why_and_ends_with_1(site: Site, mosquitto: Mosquitto) -> None:
    del mosquitto
    running(site)
    for arguments, words in (
        (("device/read", "device=nobody"), "device/read: rejected: unknown_device: there is no device nobody"),
        (("device/read", "devcie=mast-top"), "invalid_param: devcie: is no parameter of this request; it takes device"),
        (("line/trace", "for=11m"), "invalid_param: for: must be a duration"),
        (("no/such",), "rejected: unknown_request: no such request; known are: config/get"),
    ):
        done = typed(site, "request", *arguments)
        assert (done.returncode, done.stdout) == (1, "")
        assert words in done.stderr


def test_health_is_a_table(site: Site, mosquitto: Mosquitto) -> None:
    del mosquitto
    running(site)
    done = typed(site, "request", "health")
    assert done.returncode == 0
    gust = r" +[\d.]+" if "value gust 10m state" in done.stdout else ""  # 3 s after the start of the daemon
    assert re.search(rf"^  mast-top +2 +[\d.]+ m/s{gust} +good ", done.stdout, re.MULTILINE)
    assert "broker connected" in done.stdout


def test_by_3_1_1_a_request_is_answered_by_its_id(site: Site, mosquitto: Mosquitto) -> None:
    del mosquitto
    running(site, mqtt={"version": "3.1.1"})
    for arguments in (("device/read", "device=mast-top"), ("device/read", "device=mast-top", "transaction=t")):
        assert typed(site, "request", *arguments).returncode == 0
    assert "unknown_request" in typed(site, "request", "no/such").stderr


def test_a_verb_by_5_understands_a_daemon_that_speaks_3_1_1(site: Site, mosquitto: Mosquitto) -> None:
    del mosquitto
    running(site, mqtt={"version": "3.1.1"})
    site.write(slaves=[1, 2])
    assert typed(site, "request", "republish").returncode == 0


def test_without_a_broker_a_request_ends_with_69_and_says_what_to_check(site: Site) -> None:
    site.write()
    done = typed(site, "request", "health")
    assert (done.returncode, done.stdout) == (69, "")
    assert "connection refused: is the broker running" in done.stderr
    assert len(done.stderr.splitlines()) == 1


def test_without_a_daemon_a_request_ends_with_69_at_once(site: Site, mosquitto: Mosquitto) -> None:
    site.write()
    done = typed(site, "request", "health")
    assert done.returncode == 69
    assert "no daemon has ever published at lfs10d/line0" in done.stderr
    mosquitto.publish(f"{BASE}/availability", "offline", retain=True)
    done = typed(site, "request", "health", "--timeout", "1h")
    assert done.returncode == 69
    assert "the daemon of lfs10d/line0 is offline" in done.stderr


def test_a_request_nobody_answers_in_time_ends_with_1(site: Site, mosquitto: Mosquitto) -> None:
    mosquitto.publish(f"{BASE}/availability", "online", retain=True)
    mosquitto.subscribe(f"{BASE}/request/#")
    site.write()
    done = typed(site, "request", "health", "--timeout", "300ms")
    assert done.returncode == 1
    assert done.stderr == "lfs10d: no response to health within 300ms; it may or may not have been carried out\n"


def test_where_nobody_takes_requests_that_is_said_without_waiting(site: Site, mosquitto: Mosquitto) -> None:
    mosquitto.publish(f"{BASE}/availability", "online", retain=True)
    site.write()
    done = typed(site, "request", "health", "--timeout", "1h")
    assert done.returncode == 69
    assert "no subscriber for requests" in done.stderr


def test_a_daemon_that_goes_away_before_it_answers_ends_a_request_with_69(
    site: Site, mosquitto: Mosquitto, shell: Shell
) -> None:
    somebody = mosquitto.subscribe(f"{BASE}/request/#")
    mosquitto.publish(f"{BASE}/availability", "online", retain=True)
    site.write()
    asking = shell.pipe("request", "health", "--timeout", "1h")
    somebody.wait_for(f"{BASE}/request/health")
    mosquitto.publish(f"{BASE}/availability", "offline", retain=True)
    assert asking.ends() == 69
    assert "went offline before it answered" in asking.text


def test_a_broker_that_goes_away_before_the_answer_ends_a_request_with_69(
    site: Site, mosquitto: Mosquitto, shell: Shell
) -> None:
    somebody = mosquitto.subscribe(f"{BASE}/request/#")
    mosquitto.publish(f"{BASE}/availability", "online", retain=True)
    site.write()
    asking = shell.pipe("request", "health", "--timeout", "1h")
    somebody.wait_for(f"{BASE}/request/health")
    mosquitto.kill()
    assert asking.ends() == 69
    assert "health may or may not have been carried out" in asking.text


def test_a_login_of_ones_own_comes_before_the_file_s(
    site: Site, mosquitto: Mosquitto, program: Callable[[str], str], tmp_path: Path
) -> None:
    passwords = tmp_path / "passwords"
    passwords.touch(0o600)
    subprocess.run(
        [program("mosquitto_passwd"), "-b", str(passwords), "operator", "secret"], check=True, capture_output=True
    )
    mosquitto.stop()
    mosquitto.configuration = ["allow_anonymous false", f"password_file {passwords}"]
    mosquitto.start()
    secret = tmp_path / "secret"
    secret.write_text("secret\n")
    unreadable = {"username": "daemon", "password_file": str(tmp_path / "not-there")}
    site.write(mqtt=unreadable)
    login = ("--username", "operator", "--password-file", str(secret))
    assert "no daemon has ever published" in typed(site, "request", "health", *login).stderr
    wrong = typed(site, "request", "health", "--username", "operator")
    assert wrong.returncode == 69
    assert "wrong user name or password" in wrong.stderr or "not authorized" in wrong.stderr
    assert typed(site, "request", "health").returncode == 78
    missing = typed(site, "request", "health", "--username", "x", "--password-file", str(tmp_path / "not-there"))
    assert (missing.returncode, "--password-file" in missing.stderr) == (2, True)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("device/read", "device"), "is not KEY=VALUE"),
        (("device/read", "device=a", "device=b"), "device is given twice"),
        (("device/+",), "is not a request; known are: config/get"),
        (("device//read",), "is not a request"),
        (("health", "--timeout", "soon"), "not a duration"),
        (("health", f"x={'y' * 4096}"), "more than the 4096 bytes"),
    ],
)
def test_a_slip_on_the_command_line_is_an_error_of_usage(site: Site, arguments: tuple[str, ...], words: str) -> None:
    site.write()
    done = typed(site, "request", *arguments)
    assert done.returncode == 2
    assert words in done.stderr


def test_on_a_terminal_something_turns_while_a_request_waits_and_is_gone_afterwards(
    site: Site, mosquitto: Mosquitto, shell: Shell
) -> None:
    mosquitto.subscribe(f"{BASE}/request/#")
    mosquitto.publish(f"{BASE}/availability", "online", retain=True)
    site.write()
    asking = shell.terminal("request", "health", "--timeout", "1500ms")
    assert asking.ends() == 1
    assert "health ... 1 s" in asking.text
    assert asking.raw.rpartition(b"\x1b[K")[2].startswith(b"lfs10d: no response")


def test_ctrl_c_ends_a_request_with_1_and_no_traceback(site: Site, mosquitto: Mosquitto, shell: Shell) -> None:
    somebody = mosquitto.subscribe(f"{BASE}/request/#")
    mosquitto.publish(f"{BASE}/availability", "online", retain=True)
    site.write()
    for number in (signal.SIGINT, signal.SIGTERM):
        asking = shell.pipe("request", "health", "--timeout", "1h")
        somebody.wait_for(f"{BASE}/request/health", len([*shell.running]))
        assert asking.ends(number) == 1
        assert asking.text.strip() == "lfs10d: health was sent; this does not cancel it"


def test_a_device_may_be_given_by_its_slave_id(site: Site, mosquitto: Mosquitto) -> None:
    del mosquitto
    running(site)
    done = typed(site, "request", "device/read", "device=2", "--json")
    assert json.loads(done.stdout)["data"]["device"] == "mast-top"
    nobody = typed(site, "request", "device/read", "device=99")
    assert "unknown_device: there is no device 99" in nobody.stderr


def test_a_scan_by_request_shows_its_progress_and_a_table(site: Site, mosquitto: Mosquitto, shell: Shell) -> None:
    del mosquitto
    running(site)
    done = typed(site, "request", "line/scan", "ids=1-4", "baudrates=[19200]")
    assert done.returncode == 0
    _, head, first, second = done.stdout.splitlines()
    assert head.split() == ["id", "baud", "answers", "in", "what", "it", "is", "remark"]
    assert re.fullmatch(r" 1  19200 +\d+ ms  LFS10 .* polled as slave-1; the factory id", first)
    assert re.fullmatch(r" 2  19200 +\d+ ms  LFS10 .* polled as mast-top", second)
    assert re.search(r"^\d+ %, about \d+ s to go$", done.stderr, re.MULTILINE)
    drawn = shell.terminal("request", "line/scan", "ids=1-4", "baudrates=[19200]")
    drawn.says("baud, id ")
    drawn.says("polled as")


def test_ctrl_c_ends_the_scan_too_and_shows_what_was_found(
    site: Site, mosquitto: Mosquitto, shell: Shell, view: View
) -> None:
    del mosquitto
    running(site)
    scanning = shell.pipe("request", "line/scan")
    eventually(lambda: any(each["type"] == "scan_progress" for each in view.history_of("event")), "the scan has begun")
    assert scanning.ends(signal.SIGINT) == 1
    assert "line/scan: failed: cancelled: the scan was ended after" in scanning.text
