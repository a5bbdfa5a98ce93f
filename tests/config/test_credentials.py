"""The files of the login."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from lfs10d.config import credentials
from lfs10d.config.credentials import (
    UnreadableError,
    credential_file,
    missing_in_authorities,
    password_in,
    readable,
    reason,
    service_password,
    unreadable,
)
from lfs10d.config.models import MqttConfig

NULL_BYTE = "embedded null byte" if sys.version_info < (3, 13) else "open: embedded null character in path"
"""How Python words it."""


@pytest.fixture(autouse=True)
def in_a_folder_of_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


@pytest.mark.parametrize(
    ("content", "password"),
    [
        ("a", "a"),
        ("a\n", "a"),
        ("a b \r\nmore", "a b "),
        ("\ufeffhunter2\n", "hunter2"),
        ("geh\u00e9im\n", "geh\u00e9im"),
    ],
)
def test_the_password_is_the_first_line(content: str, password: str) -> None:
    Path("pw").write_bytes(content.encode())
    assert password_in(Path("pw")).reveal() == password


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", '"pw" must hold the password in its first line'),
        (b"\xef\xbb\xbf\n", '"pw" must hold the password in its first line'),
        (b"x" * 65_536, '"pw" must hold the password in its first line'),
        (b"\xff", '"pw" is no UTF-8 text'),
        (None, '"pw" cannot be read: no such file or directory'),
    ],
)
def test_a_file_without_a_password_is_unreadable(content: bytes | None, message: str) -> None:
    if content is not None:
        Path("pw").write_bytes(content)
    with pytest.raises(UnreadableError) as refused:
        password_in(Path("pw"))
    assert str(refused.value) == message


@pytest.mark.parametrize(("path", "message"), [(".", "is a directory"), ("a\0b", NULL_BYTE)])
def test_what_is_no_file_is_unreadable(path: str, message: str) -> None:
    with pytest.raises(UnreadableError, match=message):
        readable(Path(path))


def test_the_reason_is_the_system_s() -> None:
    assert reason(PermissionError(13, "Permission denied")) == "permission denied"
    assert reason(ValueError("Odd")) == "odd"


def test_the_credential_is_a_file_that_systemd_put_there() -> None:
    assert credential_file({}) is None
    assert credential_file({"CREDENTIALS_DIRECTORY": "."}) is None
    Path("mqtt-password").write_text("a")
    assert credential_file({"CREDENTIALS_DIRECTORY": "."}) == Path("mqtt-password")


def test_what_is_not_named_cannot_be_unreadable() -> None:
    assert list(unreadable(MqttConfig())) == []
    assert list(unreadable(MqttConfig.model_validate({"tls": {}}))) == []


def test_every_file_that_is_missing_is_told_at_its_key() -> None:
    tls = {"ca": "ca.pem", "cert": "cert.pem", "key": "key.pem"}
    mqtt = MqttConfig.model_validate({"password_file": "pw", "tls": tls})
    assert [keys for keys, _ in unreadable(mqtt)] == [("mqtt", "password_file")] + [("mqtt", "tls", key) for key in tls]


def test_files_that_are_no_certificates_are_told_at_their_keys() -> None:
    for name in ("ca.pem", "cert.pem"):
        Path(name).write_text("nonsense")
    found = dict(unreadable(MqttConfig.model_validate({"tls": {"ca": "ca.pem", "cert": "cert.pem"}})))
    assert found == {
        ("mqtt", "tls", "ca"): '"ca.pem" holds no certificate in PEM form',
        ("mqtt", "tls", "cert"): '"cert.pem" and its key cannot be used: both in PEM form, matching, no passphrase?',
    }


@pytest.mark.needs("openssl")
def test_a_certificate_and_its_key_are_taken_but_a_passphrase_is_never_asked_for() -> None:
    subject = ["-subj", "/CN=gateway", "-days", "2", "-newkey", "rsa:2048"]
    make = ["openssl", "req", "-x509", "-noenc", *subject, "-keyout", "key.pem", "-out", "cert.pem"]
    subprocess.run(make, check=True, capture_output=True)
    lock = ["openssl", "rsa", "-aes128", "-passout", "pass:hunter2", "-in", "key.pem", "-out", "locked.pem"]
    subprocess.run(lock, check=True, capture_output=True)
    tls = {"ca": "cert.pem", "cert": "cert.pem", "key": "key.pem"}
    assert list(unreadable(MqttConfig.model_validate({"tls": tls}))) == []
    (found,) = unreadable(MqttConfig.model_validate({"tls": {**tls, "key": "locked.pem"}}))
    assert found[0] == ("mqtt", "tls", "cert")


def test_the_longest_password_may_have_a_byte_order_mark_and_a_line_end() -> None:
    Path("pw").write_bytes(b"\xef\xbb\xbf" + b"x" * 65_535 + b"\r\n")
    assert len(password_in(Path("pw")).reveal()) == 65_535


BY_MOSQUITTO_TLS = ("-new", "-x509", "-days", "2", "-extensions", "v3_ca")
"""The authority of mosquitto-tls(7)."""


@pytest.mark.needs("openssl")
@pytest.mark.parametrize(
    ("options", "missing"),
    [
        (BY_MOSQUITTO_TLS, ("key usage",)),
        ((*BY_MOSQUITTO_TLS, "-addext", "keyUsage=critical,keyCertSign,cRLSign"), ()),
        (
            ("-new", "-x509", "-days", "2", "-extensions", "bare", "-config", "bare.cnf"),
            ("key usage", "a subject key identifier", "critical basic constraints"),
        ),
    ],
)
def test_what_strict_clients_miss_in_an_authority_is_named(options: tuple[str, ...], missing: tuple[str, ...]) -> None:
    Path("bare.cnf").write_text(
        "[req]\ndistinguished_name=dn\n[dn]\n[bare]\nbasicConstraints=CA:true\nsubjectKeyIdentifier=none\n"
    )
    make = ["openssl", "req", *options, "-subj", "/CN=mast", "-newkey", "rsa:2048", "-noenc", "-keyout", "k"]
    subprocess.run([*make, "-out", "ca.pem"], check=True, capture_output=True)
    assert missing_in_authorities("ca.pem") == missing


def test_a_file_without_authorities_misses_nothing() -> None:
    assert missing_in_authorities("ca.pem") == ()


def test_the_password_of_a_service_is_what_systemd_hands_to_it_else_what_is_kept_for_it() -> None:
    unit, run, kept = "lfs10d@roof.service", Path("run"), Path("etc")
    assert service_password(unit, run, kept) == (None, "")
    kept.mkdir()
    (kept / "mqtt-password").write_text("kept\n")
    found, why = service_password(unit, run, kept)
    assert (found and found.reveal(), why) == ("kept", "")
    (run / unit).mkdir(parents=True)
    (run / unit / "mqtt-password").write_text("handed over\n")
    found, why = service_password(unit, run, kept)
    assert (found and found.reveal(), why) == ("handed over", "")


def test_a_password_of_a_service_that_cannot_be_read_is_named_with_the_reason(monkeypatch: pytest.MonkeyPatch) -> None:
    unit, run, kept = "lfs10d.service", Path("run"), Path("etc")
    (run / unit).mkdir(parents=True)
    (run / unit / "mqtt-password").touch()
    assert service_password(unit, run, kept) == (
        None,
        '"run/lfs10d.service/mqtt-password" must hold the password in its first line',
    )

    def denied(*_: object, **__: object) -> None:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(credentials, "read_regular", denied)
    monkeypatch.setattr(Path, "stat", denied)
    _, why = service_password(unit, run, kept)
    assert why == (
        '"run/lfs10d.service/mqtt-password" cannot be read: permission denied; '
        '"etc/mqtt-password" cannot be read: permission denied'
    )
