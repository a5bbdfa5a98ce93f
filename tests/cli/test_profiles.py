"""`lfs10d profiles` and `lfs10d profiles show NAME`, in a pipe, on a terminal and as JSON."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest
from click import unstyle
from click.testing import CliRunner

from lfs10d.cli.profiles import command
from lfs10d.cli.render import table
from lfs10d.cli.render.profile_tables import explain
from lfs10d.errors import ConfigError
from lfs10d.profiles.library import builtin_names, load_profile, parse_profile

WIND_VANE = str(Path(__file__).parents[2] / "config" / "profiles" / "wind-vane.yaml")

TANK = """\
name: tank
title: Tank
min_interval: 500ms
values:
  - {name: level, register: 7, type: int16, byte_order: little, function: 4, scale: 0.1, offset: -40, unit: m}
settings:
  - {name: mode, register: 9, values: {0: off, 1: on}, scale: 2}
"""


def run(*arguments: str) -> str:
    result = CliRunner().invoke(command, arguments, catch_exceptions=False)
    assert result.exit_code == 0
    return result.output


def cells(name: str) -> dict[str, list[str]]:
    """Return what `show` says about a profile: the cells behind each first cell."""
    return {row[0]: list(row[1:]) for table in explain(load_profile(name, relative_to=Path())) for row in table.rows}


def test_the_list_has_a_line_for_each_device() -> None:
    head, *lines = run().splitlines()
    assert head.split() == ["name", "device", "values", "framings", "not", "verified"]
    assert [line.split()[0] for line in lines] == list(builtin_names())
    assert "running_frequency, output_current" in lines[2]


def test_the_list_is_json_for_programs() -> None:
    listed = json.loads(run("--json"))
    assert [entry["name"] for entry in listed] == list(builtin_names())
    assert listed[0] == {
        "name": "lfs10",
        "title": "LFS10 wind speed sensor",
        "values": ["wind_speed"],
        "units": {"wind_speed": "m/s"},
        "framings": ["rtu"],
        "unverified": "",
    }


def test_a_profile_is_explained_in_words() -> None:
    said = cells("lfs10")
    assert said["slave ids"] == ["1 to 255; 1 from the factory"]
    assert said["baud rates"] == ["9600, 19200; 9600 from the factory"]
    assert said["one poll"] == ["reads 0x0001-0x0002"]
    assert said["after no answer"] == ["0x0005 is read first (the barrier)"]
    text = run("show", "lfs10")
    assert "set in register 0x0005, unless the DIP switch overrules it" in text
    assert "set in register 0x0004 (1 for 9600, 2 for 19200)\n" in text
    assert "  wind_speed  0x0001-0x0002  float32, high word first  m/s     0..100 m/s\n" in text


def test_what_is_unverified_says_so() -> None:
    assert cells("fuling-dzb")["running_frequency"] == ["maker's fuller manual (unverified on hardware)"]
    lines = [line for line in run("show", "eh600").splitlines() if "x 0.01 Hz" in line]
    assert len(lines) == 1
    assert lines[0].endswith("unverified")


def test_the_limits_and_alternatives_of_a_device_are_told() -> None:
    assert cells("fuling-dzb")["one read"] == ["at most 5 registers, 16 data bytes in ascii"]
    assert cells("eh600")["check (rtu)"] == ["crc, or sum by a slave's key checksum"]
    assert cells("eh600")["one poll"] == ["reads 0x1001 and 0x8000"]


def test_a_profile_of_the_user_is_explained_like_any_other() -> None:
    text = run("show", WIND_VANE)
    assert "Wind vane (profile wind-vane)" in text
    assert "0..360 °" in text
    assert "1..60 s" in text


def test_a_warning_of_a_profile_goes_to_standard_error(tmp_path: Path) -> None:
    (tmp_path / "tank.yaml").write_text(TANK.replace("register: 7", "register: 30007"))
    result = CliRunner().invoke(command, ["show", str(tmp_path / "tank.yaml")], catch_exceptions=False)
    assert result.exit_code == 0
    assert "30007" not in result.stdout
    assert result.stderr == (
        "lfs10d: warning: level: register 30007 looks like a number of the manual, not an address: 3 stands for input "
        "register there, and the rest counts from one, so write 6; if it is the address, write it in "
        "hexadecimal: 0x7537\n"
    )


def test_a_number_of_six_digits_is_answered_with_the_address_that_is_meant(tmp_path: Path) -> None:
    (tmp_path / "tank.yaml").write_text(TANK.replace("register: 7", "register: 400007"))
    with pytest.raises(ConfigError) as caught:
        run("show", str(tmp_path / "tank.yaml"))
    assert str(caught.value).endswith(
        "tank.yaml:5:29: values[0].register: must be a whole number from 0 to 65535; 400007 looks like a number of the "
        "manual: 4 stands for holding register there, and the rest counts from one, so write 6"
    )


def test_a_bare_percent_sign_is_answered_with_its_quotes(tmp_path: Path) -> None:
    (tmp_path / "tank.yaml").write_text(TANK.replace("unit: m", "unit: %"))
    with pytest.raises(ConfigError) as caught:
        run("show", str(tmp_path / "tank.yaml"))
    assert str(caught.value).endswith('a percent sign cannot begin a plain word; put it in quotes: "%"')


def test_the_unusual_is_spelled_out() -> None:
    tables = explain(parse_profile(TANK, "tank.yaml"))
    device = dict(row for row in tables[0].rows if len(row) == 2)
    assert device["after no answer"] == "the line rests for twice the time-out, for no read of another length is known"
    assert device["interval"] == "at least 500ms"
    assert tables[1].rows == (("level", "input 0x0007", "int16, bytes swapped", "x 0.1 -40 m", "any", ""),)
    assert tables[2].rows == (("mode", "0x0009", "uint16 x 2", "0 = off, 1 = on", "no", ""),)
    assert len(tables) == 3


def test_a_profile_without_remarks_is_shown_without_them(tmp_path: Path) -> None:
    (tmp_path / "tank.yaml").write_text(TANK)
    text = run("show", str(tmp_path / "tank.yaml"))
    assert text.startswith("Tank (profile tank)\n")
    assert "Sources and notes" not in text


@pytest.mark.parametrize("name", [*builtin_names(), WIND_VANE])
def test_a_profile_as_json_is_the_whole_file(name: str) -> None:
    shown = json.loads(run("show", name, "--json"))
    profile = load_profile(name, relative_to=Path())
    assert shown["name"] == profile.name
    assert [value["register"] for value in shown["values"]] == [value.register for value in profile.values]
    assert set(shown) == set(type(profile).model_fields)


def test_json_before_the_verb_is_answered_with_where_it_belongs() -> None:
    result = CliRunner().invoke(command, ["--json", "show", "lfs10"])
    assert result.exit_code == 2
    assert "write --json behind show" in result.output


def test_an_unknown_profile_is_a_configuration_error() -> None:
    with pytest.raises(ConfigError, match='profile "lsf10": No such file'):
        run("show", "lsf10")


def test_a_terminal_gets_drawn_tables_of_the_same_words(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True)
    table.show(explain(load_profile("lfs10", relative_to=Path())))
    drawn = unstyle(capsys.readouterr().out)
    assert "LFS10 wind speed sensor (profile lfs10)" in drawn
    assert "float32, high word first" in drawn
    assert all(len(line) <= 80 for line in drawn.splitlines())


def test_a_pipe_never_pays_for_the_drawing() -> None:
    program = "import sys; from lfs10d.cli.profiles import command; command(['show', 'lfs10'], standalone_mode=False);"
    report = subprocess.run(
        [sys.executable, "-c", program + "sys.exit('rich' in sys.modules)"], capture_output=True, check=False
    )
    assert report.returncode == 0, report.stderr.decode()
