"""Where the daemon keeps what it must not forget, and where it shows its status."""

from __future__ import annotations

from pathlib import Path

import pytest

from lfs10d.daemon.state_directory import prepare, service_unit, state_directory, status_file, status_places
from lfs10d.errors import StateError


@pytest.mark.parametrize(
    ("file", "chosen", "environment", "directory"),
    [
        ("/etc/lfs10d/lfs10d.yaml", "/chosen", {"STATE_DIRECTORY": "/given"}, "/chosen"),
        ("/etc/lfs10d/lfs10d.yaml", None, {"STATE_DIRECTORY": "/given"}, "/given"),
        ("/etc/lfs10d/lfs10d.yaml", None, {"STATE_DIRECTORY": "/first:/second"}, "/first"),
        ("/etc/lfs10d/lfs10d.yaml", None, {"STATE_DIRECTORY": ""}, "/var/lib/lfs10d"),
        ("/etc/lfs10d/../lfs10d/lfs10d.yaml", None, {}, "/var/lib/lfs10d"),
        ("/etc/lfs10d/north.yaml", None, {}, "/var/lib/lfs10d-north"),
        ("/etc/lfs10d/more/north.yaml", None, {"HOME": "/home/me"}, "/home/me/.local/state/lfs10d/line0"),
        ("lfs10d.yaml", None, {"HOME": "/home/me"}, "/home/me/.local/state/lfs10d/line0"),
        ("lfs10d.yaml", None, {}, "/.local/state/lfs10d/line0"),
    ],
)
def test_the_state_directory_is_chosen_given_the_service_s_or_the_user_s(
    file: str, chosen: str | None, environment: dict[str, str], directory: str
) -> None:
    wanted = None if chosen is None else Path(chosen)
    assert state_directory(Path(file), "line0", chosen=wanted, environment=environment) == Path(directory)


@pytest.mark.parametrize(
    ("environment", "file"),
    [
        ({"RUNTIME_DIRECTORY": "/run/lfs10d:/run/more", "XDG_RUNTIME_DIR": "/run/user/7"}, "/run/lfs10d/status.json"),
        ({"XDG_RUNTIME_DIR": "/run/user/7"}, "/run/user/7/lfs10d-line0/status.json"),
        ({}, None),
    ],
)
def test_the_status_is_written_where_there_is_a_place_for_it(environment: dict[str, str], file: str | None) -> None:
    assert status_file(Path("lfs10d.yaml"), "line0", environment) == (None if file is None else Path(file))


@pytest.mark.parametrize(
    ("name", "folder"), [("/etc/lfs10d/lfs10d.yaml", "lfs10d"), ("/etc/lfs10d/roof.yaml", "lfs10d-roof")]
)
def test_root_by_hand_without_a_session_writes_the_status_where_the_verbs_look_first(name: str, folder: str) -> None:
    written = status_file(Path(name), "any", {}, root=True)
    assert written == Path("/run", folder, "status.json")
    assert status_places(Path(name), "any", {})[0] == written
    session = {"XDG_RUNTIME_DIR": "/run/user/0"}
    assert status_file(Path(name), "any", session, root=True) == status_file(Path(name), "any", session)


def test_root_without_a_session_writes_no_status_of_a_file_that_is_no_service_s() -> None:
    """Two of one name in different folders would overwrite each other's."""
    assert status_file(Path("/home/roof/lfs10d.yaml"), "any", {}, root=True) is None


def test_a_verb_looks_at_the_service_s_place_first() -> None:
    environment = {"XDG_RUNTIME_DIR": "/run/user/7"}
    assert status_places(Path("/etc/lfs10d/lfs10d.yaml"), "line0", environment) == (
        Path("/run/lfs10d/status.json"),
        Path("/run/user/7/lfs10d-line0/status.json"),
    )
    assert status_places(Path("north.yaml"), "north", {}) == (Path("/run/lfs10d-north/status.json"),)
    given = {"RUNTIME_DIRECTORY": "/run/lfs10d"}
    assert status_places(Path("lfs10d.yaml"), "line0", given) == (Path("/run/lfs10d/status.json"),)


def test_a_missing_state_directory_is_made_for_its_owner(tmp_path: Path) -> None:
    directory = tmp_path / "a" / "b"
    prepare(directory)
    prepare(directory)
    assert directory.stat().st_mode & 0o007 == 0
    assert list(directory.iterdir()) == []


def test_a_state_directory_that_cannot_be_written_says_what_to_do(tmp_path: Path) -> None:
    file = tmp_path / "file"
    file.write_text("")
    with pytest.raises(
        StateError, match=r"cannot be written: (file exists|not a directory); name another with --state"
    ):
        prepare(file)
    with pytest.raises(StateError, match="cannot be written: "):
        prepare(Path("/proc/lfs10d"))


@pytest.mark.parametrize(
    ("file", "unit"),
    [
        ("/etc/lfs10d/lfs10d.yaml", "lfs10d.service"),
        ("/etc/lfs10d/roof.yaml", "lfs10d@roof.service"),
        ("/home/me/lfs10d.yaml", None),
    ],
)
def test_a_file_of_the_system_has_its_unit(file: str, unit: str | None) -> None:
    assert service_unit(Path(file)) == unit
