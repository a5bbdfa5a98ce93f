"""The configuration file: valid as a whole, or all its problems at once."""

from __future__ import annotations

import os
import shutil
import sys
from pathlib import Path

import pytest

from lfs10d.config.loader import load
from lfs10d.errors import ConfigError
from lfs10d.profiles.library import builtin_names
from lfs10d.schema.document import LARGEST_FILE
from tests.support.config_texts import SMALL, loaded, problems

NULL_BYTE = "embedded null byte" if sys.version_info < (3, 13) else "open: embedded null character in path"
"""How Python words it."""

pytestmark = pytest.mark.usefixtures("in_a_folder_of_its_own")


def test_a_file_gives_a_configuration_its_profiles_and_origins() -> None:
    found = loaded(
        "line: {port: tty}\npoll: {interval: 2s}\nslaves:\n- 2\n- {id: 3, interval: 250ms}\n", name="north.yaml"
    )
    assert found.config.line.name == "north"
    assert found.config.line.port == str(Path("tty").absolute())
    assert found.config.mqtt.client_id == "lfs10d-gateway-north"
    assert set(found.profiles) == {"lfs10"}
    assert found.profiles[found.config.slaves[0].profile].name == "lfs10"
    assert {path: str(found.origins[path]) for path in ("line.name", "line.port", "slaves[0].id", "slaves[1].id")} == {
        "line.name": "default",
        "line.port": "north.yaml:1",
        "slaves[0].id": "north.yaml:4",
        "slaves[1].id": "north.yaml:5",
    }
    assert str(found.origins["slaves[0].interval"]) == "north.yaml:2 (poll.interval)"
    assert str(found.origins["slaves[1].interval"]) == "north.yaml:5"
    assert str(found.origins["slaves[1].response_timeout"]) == "default"


EVERYTHING_WRONG = """\
line: {port: /dev/x, baudrate: 9601, prot: x}
slaves:
- 2
- 2
- "9"
- {id: 300, nmae: a}
- {name: slave-2}
- {id: 7, name: slave-2, profile: nope.yaml}
- 400
mqtt: {host: "mqtt://u:hunter2@h", tls: {ca: no.pem}, password_file: secret}
poll: {interval: 1m30s, retries: true}
commands: [foo, polling]
store: 5
poll: {}
"""


def test_all_problems_are_told_at_once_in_order_of_place() -> None:
    found = problems(EVERYTHING_WRONG)
    assert [line.partition(" ")[0] + " " + line.split()[1] for line in found] == [
        "1:32: line.baudrate:",
        "1:38: line.prot:",
        "4:3: slaves[1].id:",
        "5:3: slaves[2]:",
        "6:8: slaves[3].id:",
        "6:13: slaves[3].nmae:",
        "7:3: slaves[4].id:",
        "8:17: slaves[5].name:",
        "8:35: slaves[5].profile:",
        "9:3: slaves[6].id:",
        "10:14: mqtt.host:",
        "10:46: mqtt.tls.ca:",
        "10:70: mqtt.password_file:",  # cannot be read
        "10:70: mqtt.password_file:",  # and needs a user name
        "11:18: poll.interval:",
        "11:34: poll.retries:",
        "12:12: commands[0]:",
        "13:8: store:",
        "14:1: poll:",
    ]
    assert "hunter2" not in "".join(found)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("", ["1:1: the file is empty"]),
        ("5", ["1:1: must be a mapping with line, slaves and mqtt, not 5"]),
        ("- a", ["1:1: must be a mapping with line, slaves and mqtt, not a list"]),
        ("slaves: []", ["1:1: line: is missing; write here: the RS485 line; at least `port`"]),
        ("line:", ["1:6: line: must be a mapping of keys to values, not empty"]),
        (
            "line: {}",
            [
                (
                    "1:7: line.port: is missing; write here: path of the serial port, best below "
                    "/dev/serial/by-id: it stays the same after replugging"
                )
            ],
        ),
        ("line: {port: x}\nslaves:", ["2:8: slaves: must be a list, [] for none, not empty"]),
        ("line: {port: x}\n5: 1", ["2:1: 5: is not a known key; keys are text here"]),
        ("line: {port: x, databits: 7}", ["1:27: line.databits: must be 8 with framing rtu; 7 goes with ascii only"]),
        # Nothing is said about what depends on a value that is wrong itself.
        (
            "line: {port: x, databits: 7, framing: ascci}",
            ['1:39: line.framing: must be rtu or ascii, not text "ascci"'],
        ),
        (
            "line: {port: x}\nslaves: [{id: 2, profile: lsf10}]",
            [
                (
                    '2:27: slaves[0].profile: no profile "lsf10": "{folder}/lsf10" cannot be read: no such file or '
                    f"directory; built in are {', '.join(builtin_names())}; else the path of a profile YAML"
                )
            ],
        ),
        (
            "line: {port: x}\nslaves: [{id: 2, profile: p}, {id: 3, profile: p}]",
            [
                (
                    '2:27: slaves[0].profile: no profile "p": "{folder}/p" cannot be read: no such file or '
                    f"directory; built in are {', '.join(builtin_names())}; else the path of a profile YAML"
                )
            ],
        ),
        ("line: {port: x}\nmqtt: {client_id: 5}", None),
        ("line: {port: x, rs485: 5}\nslaves: [[2]]\nmqtt: []", None),
        ("line: {port: x}\nslaves: {2: 3}\ncommands: [[polling], 3]", None),
    ],
)
def test_each_problem_says_where_it_is_and_what_would_be_right(text: str, expected: list[str] | None) -> None:
    found = problems(text)
    if expected is None:
        assert len(found) >= 1
    else:
        assert found == [line.replace("{folder}", str(Path.cwd())) for line in expected]


@pytest.mark.parametrize("profile", ["lfs10", "ld-e", "fuling-dzb", "eh600"])
def test_every_built_in_profile_can_be_named(profile: str) -> None:
    assert loaded(f"line: {{port: x}}\nslaves: [{{id: 2, profile: {profile}}}]").profiles[profile].name == profile


def test_the_problems_of_a_profile_file_stand_in_that_file_after_our_own() -> None:
    Path("a-gauge.yaml").write_text("name: gauge\n")
    found = problems("line: {port: x, zzz: 1}\nslaves: [{id: 2, profile: a-gauge.yaml}]")
    assert found[0].startswith("1:17: line.zzz:")
    assert all(line.startswith(f"{Path.cwd()}/a-gauge.yaml:1:1: ") for line in found[1:])
    assert len(found) > 1


@pytest.mark.parametrize("raw", [b"\0" * (LARGEST_FILE + 1), b"\xff"])
def test_a_file_that_is_no_text_is_a_configuration_error(raw: bytes) -> None:
    Path("lfs10d.yaml").write_bytes(raw)
    with pytest.raises(ConfigError, match=r"^lfs10d.yaml:1:1: "):
        load(Path("lfs10d.yaml"))


@pytest.mark.parametrize(
    ("path", "message"),
    [
        ("missing.yaml", "missing.yaml:1:1: there is no such file; name another with -c FILE or $LFS10D_CONFIG"),
        (".", ".:1:1: the file cannot be read: is a directory"),
        ("a\0b", f"the file cannot be read: {NULL_BYTE}"),
    ],
)
def test_a_file_that_cannot_be_read_is_one_clear_line(path: str, message: str) -> None:
    with pytest.raises(ConfigError) as refused:
        load(Path(path))
    assert str(refused.value).endswith(message)
    assert len(refused.value.problems) == 1


def test_the_process_lends_its_own_host_name_and_environment(monkeypatch: pytest.MonkeyPatch) -> None:
    Path("credentials").mkdir()
    Path("credentials/mqtt-password").write_text("hunter2")
    # With a user name, since a password without one is an error now (contract, section 1).
    Path("lfs10d.yaml").write_text(SMALL.replace("localhost", "localhost, username: me"))
    monkeypatch.setenv("CREDENTIALS_DIRECTORY", "credentials")
    found = load(Path("lfs10d.yaml"))
    assert found.config.mqtt.client_id == f"lfs10d-{os.uname().nodename}-line0"
    assert found.password() is not None


@pytest.mark.parametrize("name", ["lfs10d.yaml", "lfs10d.full.yaml"])
def test_the_examples_that_come_with_lfs10d_are_valid(name: str) -> None:
    example_file = Path(__file__).parents[2] / "config" / name
    shutil.copy(example_file, name)
    assert load(Path(name)).config.line.name == "line0"


def test_the_full_example_shows_every_default() -> None:
    text = (Path(__file__).parents[2] / "config/lfs10d.full.yaml").read_text()
    full = loaded(text).config
    small = loaded("line: {port: /dev/ttyUSB0}").config
    assert full.model_dump(exclude={"slaves"}) == small.model_dump(exclude={"slaves"})


@pytest.mark.parametrize(
    ("hosts", "told"),
    [
        ('[a, "b:0", "c d"]', ["3:18: mqtt.host[1]: must be a host name", "3:25: mqtt.host[2]: must be a host name"]),
        ("[a, {b: 1}]", ["3:18: mqtt.host[1]: must be a host name"]),
        ("[]", ["3:14: mqtt.host: must be a list of 1 to 16 nodes, each once"]),
        ("[a, a]", ["3:14: mqtt.host: must be a list of 1 to 16 nodes, each once"]),
        ('["mqtt://me:hunter2@a"]', ["3:15: mqtt.host[0]: must be a host name"]),
        ("a:1884", ["3:14: mqtt.host: must be a host name or address, such as localhost or 192.0.2.7 (no mqtt://, no"]),
    ],
)
def test_a_wrong_node_is_told_at_its_place_beside_all_else(hosts: str, told: list[str]) -> None:
    found = problems(SMALL.replace("localhost", hosts) + "log: {level: loud}\n")
    assert len(found) == len(told) + 1
    assert all(line.startswith(beginning) for line, beginning in zip(found, told, strict=False))
    assert "hunter2" not in "".join(found)
    assert found[-1].startswith("4:14: log.level:")


def test_nodes_have_the_port_of_the_section_where_they_have_none_of_their_own() -> None:
    mqtt = loaded(SMALL.replace("localhost", '[a, b:1884, "[::1]"], tls: {}')).config.mqtt
    assert mqtt.nodes == (("a", 8883), ("b", 1884), ("::1", 8883))
    assert mqtt.broker == "a:8883, b:1884, [::1]:8883"


@pytest.mark.parametrize(
    ("calibration", "problem"),
    [
        (
            "{wind_sped: {scale: 1.1}}",
            "3:27: slaves[0].calibration.wind_sped: is no value of profile lfs10; did you mean",
        ),
        (
            "{wind_speed: {skale: 1.1}}",
            "3:40: slaves[0].calibration.wind_speed.skale: is not a known key; did you mean",
        ),
        ("{wind_speed: {offset: x}}", '3:48: slaves[0].calibration.wind_speed.offset: must be a number, not text "x"'),
        ("{wind_speed: {scale: true}}", "3:47: slaves[0].calibration.wind_speed.scale: must be a number, not true"),
        ("{wind_speed: {scale: 0}}", "3:47: slaves[0].calibration.wind_speed.scale: must be at least 0.001, not 0"),
        ("{wind_speed: 1.1}", "3:39: slaves[0].calibration.wind_speed: must be a mapping of keys to values, not 1.1"),
        ("[1]", "3:26: slaves[0].calibration: must be a mapping of keys to values, not a list"),
    ],
)
def test_a_wrong_calibration_is_told_with_its_place(calibration: str, problem: str) -> None:
    with pytest.raises(ConfigError) as caught:
        loaded(f"line: {{port: /dev/x}}\nslaves:\n  - {{id: 1, calibration: {calibration}}}\n")
    (found,) = caught.value.problems
    assert str(found).partition(":")[2].startswith(problem)


def test_a_calibration_has_what_a_certificate_says() -> None:
    config = loaded(
        "line: {port: /dev/x}\nslaves: [{id: 1, calibration: {wind_speed: {scale: 1.013, offset: -1}}}, 2]"
    ).config
    assert [slave.certificates for slave in config.slaves] == [{"wind_speed": (1.013, -1.0)}, {}]
