"""A sensor that answers one request after the other, however late: as every real one does."""

from __future__ import annotations

from dataclasses import replace

from lfs10d.simulator.sensor import Reply, Sensor


class QueuedSensor(Sensor):
    """Begins an answer no earlier than t3.5 after the end of its answer before."""

    _free = 0

    def hear(self, body: bytes, ended: int, *, after_dead: bool = False) -> Reply | None:
        """Hear a request as any sensor does; what it answers waits for what it still has to say."""
        reply = super().hear(body, ended, after_dead=after_dead)
        if reply is None:
            return None
        reply = _postponed(reply, self._free)
        own = [each for each in (reply, *reply.following) if not each.second]
        self._free = own[-1].ends + reply.format.t35
        return reply


def _postponed(reply: Reply, start: int) -> Reply:
    """Return the same, what follows too, beginning no earlier than `start`."""
    delay = max(0, start - reply.start)
    following = tuple(replace(each, start=each.start + delay) for each in reply.following)
    return replace(reply, start=reply.start + delay, following=following)
