"""What the daemon lets requests do."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Awaitable, Callable

    from lfs10d.configfile import Loaded
    from lfs10d.facts import Instant
    from lfs10d.mqtt.uplink import Uplink
    from lfs10d.reload import Plan
    from lfs10d.station import Station


class DaemonPowers:
    """`Powers` of `lfs10d.requests.request` on a running daemon.

    `now` gives the moment, `running` the configuration that holds, `reload` takes up the files as they are.
    """

    def __init__(
        self,
        station: Station,
        uplink: Uplink,
        *,
        now: Callable[[], Instant],
        running: Callable[[], Loaded],
        reload: Callable[[], Awaitable[Plan]],
    ) -> None:
        self._station = station
        self._uplink = uplink
        self._now = now
        self._running = running
        self._reload = reload

    def health(self) -> dict[str, object]:
        """Return how the daemon, the line and the devices are."""
        backlog = self._uplink.backlog
        return {
            **self._station.snapshot(self._now()),
            "broker": {"connected": self._uplink.connected, "depth": backlog.depth, "dropped": backlog.dropped},
        }

    def republish(self) -> int:
        """Send every retained topic once more; return how many."""
        self._uplink.republish()
        return len(self._station.topics()) + 1

    def configuration(self) -> dict[str, object]:
        """Return the effective configuration and where what is no default comes from."""
        loaded = self._running()
        origins = {key: str(origin) for key, origin in loaded.origins.items() if origin.kind != "default"}
        return {"config": loaded.config.model_dump(mode="json"), "origins": origins}

    async def reload(self) -> dict[str, list[str]]:
        """Read the files again and apply what changed; raises ConfigError and changes nothing if one is wrong."""
        done = await self._reload()
        return {"applied": list(done.applied), "restart_required": list(done.restart_required)}
