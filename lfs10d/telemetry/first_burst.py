"""The first burst of a boot: it shows no device as measured yet, and holds back what was measured meanwhile. Pure.

A broker may retain publications from before a restart; a subscriber must see them replaced before anything new.
Until that burst is settled, newer states are held back; then they follow at once. Every device's state in it has the
error `starting`, a disabled one's too: whatever was retained before, a restart is no alarm.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from lfs10d.reading import FaultCode
from lfs10d.telemetry.publication import AVAILABILITY, ERROR, STATE, Publication, device_of

_LEAVES = (STATE, AVAILABILITY, ERROR)


class FirstBurst:
    """`publications` are a burst from before the first reading."""

    def __init__(self, publications: Iterable[Publication]) -> None:
        self._unknown = {each.topic: _starting(each) for each in publications if _held(each)}
        self.settled = False

    def burst(self, publications: Iterable[Publication]) -> list[Publication]:
        """Return a burst without measured states; the burst itself once the first one is acknowledged."""
        if self.settled:
            return list(publications)
        return [self._unknown.get(each.topic, each) for each in publications]

    def passing(self, publications: Iterable[Publication]) -> Iterable[Publication]:
        """Return the publications that need not wait for the first burst."""
        if self.settled:
            return publications
        return [each for each in publications if each.payload is None or not _held(each)]

    def settle(self, publications: Iterable[Publication]) -> list[Publication]:
        """Note that the broker has the first burst; return the publications held back, availability first."""
        if self.settled:
            return []
        self.settled = True
        news = [each for each in publications if _held(each) and self._unknown.get(each.topic) != each]
        # A value is shown of a device that is online.
        return sorted(news, key=lambda each: device_of(each.topic, AVAILABILITY) is None)


def _held(publication: Publication) -> bool:
    return publication.sample is None and any(device_of(publication.topic, leaf) for leaf in _LEAVES)


def _starting(publication: Publication) -> Publication:
    """Return a state with the error `starting`, anything else as it is."""
    payload = publication.payload
    if device_of(publication.topic, STATE) is None or not isinstance(payload, dict):
        return publication
    return replace(publication, payload={**payload, "error": FaultCode.STARTING.value})
