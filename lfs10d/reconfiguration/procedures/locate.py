"""Searches for a sensor whose place in the file is not the last verified one. Pure; writes nothing."""

from __future__ import annotations

from collections.abc import Sequence

from lfs10d.line.jobs.job import Hold
from lfs10d.line.jobs.procedure import Await, Steps
from lfs10d.reconfiguration.journal import Endpoint
from lfs10d.reconfiguration.procedures.identity_query import IdentityQuery

FIRST_PAUSE = 1.0
"""Between the first look and the first probes, in s; doubled after each."""


def locate(places: Sequence[Endpoint], query: IdentityQuery, *, longest_pause: float) -> Steps[Endpoint]:
    """Return the first of `places` at which a device answers; None is awaited once if none does at first."""
    for endpoint in places:
        if (yield from query.read_patiently(endpoint)).answers:
            return endpoint
    yield Await(None)
    pause = min(FIRST_PAUSE, longest_pause)
    while True:
        yield Hold(query.clock.now + pause)
        pause = min(2 * pause, longest_pause)
        for endpoint in places:
            if (yield from query.read_register(endpoint)).answers:
                return endpoint
