"""Mounting sensors one after the other: what `line/adopt` is asked next, and what the person at the mast is told. Pure.

Rules
-----
1. Nobody there yet: it is asked again after a moment, and nothing is told.
2. A trouble is told once, until another one comes or a sensor is adopted. More than one sensor heard may be the noise
   of plugging one in: that is told when it is heard twice in a row.
3. A sensor that does not obey is left alone for a while, for each question writes to it. If it is to be followed
   (`data` names it) its place is still open: once the daemon polls it, it counts as adopted.
4. Where an answer was lost on the way, a device that has come up meanwhile is the one.
5. What no plugging and unplugging will mend ends it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

from lfs10d.system.logs import escape

AGAIN: Final = 1.0
"""s until it is looked for again."""
PATIENCE: Final = 10.0
"""s for which a sensor that did not obey is left alone."""
FOLLOWED: Final = 3.0
"""s until it is asked again whether the daemon has found the sensor that it follows."""
PASSING: Final = frozenset(
    {"timeout", "duplicate_id", "not_recognised", "busy", "line_error", "rate_limited", "cancelled"}
)
"""Rejections that come to an end by themselves, or by what the person does on the line."""
HOPELESS: Final = frozenset({"storage_full", "internal"})
"""Failures that would come again."""
FIRST: Final = "Plug in a sensor. Ctrl-C when all are mounted."
NEXT: Final = "Plug in the next one."


@dataclass(frozen=True, slots=True)
class AdoptedSensor:
    """One sensor that is polled now, by its name, slave id and rate; None where the daemon did not say."""

    device: str
    slave: int | None
    baudrate: int | None

    @property
    def words(self) -> str:
        """What a person wants to write on the sensor."""
        rate = "" if self.baudrate is None else f", {self.baudrate} baud"
        return f"{escape(self.device)}: slave id {'?' if self.slave is None else self.slave}{rate}"

    @property
    def data(self) -> dict[str, Any]:
        """The same for programs."""
        return {"device": self.device, "slave": self.slave, "baudrate": self.baudrate}


@dataclass(frozen=True, slots=True)
class AdoptTurn:
    """What follows from an answer: a sensor, a trouble in words, so many s to wait; `ends`: there is no going on."""

    adopted: AdoptedSensor | None = None
    trouble: str | None = None
    pause: float = AGAIN
    ends: bool = False


class AdoptLoop:
    """`names` are given in turn, and it is complete when all are; without, each sensor gets its default name.

    `wishes` are the other parameters of every request.
    """

    def __init__(self, names: Sequence[str] = (), wishes: Mapping[str, Any] | None = None) -> None:
        self.adopted: list[AdoptedSensor] = []
        self._names = tuple(names)
        self._wishes = dict(wishes or {})
        self._baudrate: int | None = None
        self._known: frozenset[str] | None = None
        self._awaited: set[str] = set()
        self._lost = False
        self._told: str | None = None
        self._crowded = False

    @property
    def complete(self) -> bool:
        """All names are given."""
        return bool(self._names) and not self.lacking

    @property
    def lacking(self) -> bool:
        """A name is not given yet."""
        return self._name is not None

    @property
    def _name(self) -> str | None:
        used = {each.device for each in self.adopted}
        return next((name for name in self._names if name not in used), None)

    @property
    def doubtful(self) -> bool:
        """The daemon's health says more than its answers did."""
        return self._known is None or self._lost or bool(self._awaited)

    @property
    def content(self) -> dict[str, Any]:
        """The parameters of the next request."""
        name = self._name
        return self._wishes if name is None else {**self._wishes, "name": name}

    def lost(self) -> None:
        """Note that an answer may have been lost."""
        self._lost = True

    def looked(self, health: object) -> Iterator[AdoptedSensor]:
        """Take the daemon's health; yield the sensors that are polled now though no answer said so."""
        line, devices = _of(health, "line"), _of(health, "devices")
        rate = line.get("baudrate") if isinstance(line, Mapping) else None
        self._baudrate = rate if isinstance(rate, int) else self._baudrate
        if not isinstance(devices, list):
            return
        now = {str(each["name"]): each.get("slave") for each in devices if isinstance(each, Mapping) and "name" in each}
        came = set() if self._known is None else now.keys() - self._known
        self._known = frozenset(now)
        for name in sorted(came):
            if name in self._awaited or self._lost:
                self._awaited.discard(name)
                yield self._adopt(name, now[name])

    def heard(self, response: Mapping[str, Any]) -> AdoptTurn:
        """Take an answer to `line/adopt`."""
        data, error = response.get("data"), response.get("error")
        code = error.get("code") if isinstance(error, Mapping) else None
        if response.get("status") == "ok" and isinstance(data, Mapping):
            self._lost = False
            return AdoptTurn(self._adopt(str(data.get("device")), data.get("slave")), pause=0.0)
        if response.get("status") == "failed":
            return self._disobeyed(data, code, error)
        crowded, self._crowded = self._crowded, code == "duplicate_id"
        if code == "timeout":
            self._lost = False
            return AdoptTurn()
        if code == "duplicate_id" and not crowded:
            return AdoptTurn()
        if code == "address_in_use" and self.doubtful and _of(error, "param") == "from":
            return AdoptTurn(pause=FOLLOWED)  # its old id is kept for the one that is looked for
        return AdoptTurn(trouble=self._once(_message(error)), ends=code not in PASSING)

    def _disobeyed(self, data: object, code: object, error: object) -> AdoptTurn:
        device = _of(data, "device")
        if code in {"not_verified", "power_cycle_needed"} and isinstance(device, str):
            self._awaited.add(device)
        self._lost = self._lost or code == "cancelled"
        return AdoptTurn(trouble=self._once(_message(error)), pause=PATIENCE, ends=code in HOPELESS)

    def _adopt(self, device: str, slave: object) -> AdoptedSensor:
        self._told, self._crowded = None, False
        self._known = (self._known or frozenset()) | {device}
        one = AdoptedSensor(device, slave if isinstance(slave, int) else None, self._baudrate)
        self.adopted.append(one)
        return one

    def _once(self, trouble: str) -> str | None:
        if trouble == self._told:
            return None
        self._told = trouble
        return trouble


def _of(value: object, key: str) -> object:
    return value.get(key) if isinstance(value, Mapping) else None


def _message(error: object) -> str:
    return f"{escape(str(_of(error, 'code')))}: {escape(str(_of(error, 'message')))}"
