"""The double forgets: or every crash test would pass without a single fsync."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.support.volatile_disk import ForgetfulFiles, PowerCutError

A, B = Path("/f/a"), Path("/f/b")


def kept(*steps: str, surviving: set[Path] | None = None) -> dict[str, bytes]:
    """Return what is on the disk after these steps and a power cut."""
    files = ForgetfulFiles()
    files.write(A, b"old", mode=0o600)
    files.sync(A)
    files.sync_folder(A.parent)
    for step in steps:
        match step:
            case "write":
                files.write(A, b"new", mode=0o600)
            case "sync":
                files.sync(A)
            case "rename":
                files.rename(A, B)
            case "folder":
                files.sync_folder(A.parent)
            case "other folder":
                files.sync_folder(Path("/g"))
            case "remove":
                files.remove(A)
    files.power_cut(surviving or set())
    return {path.name: files.read(path) for path in files.seen}


@pytest.mark.parametrize(
    ("steps", "content"),
    [
        ((), {"a": b"old"}),
        (("write",), {"a": b"old"}),
        (("write", "sync"), {"a": b"new"}),
        (("rename",), {"a": b"old"}),
        (("rename", "other folder"), {"a": b"old"}),
        (("rename", "folder"), {"b": b"old"}),
        (("write", "rename", "folder"), {"b": b"old"}),
        (("remove",), {"a": b"old"}),
        (("remove", "folder"), {}),
    ],
)
def test_only_what_was_synced_is_kept(steps: tuple[str, ...], content: dict[str, bytes]) -> None:
    assert kept(*steps) == content


@pytest.mark.parametrize(
    ("steps", "surviving", "content"),
    [
        (("write",), {A}, {"a": b"new"}),
        (("remove",), {A}, {}),
        (("write", "rename"), {B}, {"a": b"new", "b": b"new"}),
    ],
)
def test_a_file_system_may_keep_more_than_was_synced(
    steps: tuple[str, ...], surviving: set[Path], content: dict[str, bytes]
) -> None:
    assert kept(*steps, surviving=surviving) == content


def test_the_power_fails_before_the_step_has_an_effect_and_no_exception_handler_sees_it() -> None:
    files = ForgetfulFiles(steps_left=1)
    files.write(A, b"x", mode=0o600)
    with pytest.raises(PowerCutError):
        files.remove(A)
    assert files.exists(A)
    assert not issubclass(PowerCutError, Exception)


def test_a_full_disk_takes_what_still_fits_and_fails() -> None:
    files = ForgetfulFiles(full=3)
    with pytest.raises(OSError, match="No space left"):
        files.write(A, b"xyzz", mode=0o600)
    assert files.read(A) == b"xyz"


def test_a_file_that_is_not_there_cannot_be_read() -> None:
    with pytest.raises(FileNotFoundError, match="No such file"):
        ForgetfulFiles().read(A)
