"""Which calibration the configuration has for a place on a line, and what becomes of raw values by it."""

from __future__ import annotations

import errno
import os
from pathlib import Path

import click
import pytest

from lfs10d.cli.calibrated import NONE, Calibrations, calibrations_of
from lfs10d.cli.read import command
from lfs10d.config.changes import Changes, DeviceChange, Place, Verified
from lfs10d.config.changes_file import ChangesFile
from lfs10d.errors import ConfigError
from lfs10d.profiles.library import load_profile
from lfs10d.reading import Fault
from lfs10d.system.disk import Disk

LFS10 = load_profile("lfs10", relative_to=Path())
TEXT = """\
line: {name: mast, port: line0, baudrate: 19200}
slaves:
  - {id: 3, name: top, calibration: {wind_speed: {scale: 1.01, offset: 0.06}}}
  - 4
mqtt: {host: localhost}
"""


@pytest.fixture(autouse=True)
def file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return the configuration of a line at `tmp_path`/line0, whose state is in `state` below the same folder."""
    path = tmp_path / "lfs10d.yaml"
    path.write_text(TEXT)
    monkeypatch.setenv("STATE_DIRECTORY", str(tmp_path / "state"))
    return path


def called(file: Path, port: str | None = None, *, named: bool = True, state_dir: Path | None = None) -> Calibrations:
    """Look as a verb does that was given `-c`, or finds the file by itself."""
    source = click.core.ParameterSource.COMMANDLINE if named else click.core.ParameterSource.DEFAULT
    with click.Context(command) as context:
        context.set_parameter_source("config", source)
        return calibrations_of(port or str(file.parent / "line0"), file, state_dir)


def speed(calibrations: Calibrations, slave: int, raw: float | None = 10.0) -> dict[str, object]:
    return dict(calibrations.of(slave, 19200, LFS10, {"wind_speed": raw}))


@pytest.mark.parametrize("named", [False, True])
def test_only_a_slave_with_a_calibration_has_calibrated_values(file: Path, *, named: bool) -> None:
    found = called(file, named=named)
    assert speed(found, 3) == {"wind_speed": 10.16}
    assert speed(found, 4) == speed(found, 5) == {}


@pytest.mark.parametrize(
    ("raw", "calibrated"), [(0.0, 0.0), (12.99, 13.1799), (99.99, None), (None, None), (float("0.01"), 0.0701)]
)
def test_a_value_is_what_the_daemon_would_publish(file: Path, raw: float | None, calibrated: float | None) -> None:
    """Rest stays rest; out of the profile's range, or without a raw value, there is none."""
    assert speed(called(file), 3, raw) == {"wind_speed": calibrated}


def test_a_raw_value_is_judged_by_the_range_of_the_calibrated_one(file: Path) -> None:
    """The profile's range is 0 to 100 m/s, the certificate's scale 1.01 and its offset 0.06."""
    cell = called(file).read_as(3, 19200, LFS10).values[0].cell(1)
    assert cell.believed(98.9) == 98.9
    fault = cell.believed(99.5)
    assert isinstance(fault, Fault)
    assert fault.message == "wind_speed 100.555 m/s is outside 0..100 m/s"
    file.write_text(TEXT.replace("scale: 1.01, offset: 0.06", "scale: 0.9, offset: 1"))
    assert called(file).read_as(3, 19200, LFS10).values[0].cell(1).believed(105.0) == 105.0
    assert called(file).of(3, 19200, LFS10, {"wind_speed": 105.0}) == {"wind_speed": 95.5}


def test_where_nothing_is_calibrated_a_device_is_read_by_its_profile(file: Path) -> None:
    found, other = called(file), load_profile("ld-e", relative_to=Path())
    assert found.read_as(4, 19200, LFS10) is LFS10
    assert found.read_as(3, 9600, LFS10) is LFS10
    assert found.read_as(3, 19200, other) is other


def test_every_slave_whose_place_is_known_is_there(file: Path) -> None:
    assert {slave: each.name for slave, each in called(file).slaves.items()} == {3: "top", 4: "slave-4"}
    save(file, Verified(Place(7, 19200), file=3))
    assert {slave: each.name for slave, each in called(file).slaves.items()} == {7: "top", 4: "slave-4"}


def test_a_calibration_is_of_one_place_and_one_kind_of_device(file: Path) -> None:
    found = called(file)
    other = load_profile("ld-e", relative_to=Path())
    assert found.of(3, 9600, LFS10, {"wind_speed": 10.0}) == {}
    assert found.of(3, 19200, other, {other.value_names[0]: 10}) == {}
    assert found.of(3, 19200, None, {}) == {}


def test_of_several_values_those_with_a_calibration_are_calibrated(file: Path) -> None:
    station = load_profile("ecowitt-wn90lp", relative_to=Path())
    entry = "{id: 9, profile: ecowitt-wn90lp, calibration: {temperature: {scale: 1, offset: -0.4}}}"
    file.write_text(TEXT.replace("- 4", f"- {entry}"))
    assert called(file).of(9, 19200, station, {"temperature": 20.5, "humidity": 40}) == {"temperature": 20.1}


def test_a_port_is_known_by_any_of_its_names(file: Path) -> None:
    (file.parent / "ttyUSB0").touch()
    for name in ("line0", "by-id"):
        (file.parent / name).symlink_to("ttyUSB0")
    assert speed(called(file, str(file.parent / "by-id")), 3)


def test_another_port_has_no_calibration_and_who_named_the_file_is_told(
    file: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert called(file, "/dev/other", named=False) == NONE
    assert capsys.readouterr().err == ""
    assert called(file, "/dev/other") == NONE
    expected = f"lfs10d: {file} is for another port, {file.parent}/line0; raw values alone are shown\n"
    assert capsys.readouterr().err == expected


def test_a_file_that_was_named_must_be_valid(file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Else a sensor can be read before there is a configuration, or with one that is broken."""
    file.write_text(TEXT + "other: 1\n")
    with pytest.raises(ConfigError):
        called(file)
    assert called(file, named=False) == NONE
    assert capsys.readouterr().err.startswith(f"lfs10d: {file}:6:1: other: is not a known key")
    file.unlink()
    with pytest.raises(ConfigError):
        called(file)
    assert called(file, named=False) == NONE
    assert capsys.readouterr().err == ""


def test_the_sample_that_does_not_name_a_port_yet_is_no_trouble(file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """As it lies in /etc/lfs10d when somebody installs and scans for the first time."""
    file.write_text((Path(__file__).parents[2] / "config/lfs10d.sample.yaml").read_text())
    assert called(file, named=False) == NONE
    assert capsys.readouterr().err == ""


def test_a_file_that_cannot_be_looked_at_is_not_taken_for_absent(
    file: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    below = file / "lfs10d.yaml"
    assert called(below, named=False) == NONE
    assert "the file cannot be read" in capsys.readouterr().err


def test_a_calibration_follows_its_sensor_to_the_id_that_a_request_gave_it(file: Path) -> None:
    save(file, Verified(Place(7, 19200), file=3))
    found = called(file)
    assert (speed(found, 3), speed(found, 7)) == ({}, {"wind_speed": 10.16})


def test_where_a_sensor_is_must_be_known_before_it_is_calibrated(
    file: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A person wrote another id than the one that was verified: the line decides, when the daemon asks it."""
    save(file, Verified(Place(7, 19200), file=5))
    found = called(file)
    assert speed(found, 3) == speed(found, 7) == {}
    assert "has not found out yet which slave id top has" in capsys.readouterr().err


def test_without_the_changes_nothing_is_calibrated(file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (file.parent / "state").mkdir()
    (file.parent / "state/changes.yaml").write_text("no: changes\n")
    assert called(file) == NONE
    told = capsys.readouterr().err
    assert told.startswith("lfs10d: the changes made by request cannot be read: ")
    assert told.endswith("which slave id each sensor has now; raw values alone are shown\n")
    file.write_text(TEXT.replace(", calibration: {wind_speed: {scale: 1.01, offset: 0.06}}", ""))
    assert called(file) == NONE
    assert capsys.readouterr().err == ""


def test_who_may_not_read_the_changes_is_told_who_may(
    file: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    stat = Path.stat

    def look(self: Path, *, follow_symlinks: bool = True) -> os.stat_result:
        if self.name == "state":
            raise PermissionError(errno.EACCES, "Permission denied", str(self))
        return stat(self, follow_symlinks=follow_symlinks)

    monkeypatch.setattr(Path, "stat", look)
    assert called(file) == NONE
    told = capsys.readouterr().err
    assert "permission denied; so it is not known which slave id each sensor has now (call it as root); raw" in told


def test_the_state_may_be_elsewhere(file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    save(file, Verified(Place(7, 19200), file=3))
    elsewhere = (file.parent / "state").rename(file.parent / "elsewhere")
    assert speed(called(file), 7) == {}
    assert speed(called(file, state_dir=elsewhere), 7) == {"wind_speed": 10.16}
    assert called(file, state_dir=file.parent / "nowhere") == NONE
    assert f"the state directory {file.parent / 'nowhere'} cannot be read: it is not there" in capsys.readouterr().err


def save(file: Path, verified: Verified) -> None:
    """Write what a daemon would have, whose sensor `top` was found at another place."""
    state = file.parent / "state"
    state.mkdir()
    ChangesFile(state, Disk()).save(Changes({"top": DeviceChange(verified=verified)}))
