"""All lines together, as one document and as changes of it, for the page. Pure."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator
from typing import Any, Final

from lfs10d.web.line_model import LineModel, Link

MOST_LINES: Final = 64
FRAMES_AT_ONCE: Final = 100


class SiteModel:
    """The lines by their keys; a key is the line's name, or base topic and name where two lines have one name."""

    def __init__(self) -> None:
        self.lines: dict[str, LineModel] = {}
        self._shown: dict[str, dict[str, Any]] = {}
        """What was published last, by line; its devices are in `devices`."""
        self._drawn: dict[tuple[str, str], int] = {}
        """The newest step of each curve that was published."""
        self._traced: dict[str, int] = {}

    def line(self, base: str, name: str, place: str) -> LineModel | None:
        """Return the line of this name below a base topic, a new one where there is room; `place` is its broker."""
        for line in self.lines.values():
            if line.base == base and line.name == name:
                return line
        if len(self.lines) >= MOST_LINES:
            return None
        key = name if name not in self.lines else f"{base.replace('/', '.')}.{name}"
        if key in self.lines:
            return None
        self.lines[key] = line = LineModel(key, name, base, Link(place))
        return line

    def whole(self, wall: float, more: Callable[[LineModel], dict[str, Any]]) -> dict[str, Any]:
        """Return everything; `more` gives what else is shown of a line."""
        lines = {}
        for key, line in self.lines.items():
            devices = {name: {**device, "curve": line.recent(name)} for name, device in line.devices(None, wall)}
            frames = list(line.frames)
            lines[key] = {**line.summary(wall), **more(line), "devices": devices, "frames": frames}
        return {"v": 1, "now": round(wall * 1000), "lines": lines}

    def changes(self, wall: float, more: Callable[[LineModel], dict[str, Any]]) -> dict[str, Any]:
        """Return what changed since the last call, by line; what is not named is as before."""
        changed = {}
        for key, line in self.lines.items():
            now = {**line.summary(wall), **more(line)}
            before = self._shown.setdefault(key, {"devices": {}})
            delta = {name: value for name, value in now.items() if before.get(name, _NOTHING) != value}
            before.update(delta)
            devices = dict(self._devices(line, before["devices"], wall))
            line.changed.clear()
            if devices:
                delta["devices"] = devices
            if frames := self._frames(line):
                delta["frames"] = frames
            if delta:
                changed[key] = delta
        return changed

    def _devices(
        self, line: LineModel, before: dict[str, dict[str, Any]], wall: float
    ) -> Iterator[tuple[str, dict[str, Any]]]:
        for name, now in line.devices(line.changed, wall):
            shown = before.setdefault(name, {})
            delta = {key: value for key, value in now.items() if shown.get(key, _NOTHING) != value}
            shown.update(delta)
            if points := self._points(line, name):
                delta["points"] = points
            if delta:
                yield name, delta

    def _points(self, line: LineModel, name: str) -> list[Any]:
        curve = line.curves.get(name)
        if curve is None:
            return []
        last = self._drawn.get((line.key, name), curve.newest - 1)
        self._drawn[line.key, name] = curve.newest - 1
        return [] if last >= curve.newest - 1 else curve.points(last + 1, curve.newest - 1)

    def _frames(self, line: LineModel) -> list[dict[str, Any]]:
        new = line.frames_seen - self._traced.get(line.key, 0)
        self._traced[line.key] = line.frames_seen
        return list(line.frames)[-min(new, FRAMES_AT_ONCE) :] if new > 0 else []


class Stream:
    """The last changes by number, for a viewer that comes back; what is no longer kept is sent as a whole."""

    def __init__(self, epoch: str, kept: int = 240, most_bytes: int = 2**21) -> None:
        self._epoch = epoch
        self._kept: deque[tuple[int, bytes]] = deque()
        self._most = kept
        self._most_bytes = most_bytes
        self._bytes = 0
        self.number = 0

    @property
    def last_id(self) -> str:
        """The id of the newest event."""
        return f"{self._epoch}-{self.number}"

    def add(self, data: str) -> bytes:
        """Keep an event of changes under a new number, and return it as it goes over the wire."""
        self.number += 1
        event = event_bytes("change", data, self.last_id)
        self._kept.append((self.number, event))
        self._bytes += len(event)
        while len(self._kept) > self._most or self._bytes > self._most_bytes:
            self._bytes -= len(self._kept.popleft()[1])
        return event

    def since(self, last_id: str | None) -> list[bytes] | None:
        """Return the events after the one of this id; None where that is not known any more."""
        epoch, _, number = (last_id or "").rpartition("-")
        if epoch != self._epoch or not (number.isascii() and number.isdecimal()) or len(number) > 15:  # noqa: PLR2004 - of ours
            return None
        last = int(number)
        if last > self.number or (last < self.number and (not self._kept or self._kept[0][0] > last + 1)):
            return None
        return [event for each, event in self._kept if each > last]


def event_bytes(name: str, data: str, event_id: str) -> bytes:
    """Return a server-sent event (WHATWG HTML, section 9.2); `data` is one line."""
    return f"id: {event_id}\nevent: {name}\ndata: {data}\n\n".encode()


_NOTHING: Final = object()
