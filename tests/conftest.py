"""What all tests share: programs they need, a real mosquitto, an independent listener, a certificate authority.

`LFS10D_EXAMPLES=20000` in the environment lets hypothesis try so many examples of each law, where a law does not say.

`needs("program", ...)` marks a test that starts a program: where it is absent the test fails in CI (`CI` is
set) and is skipped elsewhere, with one line that says what to install.

Where several workers share the tests (`make test`), tests that wait for other programs and tests that compute go to
different workers: see `tests.support.sharing`. Every worker collects all tests. In a new clone pytest rewrites the
assertions of each file first, which takes half a minute: each worker begins in another folder, and finds written what
the others have done.
"""

from __future__ import annotations

import gc
import os
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bench.broker import free_port
from tests.support import sharing
from tests.support.brokers import Authority, Mosquitto, path_of

settings.register_profile("ours", max_examples=int(os.environ.get("LFS10D_EXAMPLES", "100")), deadline=None)
settings.load_profile("ours")  # without a deadline: a busy machine is no failure


def pytest_configure(config: pytest.Config) -> None:
    """Let each worker collect the folders in an order of its own, and those that compute be last to be served."""
    worker = sharing.this_worker()
    if worker is not None and config.args == ["tests"]:
        number, workers = worker
        entries = sorted(f"tests/{each.name}" for each in Path("tests").iterdir() if _collected(each))
        begin = len(entries) * number // workers
        config.args = entries[begin:] + entries[:begin]
    if worker is not None and config.workerinput["sharing"]:  # type: ignore[attr-defined]  # xdist's
        sharing.take_place(*worker)


def _collected(path: Path) -> bool:
    return (path.is_dir() and path.name != "__pycache__") or path.match("test_*.py")


@pytest.hookimpl(optionalhook=True)
def pytest_configure_node(node: Any) -> None:  # noqa: ANN401 - xdist's WorkerController
    """Tell a worker whether the tests are shared by kind."""
    node.workerinput["sharing"] = _by_kind(node.config)


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: object) -> sharing.Sharing | None:
    """Share the tests by kind where a file would go to one worker."""
    return sharing.Sharing(config, log) if _by_kind(config) else None


def _by_kind(config: pytest.Config) -> bool:
    return bool(config.getoption("dist") == "loadfile")


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    if hasattr(config, "workerinput"):  # a worker of xdist's: every one finds the same order
        items[:] = sharing.ordered(items)


@given(st.none())
def first_example(_: None) -> None:
    """Have Hypothesis register its random generator: it looks for who refers to it, and finds nobody who is frozen."""


def pytest_collection_finish() -> None:
    """Let the collector of garbage pass over the thousands of tests that stay to the end."""
    first_example()
    gc.freeze()


def pytest_runtest_setup(item: pytest.Item) -> None:
    for mark in item.iter_markers("needs"):
        for name in mark.args:
            path_of(name)


@pytest.fixture(name="program", scope="session")
def _program() -> Callable[[str], str]:
    """Give the function that finds a program, or fails in CI and skips elsewhere."""
    return path_of


@pytest.fixture
def unused_port() -> int:
    """Give a TCP port of the loopback that nobody uses now."""
    return free_port()


@pytest.fixture
def mosquitto(tmp_path: Path) -> Iterator[Mosquitto]:
    """Give a running mosquitto of this test's own."""
    folder = tmp_path / "mosquitto"
    folder.mkdir()
    broker = Mosquitto(path_of("mosquitto"), folder)
    broker.start()
    yield broker
    broker.close()


@pytest.fixture
def second_mosquitto(tmp_path: Path) -> Iterator[Mosquitto]:
    """Give another mosquitto, which knows nothing of the first."""
    folder = tmp_path / "second-mosquitto"
    folder.mkdir()
    broker = Mosquitto(path_of("mosquitto"), folder)
    broker.start()
    yield broker
    broker.close()


@pytest.fixture
def authority(tmp_path: Path) -> Authority:
    """Give an authority that has issued nothing yet."""
    folder = tmp_path / "authority"
    folder.mkdir()
    made = Authority(folder, path_of("openssl"))
    made.found()
    return made
