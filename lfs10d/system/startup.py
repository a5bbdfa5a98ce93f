"""Makes the start cheap: no search for plugins, no web client, no OpenSSL, no garbage collection of what was imported.

Pydantic searches every installed distribution for plugins by `importlib.metadata`, which imports `email` and `zipfile`.
paho imports `urllib.request` for a proxy that it looks for only where PySocks is installed. Together they cost 2.7 MB
for good. Pydantic's documented switch (PYDANTIC_DISABLE_PLUGINS) skips the search but not the import, and paho has
none. OpenSSL takes 4.7 MB where neither TLS nor its hashes are wanted, for asyncio, paho and `hashlib` import it if it
is there. docs/decisions/0006-at-the-wires-limit.md has the figures.
"""

from __future__ import annotations

import gc
import importlib
import sys
import urllib
from importlib.util import find_spec
from threading import RLock
from types import ModuleType
from typing import cast

_LOADER = "pydantic.plugin._loader"
"""The module in which pydantic searches for plugins, as of 2.14."""

_WEB = "urllib.request"
_TLS = "ssl"
_OPENSSL_HASHES = "_hashlib"

_HASHES = ("_md5", "_sha1", "_sha3", "_blake2")
"""Python's own hashes, which some distributions leave out; SHA-2 is there with each of them."""

_ABSENT = cast("ModuleType", None)
"""What makes `import` say that there is no such module."""


_LOADING = RLock()
"""Held while a true module takes the place of its stand-in: two threads may be the first to want it."""


class LazyModule(ModuleType):
    """Stands in for a module until one of its attributes is wanted; then the true module takes its place."""

    def __getattr__(self, name: str) -> object:
        """Return an attribute of the true module, except to Python's import."""
        if name.startswith("__"):
            raise AttributeError(name)
        with _LOADING:
            if sys.modules.get(self.__name__) is self:
                del sys.modules[self.__name__]
            return getattr(importlib.import_module(self.__name__), name)


class NoPlugins(LazyModule):
    """Stands in for the module that searches for plugins; its other attributes are the true module's."""

    @staticmethod
    def get_plugins() -> tuple[()]:
        """Return no plugins."""
        return ()


class NeverRaisedError(Exception):
    """Stands in for the errors of TLS as long as nobody uses TLS."""


class LazyTls(LazyModule):
    """Stands in for `ssl`. To ask whether an error is one of TLS does not load it: without it there is none."""

    def __getattr__(self, name: str) -> object:
        """Return an attribute of the true module; an error that nobody raises while it is not loaded."""
        if name.endswith("Error") and sys.modules.get(self.__name__) is self:
            return NeverRaisedError
        return super().__getattr__(name)


def begin() -> None:
    """Prepare for importing; to be called before pydantic, paho and asyncio are imported, and `done` after all is."""
    sys.modules.setdefault(_LOADER, NoPlugins(_LOADER))
    if _WEB not in sys.modules:
        sys.modules[_WEB] = later = LazyModule(_WEB)
        setattr(urllib, "request", later)  # noqa: B010  # as an import of it would do; no type checker knows of it
    if _TLS not in sys.modules:
        _leave_out_openssl()


def _leave_out_openssl() -> None:
    """Let `hashlib` use Python's own hashes, asyncio do without TLS, which is paho's here, and paho wait for it."""
    if all(map(find_spec, _HASHES)):
        sys.modules.setdefault(_OPENSSL_HASHES, _ABSENT)
    sys.modules[_TLS] = _ABSENT
    importlib.import_module("asyncio")
    sys.modules[_TLS] = LazyTls(_TLS)


def done() -> None:
    """Leave what was imported out of garbage collection: the line would have to wait meanwhile."""
    gc.freeze()
