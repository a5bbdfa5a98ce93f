"""Nothing is waited for that is no file, and nothing is written through a link."""

from __future__ import annotations

import os
import socket
import stat
from pathlib import Path

import pytest

from lfs10d.system.regular_file import create_private, make_private, read_regular, write_new


def mode(path: Path) -> int:
    return stat.S_IMODE(path.stat().st_mode)


@pytest.mark.parametrize(("most", "content"), [(None, b"abcdef"), (4, b"abcd"), (100, b"abcdef"), (0, b"")])
def test_a_file_is_read_through_a_link_too(tmp_path: Path, most: int | None, content: bytes) -> None:
    (tmp_path / "file").write_bytes(b"abcdef")
    (tmp_path / "link").symlink_to("file")
    assert read_regular(tmp_path / "link", most) == content


def test_a_pipe_is_refused_and_not_waited_for(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    for attempt in (read_regular, make_private):
        with pytest.raises(OSError, match="it is a pipe, and must be a regular file"):
            attempt(tmp_path / "pipe")


def test_a_device_a_socket_and_a_folder_are_refused(tmp_path: Path) -> None:
    with pytest.raises(OSError, match="it is a device, and must be a regular file"):
        read_regular(Path("/dev/zero"))
    with pytest.raises(IsADirectoryError, match="Is a directory"):
        read_regular(tmp_path)
    with socket.socket(socket.AF_UNIX) as listening:
        listening.bind(str(tmp_path / "socket"))
        with pytest.raises(OSError, match="No such device or address"):
            read_regular(tmp_path / "socket")


def test_a_new_file_takes_the_place_of_a_link_and_leaves_alone_what_it_leads_to(tmp_path: Path) -> None:
    victim, draft = tmp_path / "victim", tmp_path / "draft"
    victim.write_bytes(b"precious")
    draft.symlink_to(victim)
    write_new(draft, b"new", mode=0o644)
    assert (victim.read_bytes(), draft.read_bytes(), draft.is_symlink()) == (b"precious", b"new", False)


def test_a_new_file_takes_the_place_of_a_pipe_without_waiting_and_of_one_of_other_rights(tmp_path: Path) -> None:
    draft = tmp_path / "draft"
    os.mkfifo(draft)
    before = os.umask(0o077)
    try:
        write_new(draft, b"one", mode=0o644)
        assert (draft.read_bytes(), mode(draft)) == (b"one", 0o644)
        write_new(draft, b"two", mode=0o600)
    finally:
        os.umask(before)
    assert (draft.read_bytes(), mode(draft)) == (b"two", 0o600)


def test_a_private_file_is_created_so_and_made_so(tmp_path: Path) -> None:
    new, old, missing = tmp_path / "new", tmp_path / "old", tmp_path / "missing"
    old.write_bytes(b"kept")
    old.chmod(0o644)
    before = os.umask(0)
    try:
        create_private(new)
    finally:
        os.umask(before)
    create_private(old)
    make_private(missing)
    assert [mode(path) for path in (new, old)] == [0o600, 0o600]
    assert old.read_bytes() == b"kept"
    assert not missing.exists()
    old.chmod(0o400)
    make_private(old)
    assert mode(old) == 0o400


def test_nothing_private_is_made_through_a_link(tmp_path: Path) -> None:
    victim = tmp_path / "victim"
    victim.write_bytes(b"public")
    victim.chmod(0o644)
    for target in (victim, tmp_path / "nowhere"):
        link = tmp_path / f"link-{target.name}"
        link.symlink_to(target)
        with pytest.raises(OSError, match="Too many levels of symbolic links"):
            create_private(link)
    assert mode(victim) == 0o644
    assert not (tmp_path / "nowhere").exists()
