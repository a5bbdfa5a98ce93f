"""How a verb logs in: with the service's own login as far as whoever calls may read it, else as it is told."""

from __future__ import annotations

from pathlib import Path

import pytest

from lfs10d.cli import login as logins
from lfs10d.cli.login import REMEDY, Login, log_in
from lfs10d.config import credentials
from lfs10d.config.credentials import DENIED
from lfs10d.errors import ConfigError
from lfs10d.system.secret import Secret

MQTT = "{host: localhost, username: daemon-line0%s}"


@pytest.fixture(autouse=True)
def system(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Have a folder of our own in place of /etc/lfs10d, and cores as they are."""
    monkeypatch.setattr("lfs10d.daemon.state_directory.SYSTEM_FOLDER", tmp_path)
    monkeypatch.setattr(logins, "leave_no_core", lambda: None)
    monkeypatch.delenv("CREDENTIALS_DIRECTORY", raising=False)


def written(folder: Path, more: str = "", name: str = "lfs10d.yaml") -> Path:
    file = folder / name
    file.write_text(f"line: {{port: /dev/x}}\nslaves: [2]\nmqtt: {MQTT % more}\n")
    return file


def entered(
    file: Path, *, username: str | None = None, password_file: Path | None = None, needed: bool = True
) -> Login:
    return log_in(file, "request", username=username, password_file=password_file, needed=needed)


def password(found: Login) -> str | None:
    secret = found.settings.password()
    return None if secret is None else secret.reveal()


def of_service(monkeypatch: pytest.MonkeyPatch, secret: str | None, why: str = "") -> list[str]:
    """Have systemd hand this to the service; return for which units it is asked."""
    units: list[str] = []

    def handed(unit: str) -> tuple[Secret | None, str]:
        units.append(unit)
        return None if secret is None else Secret(secret), why

    monkeypatch.setattr(logins, "service_password", handed)
    return units


@pytest.mark.parametrize(("name", "unit"), [("lfs10d.yaml", "lfs10d.service"), ("roof.yaml", "lfs10d@roof.service")])
def test_the_credential_of_the_service_is_found(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, unit: str
) -> None:
    units = of_service(monkeypatch, "of the service")
    found = entered(written(tmp_path, name=name))
    assert (password(found), found.settings.username, found.missing_password, units) == (
        "of the service",
        "daemon-line0",
        "",
        [unit],
    )


def test_where_it_may_not_be_read_that_is_kept_for_when_the_broker_refuses(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    of_service(monkeypatch, None, '"x" cannot be read: permission denied')
    found = entered(written(tmp_path))
    assert password(found) is None
    assert found.missing_password == (
        f'the password of lfs10d.service was not read: "x" cannot be read: permission denied; {REMEDY}'
    )


def test_a_file_that_is_no_service_s_has_no_credential(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "elsewhere").mkdir()
    units = of_service(monkeypatch, "of the service")
    found = entered(written(tmp_path / "elsewhere"))
    assert (password(found), found.missing_password, units) == (None, "", [])


def test_a_password_file_comes_before_a_credential_and_a_login_of_ones_own_before_both(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    units = of_service(monkeypatch, "of the service")
    (tmp_path / "pw").write_text("of the file")
    (tmp_path / "mine").write_text("mine")
    file = written(tmp_path, ", password_file: pw")
    assert password(entered(file)) == "of the file"
    own = entered(file, username="operator", password_file=tmp_path / "mine")
    assert (own.settings.username, password(own)) == ("operator", "mine")
    assert password(entered(file, username="guest")) is None
    monkeypatch.setenv("CREDENTIALS_DIRECTORY", str(tmp_path))
    (tmp_path / "mqtt-password").write_text("handed to us")
    assert password(entered(written(tmp_path))) == "handed to us"
    assert units == []


def test_a_password_file_that_may_not_be_read_is_an_error_with_what_to_do_unless_it_can_be_done_without(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "pw").write_text("secret")

    def denied(path: Path, most: int | None = None) -> bytes:
        raise PermissionError(13, "Permission denied", path, most)

    monkeypatch.setattr(credentials, "read_regular", denied)
    file = written(tmp_path, ", password_file: pw")
    with pytest.raises(ConfigError, match=DENIED):
        entered(file)
    assert capsys.readouterr().err == f"lfs10d: {REMEDY}\n"
    found = entered(file, needed=False)
    assert password(found) is None
    assert found.missing_password.endswith(f"cannot be read: permission denied; {REMEDY}")


def test_a_password_file_that_is_not_there_is_an_error_always(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = written(tmp_path, ", password_file: none")
    with pytest.raises(ConfigError, match="no such file"):
        entered(file, needed=False)
    assert capsys.readouterr().err == ""
