"""A verb starts without what it does not need."""

from __future__ import annotations

import gc
import subprocess
import sys
from importlib.util import find_spec

import pytest

from lfs10d.system import startup
from lfs10d.system.startup import NoPlugins

NEVER = ("importlib.metadata", "zipfile", "csv", "rich", "http.client", "email", "_ssl", "_hashlib")
"""Megabytes that no running daemon needs."""


def in_a_fresh_interpreter(code: str) -> str:
    """Return what Python prints that has imported nothing yet."""
    return subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.strip()


def test_the_daemon_is_imported_without_what_it_does_not_need() -> None:
    code = (
        "import sys, lfs10d.cli.exit_status; from lfs10d.system import startup; startup.begin()\n"
        f"import lfs10d.cli.run; print([name for name in {NEVER!r} if sys.modules.get(name)])"
    )
    assert in_a_fresh_interpreter(code) == "[]"


@pytest.fixture
def no_loader(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let nobody have looked for plugins yet."""
    monkeypatch.delitem(sys.modules, startup._LOADER, raising=False)


def test_nobody_looks_for_garbage_among_what_was_imported() -> None:
    try:
        startup.done()
        assert gc.get_freeze_count() > 10_000
    finally:
        gc.unfreeze()


@pytest.mark.usefixtures("no_loader")
def test_no_plugins_are_found_and_the_rest_of_the_loader_is_the_true_one() -> None:
    startup.begin()
    loader = sys.modules[startup._LOADER]
    assert isinstance(loader, NoPlugins)
    assert loader.get_plugins() == ()
    assert not hasattr(loader, "__path__")
    assert loader.PYDANTIC_ENTRY_POINT_GROUP == "pydantic"
    assert sys.modules[startup._LOADER] is not loader
    assert loader.PYDANTIC_ENTRY_POINT_GROUP == "pydantic"


def test_what_stands_in_for_a_client_of_the_web_gives_way_to_it() -> None:
    code = (
        "import sys; from lfs10d.system import startup; startup.begin()\n"
        "import urllib.request as web; print(type(web).__name__, 'http.client' in sys.modules)\n"
        "print(web.getproxies.__module__, web.Request.__name__, 'http.client' in sys.modules)\n"
        "import urllib.request; print(type(urllib.request).__name__)"
    )
    assert in_a_fresh_interpreter(code).splitlines() == ["LazyModule False", "urllib.request Request True", "module"]


def test_a_client_of_the_web_that_is_there_stays() -> None:
    code = (
        "import urllib.request; there = urllib.request; from lfs10d.system import startup; startup.begin()\n"
        "import urllib.request; print(urllib.request is there)"
    )
    assert in_a_fresh_interpreter(code) == "True"


WITHOUT_TLS = "import sys; from lfs10d.system import startup; startup.begin()\n"


def test_tls_is_loaded_by_who_uses_it_and_nobody_else() -> None:
    code = WITHOUT_TLS + (
        "import ssl, asyncio, paho.mqtt.client; print('_ssl' in sys.modules, asyncio.base_events.ssl)\n"
        "print(isinstance(OSError(), ssl.SSLError), issubclass(ssl.SSLWantReadError, OSError), '_ssl' in sys.modules)\n"
        "context = ssl.create_default_context(); print('_ssl' in sys.modules, type(sys.modules['ssl']).__name__)\n"
        "print(issubclass(ssl.SSLError, OSError), ssl.SSLWantReadError is sys.modules['ssl'].SSLWantReadError)\n"
        "print(paho.mqtt.client.ssl.SSLWantReadError is sys.modules['ssl'].SSLWantReadError)"
    )
    assert in_a_fresh_interpreter(code).splitlines() == [
        "False None",
        "False False False",
        "True module",
        "True True",
        "True",
    ]


def test_tls_that_is_there_stays() -> None:
    code = (
        "import ssl; there = ssl\n"
        + WITHOUT_TLS
        + "import ssl, asyncio; print(ssl is there, asyncio.base_events.ssl is ssl)"
    )
    assert in_a_fresh_interpreter(code) == "True True"


@pytest.mark.parametrize("missing", startup._HASHES)
def test_where_python_has_no_hashes_of_its_own_those_of_openssl_stay(missing: str) -> None:
    lacking = (
        "import importlib.util as util; found = util.find_spec\n"
        f"util.find_spec = lambda name: None if name == {missing!r} else found(name)\n"
    )
    code = "import hashlib; print(hashlib.sha256(b'').hexdigest()[:8], hashlib.sha256.__module__)"
    assert find_spec("_hashlib") is not None
    assert in_a_fresh_interpreter(lacking + WITHOUT_TLS + code) == "e3b0c442 _hashlib"
    assert in_a_fresh_interpreter(WITHOUT_TLS + code).startswith("e3b0c442 _sha2")


def test_of_two_threads_that_are_the_first_to_want_a_module_both_get_it() -> None:
    code = (
        "import sys, threading, time; from lfs10d.system import startup; startup.begin()\n"
        "import importlib, ssl; load = importlib.import_module; found = []\n"
        "def slowly(name):\n    time.sleep(0.2)\n    return load(name)\n"
        "importlib.import_module = slowly\n"
        "threads = [threading.Thread(target=lambda: found.append(ssl.SSLContext)) for _ in range(4)]\n"
        "[each.start() for each in threads]; [each.join() for each in threads]\n"
        "print(len(found), found == [sys.modules['ssl'].SSLContext] * 4)"
    )
    assert in_a_fresh_interpreter(code) == "4 True"
