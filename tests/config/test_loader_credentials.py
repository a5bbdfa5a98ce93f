"""Passwords, certificates and what comes from the process, as the file names them."""

from __future__ import annotations

from pathlib import Path

import pytest

from lfs10d.config.loader import load
from lfs10d.errors import ConfigError
from tests.support.config_texts import SMALL, loaded, problems

pytestmark = pytest.mark.usefixtures("in_a_folder_of_its_own")


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
