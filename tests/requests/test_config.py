"""`config/get` and `config/reload`."""

from __future__ import annotations

from typing import TYPE_CHECKING

from lfs10d.errors import ConfigError, Problem

if TYPE_CHECKING:
    from tests.requests.conftest import Ask, FakePowers


def test_the_configuration_is_told(ask: Ask) -> None:
    assert ask("config/get").data == {"config": {}, "origins": {}}


def test_a_reload_tells_what_was_applied_and_what_needs_a_restart(ask: Ask) -> None:
    assert ask("config/reload").data == {"applied": ["poll.interval"], "restart_required": []}


def test_a_broken_file_is_rejected_with_its_first_line(ask: Ask, powers: FakePowers) -> None:
    powers.broken = ConfigError(
        (
            Problem("lfs10d.yaml", 3, 9, "poll.interval", "must be more"),
            Problem("lfs10d.yaml", 5, 1, "slaves", "no list"),
        )
    )
    answer = ask("config/reload")
    assert (answer.status, answer.code) == ("rejected", "invalid_param")
    assert answer.message == "lfs10d.yaml:3:9: poll.interval: must be more"
