"""A password that never prints itself, and a process that leaves no core with it."""

from __future__ import annotations

import copy
import pickle
import resource

import pytest

from lfs10d.system.secret import Secret, leave_no_core


def test_only_reveal_shows_the_text() -> None:
    secret = Secret("hunter2")
    assert secret.reveal() == "hunter2"
    assert "hunter2" not in f"{secret} {secret!r} {secret!s} {secret:>20} {[secret]} {vars(type(secret))}"
    assert f"{secret:>5}" == "  ***"


def test_secrets_compare_by_their_text_so_that_a_reload_sees_a_change() -> None:
    assert Secret("ä") == Secret("ä")
    assert Secret("a") != Secret("b")
    assert Secret("a") != "a"
    assert len({Secret("a"), Secret("a")}) == 1


def test_a_secret_is_not_written_down() -> None:
    with pytest.raises(TypeError, match="not written down"):
        pickle.dumps(Secret("a"))
    with pytest.raises(TypeError, match="not written down"):
        copy.deepcopy(Secret("a"))


@pytest.mark.parametrize(
    ("hard", "limit"),
    [(resource.RLIM_INFINITY, 1), (10_000_000, 1), (1, 1), (0, 0)],
    ids=["unlimited", "limited", "one byte", "none"],
)
def test_no_core_is_left_whatever_was_allowed_before(hard: int, limit: int, monkeypatch: pytest.MonkeyPatch) -> None:
    set_to: list[tuple[int, tuple[int, int]]] = []
    monkeypatch.setattr(resource, "getrlimit", lambda _: (0, hard))
    monkeypatch.setattr(resource, "setrlimit", lambda which, limits: set_to.append((which, limits)))

    leave_no_core()

    assert set_to == [(resource.RLIMIT_CORE, (limit, limit))]
