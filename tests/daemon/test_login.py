"""TLS and passwords: what is checked, what a person is told, and that no secret shows."""

from __future__ import annotations

import contextlib
import signal
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.support.brokers import Authority, Mosquitto
from tests.support.sites import Run, Site, View, eventually, good

SECRET = "s3cret-and-long-enough"  # noqa: S105 - of a broker that lives for one test
WRONG = "wr0ng-and-long-enough"

CORES_ALLOWED = """
import os, resource, runpy, sys
hard = resource.getrlimit(resource.RLIMIT_CORE)[1]
resource.setrlimit(resource.RLIMIT_CORE, (hard, hard))
os.chdir(os.environ["CORES"])
runpy.run_module("lfs10d", run_name="__main__")
"""
"""The daemon, where the system lets it leave as large a core as it can in the folder `CORES`."""

pytestmark = pytest.mark.needs("openssl", "mosquitto_passwd")


def with_tls(mosquitto: Mosquitto, certificate: tuple[str, str], *lines: str) -> None:
    """Restart the broker with a certificate of its own."""
    mosquitto.stop()
    mosquitto.listener = [f"certfile {certificate[0]}", f"keyfile {certificate[1]}", *lines]
    mosquitto.start()


def refused(run: Run, words: str) -> None:
    """Assert that the certificate is refused, in these words, and that it is tried again."""
    run.says(words)
    run.ready()
    assert run.process.poll() is None


def test_a_broker_is_trusted_whose_authority_and_name_are_right(
    site: Site, mosquitto: Mosquitto, authority: Authority
) -> None:
    with_tls(mosquitto, authority.issue("broker", "IP:127.0.0.1"))
    site.line()
    site.write(mqtt={"tls": {"ca": authority.ca}})

    run = site.run()

    run.says("connected by MQTT 5")


def test_a_certificate_for_another_name_is_refused(site: Site, mosquitto: Mosquitto, authority: Authority) -> None:
    with_tls(mosquitto, authority.issue("other", "DNS:elsewhere.example"))
    site.write(mqtt={"tls": {"ca": authority.ca}})

    refused(site.run(), "IP address mismatch")


def test_a_certificate_that_expired_is_refused(site: Site, mosquitto: Mosquitto, authority: Authority) -> None:
    with_tls(mosquitto, authority.issue("old", "IP:127.0.0.1", days=-1))
    site.write(mqtt={"tls": {"ca": authority.ca}})

    refused(site.run(), "certificate has expired")


def test_a_certificate_of_an_unknown_authority_is_refused(
    site: Site, mosquitto: Mosquitto, authority: Authority
) -> None:
    with_tls(mosquitto, authority.issue("broker", "IP:127.0.0.1"))
    site.write(mqtt={"tls": {}})  # the system's authorities

    refused(site.run(), "unable to get local issuer certificate")


def test_our_own_certificate_is_shown_where_the_broker_wants_one(
    site: Site, mosquitto: Mosquitto, authority: Authority
) -> None:
    with_tls(
        mosquitto, authority.issue("broker", "IP:127.0.0.1"),
        f"cafile {authority.ca}", "require_certificate true", "use_identity_as_username true",
    )  # fmt: skip
    certificate, key = authority.issue("mast", "DNS:mast")
    site.write(mqtt={"tls": {"ca": authority.ca, "cert": certificate, "key": key}})

    run = site.run()

    run.says("connected by MQTT 5")
    assert "u'mast'" in mosquitto.log


def with_password(mosquitto: Mosquitto, password: str, program: Callable[[str], str]) -> None:
    """Restart the broker so that it knows user `mast` by this password."""
    mosquitto.stop()
    passwords = mosquitto.folder / "passwords"
    subprocess.run(
        [program("mosquitto_passwd"), "-c", "-b", str(passwords), "mast", password], check=True, capture_output=True
    )
    mosquitto.configuration = ["allow_anonymous false", f"password_file {passwords}"]
    mosquitto.start()


def test_the_password_comes_from_its_file_and_shows_nowhere(
    site: Site, mosquitto: Mosquitto, program: Callable[[str], str]
) -> None:
    with_password(mosquitto, SECRET, program)
    file = site.folder / "password"
    file.write_text(f"{SECRET}\n")
    site.line()
    site.write(mqtt={"username": "mast", "password_file": "password"}, log={"level": "debug"})
    run = site.run()
    run.says("connected by MQTT 5")
    view = View(mosquitto.subscribe(username="mast", password=SECRET))
    view.wait("device/slave-1/state", good)

    view.listener.publish("lfs10d/line0/request/config/get", "{}")
    view.wait("response/config/get")

    assert not [each.topic for each in view.heard if SECRET.encode() in each.payload]
    assert SECRET not in run.log
    assert SECRET not in Path(f"/proc/{run.process.pid}/cmdline").read_text()
    assert SECRET not in run.status.read_text()


def state_of(thread: int) -> str:
    """Return the letter of a thread's state; it waits: `S`. Python walks the stacks of those that run at its peril."""
    with contextlib.suppress(OSError):
        return Path(f"/proc/{thread}/stat").read_text().rpartition(")")[2].split()[0]
    return "gone"


def test_a_daemon_that_is_aborted_tells_its_stacks_and_leaves_no_core_with_the_password(
    site: Site, mosquitto: Mosquitto, program: Callable[[str], str]
) -> None:
    with_password(mosquitto, SECRET, program)
    file, cores = site.folder / "password", site.folder / "cores"
    file.write_text(SECRET)
    cores.mkdir()
    site.write(slaves=[], mqtt={"username": "mast", "password_file": str(file)})
    run = site.run(program=("-c", CORES_ALLOWED), environment={"CORES": str(cores)})
    run.says("connected by MQTT 5")
    limits = Path(f"/proc/{run.process.pid}/limits").read_text().splitlines()
    eventually(
        lambda: all(state_of(thread) == "S" for thread in run.threads), "all threads wait, as if they were stuck"
    )

    assert run.ends(signal.SIGABRT) == -signal.SIGABRT

    _, soft, hard, _ = next(line for line in limits if line.startswith("Max core")).rsplit(maxsplit=3)
    assert {soft, hard} <= {"0", "1"}
    assert not list(cores.iterdir())
    assert "(most recent call first)" in run.log
    assert SECRET not in run.log


def test_the_password_comes_from_the_service_managers_credential(
    site: Site, mosquitto: Mosquitto, program: Callable[[str], str]
) -> None:
    with_password(mosquitto, SECRET, program)
    credentials = site.folder / "credentials"
    credentials.mkdir()
    (credentials / "mqtt-password").write_text(f"{SECRET}\n")
    site.write(mqtt={"username": "mast"})

    run = site.run(environment={"CREDENTIALS_DIRECTORY": str(credentials)})

    run.says("connected by MQTT 5")
    assert SECRET not in run.log


def test_a_wrong_password_is_told_and_tried_again_until_a_reload_brings_the_right_one(
    site: Site, mosquitto: Mosquitto, program: Callable[[str], str]
) -> None:
    with_password(mosquitto, SECRET, program)
    file = site.folder / "password"
    file.write_text(WRONG)
    site.line()
    site.write(mqtt={"username": "mast", "password_file": str(file)})
    run = site.run()
    run.says("check mqtt.username and mqtt.password_file")
    run.ready()
    assert run.process.poll() is None
    assert WRONG not in run.log

    file.write_text(SECRET)
    run.reload()
    run.says("connected by MQTT 5")

    assert "reloaded: mqtt.password_file" in run.log
    assert SECRET not in run.log


def test_a_new_password_is_used_at_once_after_a_reload_while_the_old_connection_stands(
    site: Site, mosquitto: Mosquitto, program: Callable[[str], str]
) -> None:
    with_password(mosquitto, SECRET, program)
    file = site.folder / "password"
    file.write_text(SECRET)
    site.write(slaves=[], mqtt={"username": "mast", "password_file": str(file)})
    run = site.run()
    run.says("connected by MQTT 5")

    file.write_text(WRONG)
    run.reload()

    run.says("check mqtt.username and mqtt.password_file")
