"""What all tests share: programs they need, a real mosquitto, an independent listener, a certificate authority.

`LFS10D_EXAMPLES=20000` in the environment lets hypothesis try so many examples of each law, where a law does not say.

`needs("program", ...)` marks a test that starts a program: where it is absent the test fails in CI (`CI` is
set) and is skipped elsewhere, with one line that says what to install.

Where several workers share the tests, files of folders whose tests wait for other programs take turns with the others,
so that from the beginning to the end most workers wait while the rest compute. Of both kinds the longest of the files
marked `long(seconds)` begin first, so that none is waited for in the end; the rest are mixed by a hash of their names.
Every worker collects all tests. In a new clone pytest rewrites the assertions of each file first, which takes half a
minute: each worker begins in another folder, and finds written what the others have done.
"""

from __future__ import annotations

import gc
import os
import re
from collections.abc import Callable, Iterator
from hashlib import sha256
from pathlib import Path

import pytest
from hypothesis import settings

from bench.broker import free_port
from tests.support.brokers import Authority, Mosquitto, path_of

settings.register_profile("ours", max_examples=int(os.environ.get("LFS10D_EXAMPLES", "100")), deadline=None)
settings.load_profile("ours")  # without a deadline: a busy machine is no failure

TESTS = Path(__file__).parent
WAITING = frozenset({"bench", "cli", "daemon", "devices", "mqtt", "soak", "web"})
"""The folders whose tests wait for other programs rather than compute."""


def pytest_configure(config: pytest.Config) -> None:
    """Let each worker collect the folders in an order of its own; what is found is sorted afterwards."""
    number = re.fullmatch(r"gw(\d+)", os.environ.get("PYTEST_XDIST_WORKER", ""))
    if number is not None and config.args == ["tests"]:
        entries = sorted(f"tests/{each.name}" for each in Path("tests").iterdir() if _collected(each))
        workers = int(os.environ["PYTEST_XDIST_WORKER_COUNT"])
        begin = len(entries) * int(number[1]) // workers
        config.args = entries[begin:] + entries[:begin]


def _collected(path: Path) -> bool:
    return (path.is_dir() and path.name != "__pycache__") or path.match("test_*.py")


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    if hasattr(config, "workerinput"):  # a worker of xdist's: every one finds the same order
        seconds = {item.path: mark.args[0] for item in items if (mark := item.get_closest_marker("long"))}
        turns: dict[Path, float] = {}
        for waits in (True, False):
            files = {item.path for item in items if _waits(item.path) is waits}
            ordered = sorted(files, key=lambda file: (-seconds.get(file, 0), sha256(str(file).encode()).digest()))
            turns.update({file: number / len(ordered) for number, file in enumerate(ordered)})
        items.sort(key=lambda item: (turns[item.path], str(item.path)))


def _waits(file: Path) -> bool:
    return file.relative_to(TESTS).parts[0] in WAITING


def pytest_collection_finish() -> None:
    """Let the collector of garbage pass over the thousands of tests that stay to the end."""
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
