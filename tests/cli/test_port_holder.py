"""Who holds a busy port, and what to type instead."""

from __future__ import annotations

from pathlib import Path

import pytest

from lfs10d.cli.port_holder import HoldingDaemon, config_of, daemon_behind, device_name, instead
from lfs10d.modbus.port_lock import Holder


def process(proc: Path, pid: int, *argv: str) -> Holder:
    """Put a process into a /proc of the test's own; return it as a holder."""
    folder = proc / str(pid)
    folder.mkdir(parents=True)
    (folder / "cmdline").write_text("\0".join(argv) + "\0")
    return Holder(pid, "lfs10d")


def held_by(proc: Path, port: Path, pid: int, *argv: str) -> None:
    """Let a process of a /proc of the test's own hold the lock of `port`."""
    process(proc, pid, *argv)
    (proc / str(pid) / "comm").write_text("lfs10d\n")
    status = port.stat()
    major, minor = status.st_dev >> 8 & 0xFFF, status.st_dev & 0xFF
    (proc / "locks").write_text(f"1: FLOCK  ADVISORY  WRITE {pid} {major:02x}:{minor:02x}:{status.st_ino} 0 EOF\n")


@pytest.mark.parametrize(
    ("words", "config"),
    [
        ("lfs10d run", ""),
        ("lfs10d run -c /etc/lfs10d/lfs10d.yaml", ""),
        ("lfs10d run -c site.yaml", "site.yaml"),
        ("lfs10d run --config site.yaml", "site.yaml"),
        ("lfs10d run --config=site.yaml", "site.yaml"),
        ("lfs10d run -csite.yaml", "site.yaml"),
        ("lfs10d run --state-dir /tmp -c", ""),
    ],
)
def test_the_daemons_configuration_is_found_in_its_command_line(words: str, config: str) -> None:
    assert config_of(words.split()) == config


def test_a_configuration_of_another_name_is_repeated_for_each_verb() -> None:
    assert HoldingDaemon(7).option == ""
    assert HoldingDaemon(7, "/srv/my site.yaml").option == " -c '/srv/my site.yaml'"


def test_only_a_running_daemon_is_one(tmp_path: Path) -> None:
    assert daemon_behind(process(tmp_path, 7, "lfs10d", "run"), proc=tmp_path) == HoldingDaemon(7)
    assert daemon_behind(process(tmp_path, 8, "lfs10d", "scan", "/dev/x"), proc=tmp_path) is None
    assert daemon_behind(Holder(7, "mbpoll"), proc=tmp_path) is None
    assert daemon_behind(Holder(9, "lfs10d"), proc=tmp_path) is None


def test_a_device_is_called_as_the_daemons_configuration_calls_it(small: Path) -> None:
    text = small.read_text().replace("slaves: [2", "slaves: [{id: 7, name: mast-top}, 2")
    small.write_text(text)
    assert device_name(HoldingDaemon(1, str(small)), 7) == "mast-top"
    assert device_name(HoldingDaemon(1, str(small)), 9) == "slave-9"
    assert device_name(HoldingDaemon(1, str(small / "nothing")), 7) == "slave-7"


def test_where_nobody_can_tell_who_it_is_the_daemon_is_only_supposed(tmp_path: Path) -> None:
    (line,) = instead(str(tmp_path / "port"), slave=None, proc=tmp_path)
    assert line.startswith("If it is the lfs10d daemon")


def test_the_ways_around_a_daemon_are_told_in_aligned_lines(tmp_path: Path) -> None:
    port = tmp_path / "port"
    port.touch()
    held_by(tmp_path / "proc", port, 77, "lfs10d", "run")
    first, *ways = instead(str(port), slave=None, proc=tmp_path / "proc")
    assert first == "The daemon (lfs10d run, process 77) polls this line. Ask it instead:"
    assert ways[0].startswith("  lfs10d request line/scan ")
    assert ways[1].startswith("  lfs10d watch ")
    assert len({way.rindex("  ") for way in ways}) == 1
    assert "device=slave-3" in list(instead(str(port), slave=3, proc=tmp_path / "proc"))[1]


def test_another_program_needs_no_further_words(tmp_path: Path) -> None:
    port = tmp_path / "port"
    port.touch()
    held_by(tmp_path / "proc", port, 77, "lfs10d", "scan")
    assert list(instead(str(port), slave=None, proc=tmp_path / "proc")) == []
