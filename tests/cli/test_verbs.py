"""The command line as a whole: verbs, help, and what is imported when."""

from __future__ import annotations

import importlib
import json
import subprocess
import sys

import click
import pytest
from click.testing import CliRunner

from lfs10d import __version__
from lfs10d.cli import PLACES, VERBS
from lfs10d.cli import lfs10d as group
from tests.support.verbs import Lfs10d

BUILT = group.list_commands(click.Context(group))


def test_the_verbs_that_are_there_are_listed_in_order() -> None:
    assert [verb for verb in VERBS if verb in BUILT] == BUILT
    assert {"check", "config"} <= set(BUILT)


@pytest.mark.parametrize("verb", BUILT)
def test_every_verb_has_help_with_examples(verb: str) -> None:
    result = CliRunner().invoke(group, [verb, "--help"], prog_name="lfs10d")
    assert result.exit_code == 0
    assert "Examples:" in result.output
    assert f"lfs10d {verb}" in result.output.partition("Examples:")[2]


@pytest.mark.parametrize("verb", BUILT)
def test_every_module_of_a_verb_holds_its_command(verb: str) -> None:
    assert importlib.import_module(PLACES.get(verb, f"lfs10d.cli.{verb}")).command.name == verb


def test_help_shows_every_verb_and_examples() -> None:
    result = CliRunner().invoke(group, ["--help"], prog_name="lfs10d")
    assert result.exit_code == 0
    assert all(VERBS[verb] in result.output for verb in BUILT)
    assert "Examples:" in result.output


def test_a_verb_that_is_none_is_an_error_of_usage(lfs10d: Lfs10d) -> None:
    result = lfs10d("chekc")
    assert result.returncode == 2
    assert "No such command 'chekc'" in result.stderr


def test_a_module_that_is_no_verb_cannot_be_called(lfs10d: Lfs10d) -> None:
    assert lfs10d("columns").returncode == 2


def test_the_version_is_told(lfs10d: Lfs10d) -> None:
    result = lfs10d("--version")
    assert (result.returncode, result.stdout) == (0, f"lfs10d {__version__}\n")


def test_a_shell_can_complete_verbs_and_options(lfs10d: Lfs10d) -> None:
    script = lfs10d(_LFS10D_COMPLETE="bash_source")
    assert "_lfs10d_completion" in script.stdout
    words = lfs10d(_LFS10D_COMPLETE="bash_complete", COMP_WORDS="lfs10d ch", COMP_CWORD="1")
    assert words.stdout == "plain,check\n"


@pytest.mark.parametrize(
    "verb", [verb for verb in ("check", "config", "run", "request", "watch", "trace") if verb in BUILT]
)
def test_a_verb_that_draws_nothing_imports_nothing_to_draw_with(verb: str) -> None:
    program = f"import json, sys, lfs10d.cli.exit_status, lfs10d.cli.{verb}; print(json.dumps(sorted(sys.modules)))"
    result = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    imported = {name.partition(".")[0] for name in json.loads(result.stdout)}
    assert not imported & {"rich", "amqtt"}


def test_a_request_is_described_without_what_speaks_to_a_line() -> None:
    """Each completion by the Tab key begins with these imports."""
    program = "import json, sys, lfs10d.cli.exit_status, lfs10d.cli.request; print(json.dumps(sorted(sys.modules)))"
    result = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    imported = set(json.loads(result.stdout))
    jobs = {name for name in imported if name.startswith("lfs10d.line.jobs.")}
    assert jobs == {"lfs10d.line.jobs.access_end", "lfs10d.line.jobs.scan_ids"}
    assert not imported & {"lfs10d.modbus.bus", "lfs10d.reconfiguration.adopt", "lfs10d.line.device"}
