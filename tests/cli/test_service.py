"""`lfs10d service` writes units and starts what is configured, and overwrites nothing that a person changed.

`systemctl` is a stand-in that notes what it is asked.
"""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from pathlib import Path

import pytest

from lfs10d.cli import lfs10d, service, service_files
from lfs10d.cli.service_files import Installation, ServicePlaces
from lfs10d.errors import FailedError

SYSTEMCTL = """#!/bin/sh
case "$*" in
  list-units*) cat {folder}/running 2>/dev/null; exit 0 ;;
esac
echo "$*" >> {asked}
case "$*" in *restart*) [ ! -e {folder}/broken ] || {{ echo 'Job failed.' >&2; exit 1; }} ;; esac
"""
COMPLETE = "line: {port: /dev/null}\nslaves: [2]\nmqtt: {host: localhost}\n"


@dataclass
class System:
    """A folder in place of /etc, and the stand-in for systemctl."""

    folder: Path
    asked_before: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.systemctl.write_text(SYSTEMCTL.format(asked=self.folder / "asked", folder=self.folder))
        self.systemctl.chmod(0o755)

    @property
    def systemctl(self) -> Path:
        return self.folder / "systemctl"

    @property
    def places(self) -> ServicePlaces:
        return ServicePlaces(self.folder / "units", self.folder / "lfs10d", (str(self.systemctl),))

    @property
    def unit(self) -> Path:
        return self.places.units / "lfs10d.service"

    def configured(self, name: str = "lfs10d") -> None:
        self.places.configurations.mkdir(exist_ok=True)
        (self.places.configurations / f"{name}.yaml").write_text(COMPLETE)

    def asked(self) -> list[str]:
        """Return what systemctl was asked since the last call."""
        file = self.folder / "asked"
        lines = file.read_text().splitlines() if file.exists() else []
        new, self.asked_before = lines[len(self.asked_before) :], lines
        return new


@pytest.fixture
def system(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> System:
    made = System(tmp_path)
    monkeypatch.setattr(service, "_places", lambda *, user: ServicePlaces(
        made.places.units, made.places.configurations, made.places.systemctl, user=user
    ))  # fmt: skip
    monkeypatch.setattr(service, "_need_root", lambda _installation: None)
    monkeypatch.setattr(service, "PACKAGED_UNITS", tmp_path / "packaged")
    monkeypatch.setattr(Installation, "obstacle", lambda _installation: None)
    return made


def call(words: str) -> object:
    return lfs10d.main(["service", *words.split()], "lfs10d", standalone_mode=False)


def test_an_installation_without_a_configuration_gets_units_and_a_sample_and_starts_nothing(
    system: System, capsys: pytest.CaptureFixture[str]
) -> None:
    assert call("install") == 0
    shown = capsys.readouterr().out
    sample = system.places.configurations / "lfs10d.yaml"
    assert {each.name for each in system.places.units.iterdir()} == {
        "lfs10d.service",
        "lfs10d@.service",
        "lfs10d-web.service",
    }
    assert system.asked() == ["daemon-reload"]
    assert f"{sample}:" in shown
    assert "line.port: is missing" in shown
    assert "Then: sudo systemctl enable --now lfs10d.service" in shown
    assert system.unit.stat().st_mode & 0o777 == 0o644, "the service's user reads it"


@pytest.mark.parametrize(
    ("words", "name", "unit"), [("", "lfs10d", "lfs10d.service"), ("--instance roof", "roof", "lfs10d@roof.service")]
)
def test_what_is_configured_is_enabled_and_started(words: str, name: str, unit: str, system: System) -> None:
    system.configured(name)
    assert call(f"install {words}") == 0
    assert system.asked() == ["daemon-reload", f"enable --quiet {unit}", f"restart {unit}"]
    assert (system.places.configurations / f"{name}.yaml").read_text() == COMPLETE


RUNNING = """\
lfs10d@roof.service loaded active running lfs10d: RS485 wind sensors to MQTT (roof)
lfs10d-web.service  loaded active running lfs10d: the live page and figures for Prometheus
"""


@pytest.mark.parametrize(
    ("configured", "words", "restarted"),
    [
        (True, "", ["lfs10d.service", "lfs10d@roof.service", "lfs10d-web.service"]),
        (False, "", ["lfs10d@roof.service", "lfs10d-web.service"]),
        (True, "--instance lfs10d", ["lfs10d@lfs10d.service"]),
    ],
)
def test_after_an_upgrade_all_that_runs_runs_the_new_version(
    system: System, words: str, restarted: list[str], *, configured: bool
) -> None:
    """Another line is not interrupted by the installation of one instance."""
    if configured:
        system.configured()
    (system.folder / "running").write_text(RUNNING)
    assert call(f"install {words}") == 0
    assert [each.removeprefix("restart ") for each in system.asked() if "restart" in each] == restarted


def test_a_further_line_that_does_not_start_again_is_told(system: System, capsys: pytest.CaptureFixture[str]) -> None:
    (system.folder / "running").write_text(RUNNING)
    (system.folder / "broken").touch()
    assert call("install") == 1
    assert "The reason: journalctl -u lfs10d@roof.service -n 20" in capsys.readouterr().err


def test_a_service_that_does_not_start_fails_and_says_where_the_reason_is(
    system: System, capsys: pytest.CaptureFixture[str]
) -> None:
    system.configured()
    (system.folder / "broken").touch()
    assert call("install") == 1
    assert "Job failed." in (said := capsys.readouterr().err)
    assert "journalctl -u lfs10d.service" in said


def test_a_unit_that_a_person_changed_is_left_alone_and_one_of_an_older_version_is_replaced(
    system: System, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    system.configured()
    call("install")
    old = system.unit.read_text()
    monkeypatch.setattr(service, "__version__", "9.9.9")
    call("install")
    assert "(9.9.9, " in system.unit.read_text()
    system.unit.write_text(changed := old.replace("WatchdogSec=30s", "WatchdogSec=60s"))
    capsys.readouterr()
    call("install")
    assert system.unit.read_text() == changed
    assert f"{system.unit} was changed by hand and is left alone" in capsys.readouterr().out
    call("remove")
    assert system.unit.read_text() == changed
    assert not (system.places.units / "lfs10d@.service").exists()


def test_removing_stops_every_instance_and_keeps_configuration(
    system: System, capsys: pytest.CaptureFixture[str]
) -> None:
    system.configured()
    call("install")
    wants = system.places.units / "multi-user.target.wants"
    wants.mkdir()
    (wants / "lfs10d@roof.service").touch()
    system.asked()
    assert call("remove") == 0
    asked = system.asked()
    assert set(asked) == {
        "disable --now lfs10d.service",
        "disable --now lfs10d-web.service",
        "disable --now lfs10d@roof.service",
        "stop lfs10d@*.service",
        "daemon-reload",
    }  # fmt: skip
    assert asked[-1] == "daemon-reload"
    assert not list(system.places.units.glob("*.service"))
    assert (system.places.configurations / "lfs10d.yaml").exists()
    capsys.readouterr()
    assert call("remove") == 0
    assert "no units of lfs10d service install were found" in capsys.readouterr().out


def test_one_instance_is_removed_alone(system: System) -> None:
    system.configured()
    call("install")
    system.asked()
    assert call("remove --instance roof") == 0
    assert system.asked() == ["disable --now lfs10d@roof.service"]
    assert system.unit.exists()


def test_the_units_of_a_package_are_not_covered_up(system: System) -> None:
    (system.folder / "packaged").touch()
    with pytest.raises(FailedError, match="the Debian package of lfs10d brings its own units"):
        call("install")
    assert not system.places.units.exists()


def test_print_shows_what_install_writes(system: System, capsys: pytest.CaptureFixture[str]) -> None:
    call("install")
    capsys.readouterr()
    call("print")
    assert capsys.readouterr().out == system.unit.read_text()
    call("print --instance roof")
    assert "/%i.yaml" in capsys.readouterr().out


def test_a_user_s_service_names_that_user_s_configuration(system: System, capsys: pytest.CaptureFixture[str]) -> None:
    system.configured()
    assert call("install --user") == 0
    assert f"run -c {system.places.configurations}/lfs10d.yaml" in system.unit.read_text()
    assert "loginctl enable-linger" in capsys.readouterr().out


@pytest.mark.parametrize("name", ["Roof", "a/b", "", "x" * 33])
def test_an_instance_s_name_is_a_line_s_name(name: str) -> None:
    with pytest.raises(Exception, match="as a line's name is"):
        lfs10d.main(["service", "print", "--instance", name], "lfs10d", standalone_mode=False)


def test_a_link_beside_the_installation_is_named_in_place_of_it(tmp_path: Path) -> None:
    versioned = tmp_path / "lfs10d-1.0.0"
    versioned.mkdir()
    assert Installation(versioned, Path("/usr"), "1.0.0").lasting == versioned
    (tmp_path / "lfs10d").symlink_to("lfs10d-1.0.0")
    assert Installation(versioned, Path("/usr"), "1.0.0").lasting == tmp_path / "lfs10d"


def test_an_installation_that_services_cannot_see_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    program = tmp_path / "open/bin/lfs10d"
    program.parent.mkdir(parents=True)
    program.touch()
    installation = Installation(tmp_path / "open", Path("/usr"), "1")
    monkeypatch.setattr(service_files, "_HIDDEN", (tmp_path,))
    assert installation.obstacle() == f"{program} is below {tmp_path}, which services do not see"
    monkeypatch.setattr(service_files, "_HIDDEN", ())
    (tmp_path / "open").chmod(0o700)
    assert f"{tmp_path / 'open'} is closed to other users" in str(installation.obstacle())


def test_without_systemd_it_says_so(tmp_path: Path) -> None:
    with pytest.raises(FailedError, match="is this a system with systemd"):
        ServicePlaces(tmp_path, tmp_path, (str(tmp_path / "nothing"),)).call("daemon-reload")


def test_it_asks_for_root(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "geteuid", lambda: 1000)
    with pytest.raises(FailedError, match=r"needs root: sudo /.*/bin/lfs10d "):
        call("install")
