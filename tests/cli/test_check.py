"""`lfs10d check` as a person calls it."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from click.testing import CliRunner

from lfs10d.cli.check import command
from lfs10d.errors import ConfigError
from tests.support.verbs import Lfs10d


@pytest.fixture(autouse=True)
def in_a_folder_of_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def check(text: str, *arguments: str) -> tuple[int, str, str]:
    Path("lfs10d.yaml").write_text(text)
    result = CliRunner().invoke(command, ["-c", "lfs10d.yaml", *arguments], standalone_mode=False)
    if result.exception is not None:
        raise result.exception
    assert isinstance(result.return_value, int)
    return result.return_value, result.stdout, result.stderr


GOOD = "line: {port: /dev/x}\nslaves: [2, {id: 3, interval: 0}, {id: 4, enabled: false}]\n"


def test_a_valid_file_is_answered_with_the_time_budget_as_a_table() -> None:
    code, out, err = check(GOOD)
    assert (code, err) == (0, "")
    assert out.splitlines()[:9] == [
        "lfs10d.yaml: valid",
        "line    line0: /dev/x, 9600 baud 8N1 rtu",
        "broker  localhost:1883, topics below lfs10d/line0",
        "slaves  3, 1 of them disabled",
        "",
        "device   id  profile  interval  wire time      load",
        "slave-2   2  lfs10          1s    25.0 ms      2.5%",
        "slave-3   3  lfs10           0    25.0 ms  the rest",
        "",
    ]
    assert "fastest cycle    50.0 ms" in out
    assert "slowest cycle    2.05 s" in out


SLOW = """\
name: station
title: A station
values:
  - {name: wind_speed, register: 0, type: uint16, unit: m/s}
  - {name: battery, register: 40001, type: uint16, unit: V, interval: 1m}
"""
"""A slow value, whose register is written as the manual's number."""


def test_a_slow_value_is_counted_at_its_own_rate() -> None:
    Path("station.yaml").write_text(SLOW)
    text = "line: {port: /dev/x}\nslaves: [{id: 2, profile: station.yaml, interval: 100ms}, 3]\n"
    code, out, _ = check(text)
    assert code == 0
    assert out.splitlines()[5:8] == [
        "device   id  profile       interval  wire time  with slow values   load",
        "slave-2   2  station.yaml     100ms    22.9 ms           45.8 ms  23.0%",
        "slave-3   3  lfs10               1s    25.0 ms           25.0 ms   2.5%",
    ]
    _, out, _ = check(text, "--json")
    found = json.loads(out)["budget"]
    assert found["load_pct"] == 25.45
    assert [(each["wire_ms"], each["longest_wire_ms"]) for each in found["slaves"]] == [(22.917, 45.833), (25.0, 25.0)]


def test_a_register_that_is_a_number_of_the_manual_is_a_warning_once_for_its_profile() -> None:
    Path("station.yaml").write_text(SLOW)
    code, _, err = check(
        "line: {port: /dev/x}\nslaves: [2, {id: 3, profile: station.yaml}, {id: 4, profile: station.yaml}]\n"
    )
    assert code == 0
    assert err == (
        'lfs10d.yaml:2:13: slaves[1]: warning: profile "station.yaml": battery: register 40001 looks like a number of '
        "the manual, not an address: 4 stands for holding register there, and the rest counts from one, so write 0; "
        "if it is the address, write it in hexadecimal: 0x9C41\n"
    )


def test_the_unit_of_a_value_in_words_is_a_warning_and_no_refusal() -> None:
    words = SLOW.replace("40001, type: uint16", "7, type: uint16, map: {0: low, 1: full}")
    Path("station.yaml").write_text(words)
    code, _, err = check("line: {port: /dev/x}\nslaves: [{id: 3, profile: station.yaml}]\n")
    assert code == 0
    assert err == (
        'lfs10d.yaml:2:10: slaves[0]: warning: profile "station.yaml": battery: is text or a boolean, which has no '
        'unit: leave out unit "V"\n'
    )


def test_a_profile_with_a_bare_percent_sign_is_told_to_quote_it() -> None:
    Path("station.yaml").write_text(SLOW.replace("unit: V", "unit: %"))
    with pytest.raises(ConfigError) as caught:
        check("line: {port: /dev/x}\nslaves: [{id: 2, profile: station.yaml}]\n")
    assert str(caught.value).endswith(
        '/station.yaml:5:58: a percent sign cannot begin a plain word; put it in quotes: "%"'
    )


def test_calibrations_are_shown() -> None:
    calibrated = GOOD.replace("id: 3,", "id: 3, calibration: {wind_speed: {scale: 1.013, offset: -0.06}},")
    code, out, err = check(calibrated)
    assert code == 0
    assert "device   value       calibration\nslave-3  wind_speed  value * 1.013 - 0.06\n" in out
    assert err.startswith(
        "lfs10d.yaml:2:70: slaves[1].calibration.wind_speed.offset: warning: wind_speed below 0.0592 m/s"
    )
    _, out, _ = check(calibrated, "--json")
    slaves = json.loads(out)["budget"]["slaves"]
    assert [each["calibration"] for each in slaves] == [{}, {"wind_speed": {"scale": 1.013, "offset": -0.06}}]


def test_without_slaves_there_is_no_table_but_a_warning_and_exit_code_0() -> None:
    code, out, err = check("line: {port: /dev/x}\nslaves: []\n")
    assert code == 0
    assert "device" not in out
    assert err == "lfs10d.yaml:2:9: slaves: warning: there are no slaves: nothing will be polled until one is added\n"


def test_a_program_gets_the_same_as_json() -> None:
    calibrated = GOOD.replace("interval: 0}", "interval: 0, calibration: {wind_speed: {scale: 1, offset: -0.06}}}")
    code, out, err = check(calibrated, "--json")
    found = json.loads(out)
    assert code == 0
    assert found["valid"] is True
    assert found["budget"]["load_pct"] == 2.5
    assert [slave["load_pct"] for slave in found["budget"]["slaves"]] == [2.5, None]
    path = "slaves[1].calibration.wind_speed.offset"
    assert [warning["path"] for warning in found["warnings"]] == [path]
    assert err.startswith(f"lfs10d.yaml:2:79: {path}: warning: ")


def test_a_program_gets_the_problems_as_json_and_a_person_as_lines() -> None:
    code, out, err = check("line: {port: 5}\nx: 1\n", "--json")
    assert code == 78
    found = json.loads(out)
    assert found["valid"] is False
    assert [(problem["line"], problem["column"], problem["path"]) for problem in found["problems"]] == [
        (1, 14, "line.port"),
        (2, 1, "x"),
    ]
    assert len(err.splitlines()) == 2


def test_every_problem_is_a_line_on_standard_error_and_the_exit_code_78(lfs10d: Lfs10d, small: Path) -> None:
    small.write_text("line: {port: 5}\nx: 1\n")
    result = lfs10d("check", "-c", small.name)
    assert result.returncode == 78
    assert result.stdout == ""
    assert result.stderr.splitlines() == [
        (
            "lfs10d.yaml:1:14: line.port: must be a path of 1 to 4096 characters on one line, "
            "without control characters, not 5"
        ),
        (
            "lfs10d.yaml:2:1: x: is not a known key; known here: line, poll, slaves, mqtt, commands, "
            "homeassistant, wind, store, log"
        ),
    ]


def test_a_missing_file_is_one_line_and_the_exit_code_78(lfs10d: Lfs10d) -> None:
    result = lfs10d("check", "-c", "none.yaml")
    assert result.returncode == 78
    assert result.stderr == "none.yaml:1:1: there is no such file; name another with -c FILE or $LFS10D_CONFIG\n"


def test_the_environment_names_the_file_and_the_option_comes_before_it(lfs10d: Lfs10d, small: Path) -> None:
    assert lfs10d("check", LFS10D_CONFIG=small.name).returncode == 0
    assert lfs10d("check", "-c", small.name, LFS10D_CONFIG="none.yaml").returncode == 0
    assert lfs10d("check", LFS10D_CONFIG="").stderr.startswith("/etc/lfs10d/lfs10d.yaml:1:1: ")


def test_what_would_turn_or_hide_text_is_escaped(lfs10d: Lfs10d, tmp_path: Path) -> None:
    (tmp_path / "lfs10d.yaml").write_text(
        'line: {port: "/dev/\\u202ex"}\nslaves: [{id: 2, label: "a\\u2066b"}]\nmqtt: {host: localhost}\n'
    )
    for verb in (["check"], ["config"], ["config", "--merged"], ["config", "--json"], ["check", "--json"]):
        done = lfs10d(*verb, "-c", "lfs10d.yaml")
        shown = done.stdout + done.stderr
        assert done.returncode == 0
        assert all(sign.isprintable() or sign == "\n" for sign in shown), verb
