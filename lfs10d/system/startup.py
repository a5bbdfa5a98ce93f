"""A start that costs little: what no daemon needs is not imported, and nobody looks for garbage among what was.

pydantic asks every installed distribution for plugins by `importlib.metadata`, which brings a reader of zip files and
more with it: 0.9 MB for good, and time of the start, for plugins that a daemon has none of. paho imports a client of
the web, 2 MB, to look for a proxy, which it does only where PySocks is installed.
"""

from __future__ import annotations

import gc
import importlib
import sys
import urllib
from types import ModuleType

_LOADER = "pydantic.plugin._loader"
"""Where pydantic looks for plugins, as of 2.14."""

_WEB = "urllib.request"


class Later(ModuleType):
    """Stands in for a module until something is wanted of it; then it gives way to the true one."""

    def __getattr__(self, name: str) -> object:
        """Return what the true module has, unless it is Python's import that asks."""
        if name.startswith("__"):
            raise AttributeError(name)
        if sys.modules.get(self.__name__) is self:
            del sys.modules[self.__name__]
        return getattr(importlib.import_module(self.__name__), name)


class NoPlugins(Later):
    """Stands in for the module that looks for plugins; whatever else is wanted of it is the true one's."""

    @staticmethod
    def get_plugins() -> tuple[()]:
        """Return that there are none."""
        return ()


def begin() -> None:
    """Prepare for importing; to be called before pydantic and paho are imported, and `done` after all is."""
    sys.modules.setdefault(_LOADER, NoPlugins(_LOADER))
    if _WEB not in sys.modules:
        sys.modules[_WEB] = later = Later(_WEB)
        setattr(urllib, "request", later)  # noqa: B010  # as an import of it would do; no type checker knows of it


def done() -> None:
    """Never look for garbage among what was imported: the line would have to wait meanwhile."""
    gc.freeze()
