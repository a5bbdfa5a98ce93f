"""Every request by its name: `config/reload` is `B/request/config/reload`."""

from __future__ import annotations

from collections.abc import Mapping

from lfs10d.requests import config, device, general, line, register, scan, sensors
from lfs10d.requests.request import Request

REQUESTS: Mapping[str, Request] = {
    **general.REQUESTS,
    **config.REQUESTS,
    **device.REQUESTS,
    **line.REQUESTS,
    **register.REQUESTS,
    **scan.REQUESTS,
    **sensors.REQUESTS,
}
