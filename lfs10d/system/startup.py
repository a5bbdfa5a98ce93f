"""Makes the start cheap: no search for plugins, no web client, no garbage collection of imported modules.

Pydantic searches every installed distribution for plugins by `importlib.metadata`, which imports `email` and `zipfile`.
paho imports `urllib.request` for a proxy that it looks for only where PySocks is installed. Together they cost 2.7 MB
for good. Pydantic's documented switch (PYDANTIC_DISABLE_PLUGINS) skips the search but not the import, and paho has
none: docs/decisions/0006-at-the-wires-limit.md has the figures.
"""

from __future__ import annotations

import gc
import importlib
import sys
import urllib
from types import ModuleType

_LOADER = "pydantic.plugin._loader"
"""The module in which pydantic searches for plugins, as of 2.14."""

_WEB = "urllib.request"


class LazyModule(ModuleType):
    """Stands in for a module until one of its attributes is wanted; then the true module takes its place."""

    def __getattr__(self, name: str) -> object:
        """Return an attribute of the true module, except to Python's import."""
        if name.startswith("__"):
            raise AttributeError(name)
        if sys.modules.get(self.__name__) is self:
            del sys.modules[self.__name__]
        return getattr(importlib.import_module(self.__name__), name)


class NoPlugins(LazyModule):
    """Stands in for the module that searches for plugins; its other attributes are the true module's."""

    @staticmethod
    def get_plugins() -> tuple[()]:
        """Return no plugins."""
        return ()


def begin() -> None:
    """Prepare for importing; to be called before pydantic and paho are imported, and `done` after all is."""
    sys.modules.setdefault(_LOADER, NoPlugins(_LOADER))
    if _WEB not in sys.modules:
        sys.modules[_WEB] = later = LazyModule(_WEB)
        setattr(urllib, "request", later)  # noqa: B010  # as an import of it would do; no type checker knows of it


def done() -> None:
    """Leave what was imported out of garbage collection: the line would have to wait meanwhile."""
    gc.freeze()
