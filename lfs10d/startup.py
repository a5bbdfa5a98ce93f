"""A start that costs little: nobody looks for plugins of pydantic, nor for garbage among what was imported.

pydantic asks every installed distribution for plugins by `importlib.metadata`, which brings a reader of zip files and
more with it: 0.9 MB for good, and time of the start, for plugins that a daemon has none of.
"""

from __future__ import annotations

import gc
import importlib
import sys
from types import ModuleType

_LOADER = "pydantic.plugin._loader"
"""Where pydantic looks for plugins, as of 2.14."""


class NoPlugins(ModuleType):
    """Stands in for the module that looks for plugins; whatever else is wanted of it is the true one's."""

    @staticmethod
    def get_plugins() -> tuple[()]:
        """Return that there are none."""
        return ()

    def __getattr__(self, name: str) -> object:
        """Give way to the true module, unless it is Python's import that asks."""
        if name.startswith("__"):
            raise AttributeError(name)
        if sys.modules.get(_LOADER) is self:
            del sys.modules[_LOADER]
        return getattr(importlib.import_module(_LOADER), name)


def begin() -> None:
    """Prepare for importing; to be called before pydantic is imported, and `done` after all is."""
    sys.modules.setdefault(_LOADER, NoPlugins(_LOADER))


def done() -> None:
    """Never look for garbage among what was imported: the line would have to wait meanwhile."""
    gc.freeze()
