"""The configuration file: valid as a whole, or all its problems at once."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from lfs10d.config.loader import LoadedConfig, load
from lfs10d.errors import ConfigError, Problem
from lfs10d.profiles.library import builtin_names
from lfs10d.schema.document import LARGEST_FILE

SMALL = "line: {port: /dev/x}\nslaves: [2, 3]\nmqtt: {host: localhost}\n"


@pytest.fixture(autouse=True)
def in_a_folder_of_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Problems then show short names."""
    monkeypatch.chdir(tmp_path)


def loaded(text: str, *, name: str = "lfs10d.yaml", files: bool = True, **environment: str) -> LoadedConfig:
    Path(name).write_bytes(text.encode())
    return load(Path(name), files=files, environment=environment, host="gateway")


def problems(text: str, *, files: bool = True) -> list[str]:
    with pytest.raises(ConfigError) as refused:
        loaded(text, files=files)
    return [str(problem).removeprefix("lfs10d.yaml:") for problem in refused.value.problems]


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
        ("a\0b", "the file cannot be read: embedded null byte"),
    ],
)
def test_a_file_that_cannot_be_read_is_one_clear_line(path: str, message: str) -> None:
    with pytest.raises(ConfigError) as refused:
        load(Path(path))
    assert str(refused.value).endswith(message)
    assert len(refused.value.problems) == 1


WITH_PASSWORD = SMALL.replace("localhost", "localhost, username: me, password_file: pw")


def test_the_password_is_the_first_line_of_its_file_read_anew_each_time() -> None:
    Path("pw").write_bytes("gehéim \r\nsecond line".encode())
    found = loaded(WITH_PASSWORD)
    password = found.password()
    assert password is not None
    assert password.reveal() == "gehéim "
    assert "gehéim" not in repr(found)
    Path("pw").write_text("other\n")
    again = found.password()
    assert again is not None
    assert again.reveal() == "other"


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (None, "cannot be read: no such file or directory"),
        (b"", "must hold the password in its first line"),
        (b"\nx", "must hold the password in its first line"),
        (b"x" * 70_000, "must hold the password in its first line"),
        (b"\xff", "is no UTF-8 text"),
    ],
)
def test_an_unreadable_password_is_an_error_at_its_key(content: bytes | None, message: str) -> None:
    if content is not None:
        Path("pw").write_bytes(content)
    (found,) = problems(WITH_PASSWORD)
    assert found == f'3:54: mqtt.password_file: "{Path.cwd()}/pw" {message}'


def test_a_password_that_vanished_is_told_when_it_is_read_anew() -> None:
    Path("pw").write_text("a")
    found = loaded(WITH_PASSWORD)
    Path("pw").unlink()
    with pytest.raises(ConfigError, match=r"lfs10d.yaml:3:54: mqtt.password_file: "):
        found.password()


def test_a_verb_with_a_login_of_its_own_does_without_the_files() -> None:
    text = SMALL.replace("localhost", "localhost, username: me, password_file: pw, tls: {ca: no.pem}")
    assert loaded(text, files=False).config.mqtt.password_file == str(Path("pw").absolute())


def test_the_systemd_credential_is_the_password_where_no_file_is_named() -> None:
    Path("credentials").mkdir()
    folder = str(Path("credentials").absolute())
    named = SMALL.replace("localhost", "localhost, username: me")
    assert loaded(SMALL, CREDENTIALS_DIRECTORY=folder).password() is None
    Path("credentials/mqtt-password").write_text("hunter2\n")
    found = loaded(named, CREDENTIALS_DIRECTORY=folder)
    password = found.password()
    assert password is not None
    assert password.reveal() == "hunter2"
    assert str(found.origins["mqtt.password_file"]) == "systemd credential mqtt-password"
    Path("pw").write_text("other\n")
    own = loaded(WITH_PASSWORD, CREDENTIALS_DIRECTORY=folder)
    assert own.password() != password
    assert str(own.origins["mqtt.password_file"]) == "lfs10d.yaml:3"
    Path("credentials/mqtt-password").write_text("")
    with pytest.raises(ConfigError, match=r"mqtt-password:1:1: .* must hold the password"):
        loaded(named, CREDENTIALS_DIRECTORY=folder)


def test_a_credential_without_a_user_name_is_an_error_but_not_for_a_verb_that_logs_in_by_itself() -> None:
    Path("mqtt-password").write_text("hunter2")
    with pytest.raises(ConfigError, match=r"3:7: mqtt.username: is missing: the systemd credential mqtt-password"):
        loaded(SMALL, CREDENTIALS_DIRECTORY=str(Path.cwd()))
    assert loaded(SMALL, files=False, CREDENTIALS_DIRECTORY=str(Path.cwd())).config.mqtt.username is None


def test_what_the_name_of_the_host_makes_of_a_topic_is_checked_too() -> None:
    Path("lfs10d.yaml").write_text(SMALL.replace("localhost", 'localhost, base_topic: "site/%H", version: 4'))
    with pytest.raises(ConfigError) as refused:
        load(Path("lfs10d.yaml"), environment={}, host="mast#1")
    told = [str(problem) for problem in refused.value.problems]
    assert [line.split(": ")[1] for line in told] == ["mqtt.base_topic", "mqtt.version"]
    assert 'is "site/mast#1" with the name of this host, and must be' in told[0]


def test_certificates_that_cannot_be_used_are_errors_at_their_keys() -> None:
    for name in ("ca.pem", "cert.pem", "key.pem"):
        Path(name).write_text("no certificate")
    found = problems(SMALL.replace("localhost", "localhost, tls: {ca: ca.pem, cert: cert.pem, key: key.pem}"))
    assert [line.partition(": ")[0] for line in found] == ["3:35", "3:49"]
    assert found[0].endswith('ca.pem" holds no certificate in PEM form')
    assert "both in PEM form, matching, no passphrase?" in found[1]


def test_tls_without_files_trusts_the_system() -> None:
    assert loaded(SMALL.replace("localhost", "localhost, tls: {}")).config.mqtt.port == 8883


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


KEYS = st.sampled_from(
    [
        "line",
        "port",
        "slaves",
        "id",
        "name",
        "mqtt",
        "host",
        "tls",
        "ca",
        "poll",
        "interval",
        "commands",
        "rs485",
        "store",
        "max_size",
        "wind",
        "profile",
        "password_file",
        "log",
        "level",
        "key",
        "x",
    ]
)
WORDS = st.sampled_from(
    [
        "/dev/x",
        "2",
        "3",
        "'9'",
        "250ms",
        "0",
        "auto",
        "null",
        "true",
        "on",
        ".inf",
        "lfs10",
        "[]",
        "{}",
        "-1",
        "1e400",
        "polling",
        "512MB",
        "'\\0'",
        '"\\0"',
        '"\\ud800"',
        "*a",
        "&a 1",
        "5",
        "9" * 50,
        "!!x y",
    ]
)
YAML = st.recursive(
    WORDS,
    lambda inner: (
        st.lists(inner, max_size=3).map(lambda items: f"[{', '.join(items)}]")
        | st.lists(st.tuples(KEYS | WORDS, inner), max_size=4).map(
            lambda pairs: "{" + ", ".join(f"{key}: {value}" for key, value in pairs) + "}"
        )
    ),
    max_leaves=12,
)
SECTIONS = st.lists(st.tuples(KEYS, YAML), max_size=6).map(
    lambda pairs: "".join(f"{key}: {value}\n" for key, value in pairs)
)


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(SECTIONS | st.text() | YAML)
@example("line: {port: x}\nslaves: [{id: 2, profile: /dev/null}]")
@example('line: {port: x}\nslaves: [{id: 2, profile: "."}]')
@example("line: {port: x}\nslaves: [[], {}, {id: []}, {id: {}}, ~]\ncommands: [{}]\nmqtt: {tls: {ca: {}}}")
@example('line: {port: x}\n"": 1\n? {a: 1}\n: 2')
def test_any_text_is_a_configuration_or_problems_with_their_places(text: str) -> None:
    Path("any.yaml").write_bytes(text.encode(errors="surrogatepass"))
    told: tuple[Problem, ...] = ()
    try:
        load(Path("any.yaml"), environment={}, host="gateway")
    except ConfigError as error:
        told = error.problems
    assert list(told) == sorted(set(told), key=lambda one: (one.file != "any.yaml", one))
    for problem in told:
        assert str(problem).isprintable()
        assert problem.line >= 1
        assert problem.column >= 1


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
