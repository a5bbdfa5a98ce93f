"""Starting on bad input: what a person is told, and the exit code."""

from __future__ import annotations

import re
import shlex
import sys
from pathlib import Path

import pytest

from tests.support.sites import Site, View, eventually, good

EXIT_CONFIG = 78
EXIT_USAGE = 2


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("line: [", "lfs10d.yaml:1:"),
        ("", "the file is empty"),
        ("9", "must be a mapping"),
        ("{}", "line"),
        ("line: {port: /dev/ttyUSB0, baudrate: 9601}\nslaves: [0, 256]\n", "lfs10d.yaml:1:38: line.baudrate: "),
        ("line: &a {port: x, rs485: *a}", "lfs10d.yaml:1:"),
        ("[" * 5000, "lfs10d.yaml:1:"),
        ("\x00", "lfs10d.yaml:1:"),
        ("line: {port: x}\nmqtt: {password_file: absent}\n", "lfs10d.yaml:2:23: mqtt.password_file: "),
        ("line: {port: x}\nmqtt: {tls: {ca: absent}}\n", "lfs10d.yaml:2:18: mqtt.tls.ca: "),
        ("line: {port: x}\nslaves: [{id: 1, profile: absent.yaml}]\n", "lfs10d.yaml:2:27: slaves[0].profile: "),
    ],
)
def test_a_file_that_is_wrong_is_told_with_its_place_and_ends_with_78(site: Site, text: str, words: str) -> None:
    site.file.write_text(text)

    run = site.run()

    assert run.ends() == EXIT_CONFIG
    assert words in run.log
    assert not run.manager.told


def test_all_errors_of_a_file_are_told(site: Site) -> None:
    site.write(poll={"interval": "soon"}, slaves=[0], mqtt={"port": "x"})

    run = site.run()

    assert run.ends() == EXIT_CONFIG
    assert len(run.log.splitlines()) == 3


@pytest.mark.parametrize("place", ["absent.yaml", "."])
def test_a_file_that_is_none_ends_with_78(site: Site, place: str) -> None:
    run = site.run("-c", str(site.folder / place))

    assert run.ends() == EXIT_CONFIG
    assert str(site.folder / place) in run.log
    assert len(run.log.splitlines()) == 1


def test_an_unknown_option_ends_with_2(site: Site) -> None:
    run = site.run("--fast")

    assert run.ends() == EXIT_USAGE
    assert "--fast" in run.log


def test_without_a_state_directory_it_measures_on_and_says_so(site: Site, view: View) -> None:
    site.line()
    site.write()
    run = site.run("--state-dir", "/proc/nowhere")

    error = view.wait("line/error", lambda error: error["active"])
    view.wait("device/slave-1/state", good)

    assert error["code"] == "storage_full"
    assert run.log.count("the state directory /proc/nowhere cannot be written") == 1
    assert "--state-dir" in error["message"]


def test_a_state_directory_that_can_be_written_again_is_found_at_a_reload_and_keeps_the_boot(
    site: Site, view: View
) -> None:
    place = site.folder / "place"
    place.write_text("a file")
    site.line()
    site.write(slaves=[])
    run = site.run("--state-dir", str(place / "state"))
    view.wait("line/error", lambda error: error["code"] == "storage_full")

    place.unlink()
    run.reload()

    assert view.wait("line/error", lambda error: not error["active"])["last_code"] == "storage_full"
    assert (place / "state" / "boot").read_text().strip() == view.newest("info")["boot"]


@pytest.mark.parametrize("redirection", ["2>&-", "2>&- >&- <&-", "2>/dev/full", ">&- 2>/dev/full"])
def test_an_output_nobody_can_write_to_changes_nothing_on_the_line(site: Site, view: View, redirection: str) -> None:
    served = site.line()
    site.write(poll={"interval": "50ms"}, log={"level": "debug"})
    start = f'exec {shlex.quote(sys.executable)} -m lfs10d "$@" {redirection}'
    code = f"import os, sys; os.execv('/bin/sh', ['sh', '-c', {start!r}, 'sh', *sys.argv[1:]])"
    run = site.run(program=("-c", code))

    view.wait_samples("slave-1", 10, good)

    sent = b"".join(request.frame for request in list(served.line.log))
    assert len(sent) >= 10 * 8
    assert not re.search(rb"info|debug|slave", sent), "the log went to the port"
    assert str(Path(f"/proc/{run.process.pid}/fd/2").readlink()) in {"/dev/null", "/dev/full"}
    assert run.ends(15) == 0


def test_a_port_that_may_not_be_opened_is_named_and_awaited(site: Site) -> None:
    site.write(line={"port": "/dev/null"})

    run = site.run()

    run.says("/dev/null")
    run.ready()
    eventually(lambda: run.log.count("tried again until it is back") == 1, "told once")
    assert Path(f"/proc/{run.process.pid}").exists()
