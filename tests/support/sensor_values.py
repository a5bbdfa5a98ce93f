"""Wind speeds in the replies of a simulated sensor."""

from __future__ import annotations

import struct
from collections.abc import Callable

from tests.support.simulated import Bench

Maker = Callable[..., Bench]

WIND, RATE, ID = 1, 4, 5


def wind_in(body: bytes | None) -> float:
    assert body is not None
    (speed,) = struct.unpack(">f", body[3:])
    return float(speed)
