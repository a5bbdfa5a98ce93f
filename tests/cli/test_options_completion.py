"""What a shell completes: ports, profiles, requests."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.support.verbs import Lfs10d


@pytest.mark.parametrize(
    ("typed", "completed"),
    [
        ("lfs10d read /dev/tty", "file,/dev/tty"),
        ("lfs10d scan /dev/tty", "file,/dev/tty"),
        ("lfs10d check -c /etc", "file,/etc"),
        ("lfs10d profiles show ld", "plain,ld-e"),
        ("lfs10d profiles show ./own", "file,./own"),
        ("lfs10d read /dev/ttyUSB0 2 --profile fu", "plain,fuling-dzb"),
        ("lfs10d simulate --profile eh", "plain,eh600"),
        ("lfs10d request line/b", "plain,line/baudrate"),
        ("lfs10d scan /dev/ttyUSB0 --framing a", "plain,ascii"),
    ],
)
def test_a_shell_completes_what_was_begun(lfs10d: Lfs10d, typed: str, completed: str) -> None:
    place = str(len(typed.split()) - 1)
    found = lfs10d(_LFS10D_COMPLETE="bash_complete", COMP_WORDS=typed, COMP_CWORD=place)
    assert found.stdout == f"{completed}\n"


def test_a_slave_id_that_is_no_number_is_called_no_slave_id(lfs10d: Lfs10d) -> None:
    wrong = lfs10d("read", "/dev/x", "two")
    assert wrong.returncode == 2
    assert "Invalid value for 'ID': 'two' is not a valid slave id." in wrong.stderr


@pytest.mark.parametrize(
    ("typed", "completed"),
    [
        ("lfs10d request device/options -c lfs10d.yaml int", ["plain,interval="]),
        ("lfs10d request -c lfs10d.yaml device/read device=s", ["plain,device=slave-2", "plain,device=slave-3"]),
        ("lfs10d request -c lfs10d.yaml device/read device = s", ["plain,slave-2", "plain,slave-3"]),
        ("lfs10d request -c none.yaml device/read device=s", [""]),
        ("lfs10d request line/baudrate to=19", ["plain,to=19200"]),
    ],
)
def test_keys_and_devices_of_a_request_are_completed(
    lfs10d: Lfs10d, small: Path, typed: str, completed: list[str]
) -> None:
    assert small.exists()
    place = str(len(typed.split()) - 1)
    found = lfs10d(_LFS10D_COMPLETE="bash_complete", COMP_WORDS=typed, COMP_CWORD=place)
    assert found.stdout.splitlines() == completed
