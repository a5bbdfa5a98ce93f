"""Pipes and symbolic links where the daemon has its files: nothing hangs, and nothing else is written to."""

from __future__ import annotations

import os
import stat
from pathlib import Path

import pytest

from tests.support.sites import Site, View, good


@pytest.mark.parametrize("what", ["configuration", "profile", "password"])
def test_a_pipe_in_place_of_a_file_of_the_configuration_is_an_error_with_its_place(site: Site, what: str) -> None:
    pipe = site.folder / "pipe"
    os.mkfifo(pipe)
    match what:
        case "configuration":
            site.write()
            site.file.unlink()
            os.mkfifo(site.file)
        case "profile":
            site.write(slaves=[{"id": 1, "profile": str(pipe)}])
        case "password":
            site.write(mqtt={"username": "u", "password_file": str(pipe)})
    run = site.run()
    assert run.ends(within=10) == 78
    assert "it is a pipe, and must be a regular file" in run.log


def test_pipes_and_links_in_the_state_directory_neither_hang_the_daemon_nor_reach_other_files(
    site: Site, view: View
) -> None:
    state, runtime = site.folder / "state", site.folder / "run-0"
    state.mkdir()
    os.mkfifo(state / "boot")
    os.mkfifo(state / "journal.json")
    victims = [site.folder / f"victim-{n}" for n in range(3)]
    for victim, link in zip(victims, (state / ".boot.new", state / ".writable", site.folder / "tmp"), strict=True):
        victim.write_text("precious")
        link.symlink_to(victim)
    site.line()
    site.write()
    run = site.run()
    run.ready()
    view.wait_samples("slave-1", 2, good)
    (runtime / "status.tmp").symlink_to(victims[2])
    written = run.status.stat().st_mtime_ns
    while run.status.stat().st_mtime_ns == written:
        run.says("port is open")
    assert [victim.read_text() for victim in victims] == ["precious"] * 3
    assert "journal.json cannot be read: it is a pipe" in run.log
    assert (state / "boot").is_file()
    assert run.ends(15) == 0


def test_a_pipe_as_the_file_of_changes_is_told_and_what_it_says_is_left_as_it_is(site: Site, view: View) -> None:
    (site.folder / "state").mkdir()
    os.mkfifo(site.folder / "state/changes.yaml")
    site.line()
    site.write()
    run = site.run()
    view.wait_samples("slave-1", 2, good)
    run.says("changes.yaml cannot be read: it is a pipe, and must be a regular file")
    assert stat.S_ISFIFO((site.folder / "state/changes.yaml").stat().st_mode)


def test_the_backlog_is_its_owner_s_alone_one_of_before_too(site: Site) -> None:
    """No broker, so that it is written; the umask of the test is the usual one."""
    state = site.folder / "state"
    state.mkdir()
    old = state / "backlog.db"
    old.touch(mode=0o644)
    old.chmod(0o644)
    site.line()
    site.write()
    run = site.run()
    run.ready()
    run.ends(15)
    assert _modes(state) == {"backlog.db": 0o600}


def _modes(state: Path) -> dict[str, int]:
    return {path.name: stat.S_IMODE(path.stat().st_mode) for path in state.glob("backlog.db*")}
