"""The handlers of all requests by name: `config/reload` is `B/request/config/reload`."""

from __future__ import annotations

from collections.abc import Mapping

from lfs10d.commands.context import Handler
from lfs10d.commands.handlers import config, device, general, line, reconfigure, register, scan

HANDLERS: Mapping[str, Handler] = {
    **general.HANDLERS,
    **config.HANDLERS,
    **device.HANDLERS,
    **line.HANDLERS,
    **register.HANDLERS,
    **scan.HANDLERS,
    **reconfigure.HANDLERS,
}
