"""What a reload has to do."""

from __future__ import annotations

from pathlib import Path

import pytest

from lfs10d.config.loader import load
from lfs10d.config.reload import ConfigFiles, ReloadPlan, imprint, plan, read
from lfs10d.errors import ConfigError

BEFORE = """
line: {port: /dev/ttyUSB0}
slaves: [1, {id: 2, name: mast}]
mqtt: {host: localhost}
"""


@pytest.fixture
def running(tmp_path: Path) -> ConfigFiles:
    """Give what runs: the configuration above."""
    file = tmp_path / "lfs10d.yaml"
    file.write_text(BEFORE)
    return read(file)


def planned(running: ConfigFiles, old: str, new: str) -> ReloadPlan:
    """Return the plan for the file with something in it replaced."""
    assert old in BEFORE
    running.loaded.path.write_text(BEFORE.replace(old, new))
    return plan(running, read(running.loaded.path))


def wanted(found: ReloadPlan) -> set[str]:
    """Return what there is to do."""
    return {name for name in ("line", "realtime", "polling", "broker", "publishing", "log") if getattr(found, name)}


@pytest.mark.parametrize(
    ("old", "new", "todo", "applied"),
    [
        ("localhost}", "localhost} # a comment", set(), ()),
        ("slaves: [1,", "slaves: [1, 7,", {"polling"}, ("slaves.slave-7",)),
        ("{id: 2, name: mast}", "2", {"polling"}, ("slaves.slave-2", "slaves.mast")),
        ("name: mast", "name: mast, interval: 5s", {"polling"}, ("slaves.mast.interval",)),
        ("slaves:", "poll: {retries: 0}\nslaves:", {"polling"}, ("poll.retries",)),
        ("ttyUSB0", "ttyUSB1", {"line", "polling"}, ("line.port",)),
        ("ttyUSB0", "ttyUSB0, extra_gap: 5ms", {"line", "polling"}, ("line.extra_gap",)),
        ("ttyUSB0", "ttyUSB0, realtime: true", {"realtime"}, ("line.realtime",)),
        ("host: localhost", "host: elsewhere", {"broker"}, ("mqtt.host",)),
        ("host: localhost", "host: localhost, telemetry: false", {"publishing"}, ("mqtt.telemetry",)),
        ("host: localhost", "host: localhost, state_every: 1m", {"publishing"}, ("mqtt.state_every",)),
        ("host: localhost", "host: localhost, hold: 100ms", {"polling"}, ("mqtt.hold",)),
        (
            "host: localhost",
            "host: elsewhere, state_every: 1m",
            {"broker", "publishing"},
            ("mqtt.host", "mqtt.state_every"),
        ),
        ("slaves:", "wind: {every: 1m}\nslaves:", {"publishing"}, ("wind.every",)),
        ("slaves:", "wind: {records: 0}\nslaves:", {"publishing"}, ("wind.records",)),
        ("slaves:", "log: {level: debug}\nslaves:", {"log"}, ("log.level",)),
        ("slaves:", "commands: []\nslaves:", set(), ("commands",)),
    ],
)
def test_what_changed_is_taken_up_and_nothing_else(
    running: ConfigFiles, old: str, new: str, todo: set[str], applied: tuple[str, ...]
) -> None:
    found = planned(running, old, new)

    assert wanted(found) == todo
    assert found.applied == applied
    assert found.restart_required == ()


def test_what_the_topics_hang_on_stays_as_it_was(running: ConfigFiles) -> None:
    found = planned(running, "ttyUSB0}", "ttyUSB0, name: other}")

    assert found.restart_required == ("line.name",)
    assert found.loaded.config == running.loaded.config
    assert wanted(found) == set()


def test_another_password_is_a_reason_to_connect_anew(tmp_path: Path, running: ConfigFiles) -> None:
    password = tmp_path / "password"
    password.write_text("first")
    named = planned(running, "host:", "username: wind, password_file: password, host:")
    before = ConfigFiles(named.loaded, imprint(named.loaded))
    assert wanted(named) == {"broker"}

    assert wanted(plan(before, read(before.loaded.path))) == set()
    password.write_text("second")
    found = plan(before, read(before.loaded.path))

    assert wanted(found) == {"broker"}
    assert found.applied == ("mqtt.password_file",)


def test_another_certificate_is_one_too_and_what_cannot_be_read_is_another(
    tmp_path: Path, running: ConfigFiles
) -> None:
    running.loaded.path.write_text(BEFORE.replace("host:", "tls: {ca: ca.pem}, host:"))
    ca = tmp_path / "ca.pem"
    ca.write_text("one")
    loaded = load(running.loaded.path, files=False)
    first = ConfigFiles(loaded, imprint(loaded))
    ca.write_text("other")
    second = ConfigFiles(loaded, imprint(loaded))
    ca.unlink()
    third = ConfigFiles(loaded, imprint(loaded))

    assert plan(first, second).applied == ("mqtt.tls",)
    assert plan(second, third).broker
    assert not plan(third, third).broker


def test_a_profile_file_with_other_content_has_its_devices_polled_by_it(tmp_path: Path, running: ConfigFiles) -> None:
    profile = tmp_path / "own.yaml"
    text = (
        "name: own\ntitle: Own\nsources: [a note]\nids: [1, 247]\nframings: [rtu]\nmax_words: 2\n"
        "values: [{name: wind_speed, register: 1, type: uint16, unit: UNIT}]\n"
    )
    profile.write_text(text.replace("UNIT", "m/s"))
    running.loaded.path.write_text(BEFORE.replace("name: mast", "name: mast, profile: own.yaml"))
    before = read(running.loaded.path)

    profile.write_text(text.replace("UNIT", "km/h"))
    found = plan(before, read(running.loaded.path))

    assert found.applied == ("slaves.mast.profile",)
    assert wanted(found) == {"polling"}


def test_a_broken_file_is_no_plan(running: ConfigFiles) -> None:
    running.loaded.path.write_text("line: [")

    with pytest.raises(ConfigError):
        read(running.loaded.path)
