"""Without `changes.yaml`: what the broker retained of our earlier life is taken up, and the line is asked."""

from __future__ import annotations

import logging
from collections.abc import Awaitable, Callable, Iterable, Mapping

from lfs10d import recollection
from lfs10d.changes import Changes, Place
from lfs10d.effective import Effective
from lfs10d.roster import Device
from lfs10d.running import Edit

log = logging.getLogger(__name__)


class Recalling:
    """Used in the thread of the asyncio loop.

    `learn` puts into force what is to be asked for; `devices()` are those of the line's thread; `tell` publishes an
    event.
    """

    def __init__(
        self,
        *,
        running: Callable[[], Effective],
        learn: Callable[[Edit], Awaitable[object]],
        devices: Callable[[], Iterable[Device]],
        tell: Callable[[str, Mapping[str, object]], None],
    ) -> None:
        self._running = running
        self._learn = learn
        self._devices = devices
        self._tell = tell

    @property
    def wanted(self) -> frozenset[str]:
        """The topics under `B` to be read."""
        return recollection.topics(self._running())

    async def take(self, payloads: Mapping[str, bytes]) -> None:
        """Take what is retained on those topics."""
        recalled = recollection.recollect(payloads)
        answering = {device.spec.name for device in self._devices() if device.online}
        settled: tuple[recollection.Settled, ...] = ()

        def edit(now: Effective) -> Changes:
            nonlocal settled
            changes, settled = recollection.remembering(now, recalled, answering)
            return changes

        await self._learn(edit)
        for each in settled:
            facts = {"device": each.device, "file": _spot(each.file), "last": _spot(each.last)}
            self._tell("change_conflict", {**facts, "used": _spot(each.file)})
            log.warning(
                "%s answers at slave id %d, %s baud, as the file says; it was last published at %d, %s",
                each.device, each.file.id, each.file.baudrate, each.last.id, each.last.baudrate,
            )  # fmt: skip


def _spot(place: Place) -> dict[str, int | None]:
    return {"slave": place.id, "baudrate": place.baudrate}
