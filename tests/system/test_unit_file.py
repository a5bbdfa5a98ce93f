"""A unit for one installation: its paths, its mark, and what the manager of a user's services can do of it."""

from __future__ import annotations

from pathlib import Path, PurePosixPath

import pytest

from lfs10d.system.unit_file import for_installation, for_user, is_unchanged, marked

UNITS = Path(__file__).parents[2] / "systemd"
BOTH = ("lfs10d.service", "lfs10d@.service")
ALL = (*BOTH, "lfs10d-web.service")
PROGRAM = PurePosixPath("/opt/pipx/venvs/lfs10d/bin/lfs10d")
PAGES = PurePosixPath("/opt/pipx/venvs/lfs10d/share/doc/lfs10d")


def text_of(unit: str) -> str:
    return (UNITS / unit).read_text()


@pytest.mark.parametrize("unit", ALL)
def test_a_unit_names_this_installation_and_is_otherwise_the_shipped_one(unit: str) -> None:
    made = for_installation(text_of(unit), PROGRAM, PAGES)
    assert "/opt/lfs10d" not in made
    assert made.replace("/opt/pipx/venvs/lfs10d/", "/opt/lfs10d/") == text_of(unit)


@pytest.mark.parametrize("bad", ["/opt/a b/bin/lfs10d", "/opt/100%/bin/lfs10d", "/opt/'/bin/lfs10d"])
def test_a_path_that_a_command_line_cannot_carry_is_refused(bad: str) -> None:
    with pytest.raises(ValueError, match="a unit cannot carry this path"):
        for_installation(text_of(BOTH[0]), PurePosixPath(bad), PAGES)
    with pytest.raises(ValueError, match="a unit cannot carry this path"):
        for_user(text_of(BOTH[0]), PurePosixPath(bad))


@pytest.mark.parametrize("unit", BOTH)
def test_a_unit_of_a_user_asks_for_nothing_that_needs_privileges(unit: str) -> None:
    made = for_user(text_of(unit), PurePosixPath("/home/ada/.config/lfs10d"))
    keys = {line.partition("=")[0] for line in made.splitlines() if "=" in line and not line.startswith("#")}
    privileged = (
        "Protect",
        "Private",
        "Device",
        "Capability",
        "Ambient",
        "Dynamic",
        "State",
        "Runtime",
        "Supplementary",
    )
    assert not [key for key in keys if key.startswith(privileged)]
    assert {"Type", "ExecStart", "ExecReload", "WatchdogSec", "NoNewPrivileges", "SystemCallFilter"} <= keys
    assert "/etc/lfs10d" not in made
    assert "run -c /home/ada/.config/lfs10d/" in made
    assert made.endswith("\n[Install]\nWantedBy=default.target\n")
    assert "\n\n\n" not in made


def test_a_unit_is_known_again_until_somebody_changes_it() -> None:
    written = marked(text_of(BOTH[0]), "1.0.0")
    assert is_unchanged(written)
    assert not is_unchanged(written.replace("WatchdogSec=30s", "WatchdogSec=60s"))
    assert not is_unchanged(text_of(BOTH[0])), "one that was copied by hand belongs to a person"
    assert is_unchanged(marked(text_of(BOTH[0]).replace("30s", "20s"), "0.9.0")), "what an older version wrote"
