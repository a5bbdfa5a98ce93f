"""docs/profiles.md taken at its word: what a newcomer types, in order, against a simulated vane."""

from __future__ import annotations

import json
import re
import shlex
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.support import forked
from tests.support.brokers import eventually

PAGE = (Path(__file__).parents[2] / "docs" / "profiles.md").read_text()
COMMANDS = re.findall(r"^    \$ lfs10d (.+)$", PAGE, re.MULTILINE)


def lfs10d(folder: Path, *arguments: str) -> str:
    """Return what the program prints; it must succeed."""
    done = forked.run(arguments, cwd=folder)
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.fixture(name="folder")
def _folder(tmp_path: Path) -> Path:
    """Give the newcomer's folder, with the file as the page prints it."""
    (example,) = re.findall(r"^```yaml\n(.+?)^```$", PAGE, re.MULTILINE | re.DOTALL)
    (tmp_path / "wind-vane.yaml").write_text(example)
    return tmp_path


@pytest.fixture(name="vane")
def _vane(folder: Path) -> Iterator[Path]:
    """Give the port of the vane that the page's own command simulates."""
    link = folder / "vane"
    (command,) = (each for each in COMMANDS if each.startswith("simulate"))
    arguments = [str(link) if each == "/tmp/vane" else each for each in shlex.split(command)]  # noqa: S108 - the page's
    with subprocess.Popen([sys.executable, "-m", "lfs10d", *arguments], cwd=folder, stdout=subprocess.PIPE) as simulate:
        eventually(link.exists, "the simulated vane")
        yield link
        simulate.send_signal(signal.SIGINT)


def test_every_command_of_the_page_does_what_it_says(folder: Path, vane: Path) -> None:
    verbs = []
    for command in COMMANDS:
        verb, *arguments = shlex.split(command)
        ports = [str(vane) if each in {"/dev/ttyUSB0", "/tmp/vane"} else each for each in arguments]  # noqa: S108 - the page's own example
        verbs.append(verb)
        match verb:
            case "profiles":
                assert "wind_direction  0x0000" in lfs10d(folder, verb, *ports)
            case "read":
                ports.remove("--watch")
                assert json.loads(lfs10d(folder, verb, *ports, "--json"))["units"]["wind_direction"] == "°"
            case "scan":
                found = json.loads(lfs10d(folder, verb, *ports, "--ids", "7", "--baudrate", "9600", "--json"))["found"]
                assert [(each["id"], each["profile"]) for each in found] == [(7, "wind-vane")]
    assert set(verbs) == {"profiles", "read", "simulate", "scan", "request"}


def test_the_slaves_of_the_page_fit_into_a_configuration(folder: Path) -> None:
    (folder / "profiles").mkdir()
    (folder / "wind-vane.yaml").rename(folder / "profiles" / "wind-vane.yaml")
    (slaves,) = re.findall(r"^    slaves:\n(?:      .+\n)+", PAGE, re.MULTILINE)
    (folder / "lfs10d.yaml").write_text(
        "line: {port: /dev/ttyUSB0}\nmqtt: {host: localhost}\n" + slaves.replace("    slaves", "slaves")
    )
    assert "vane" in lfs10d(folder, "check", "-c", "lfs10d.yaml")
