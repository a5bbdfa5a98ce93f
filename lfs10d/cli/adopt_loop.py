"""Adopts sensors one after the other: decides the next request, and what is reported to the person. Pure.

Rules
-----
1. No sensor yet: the request is repeated after a moment, and nothing is reported.
2. A problem is reported once, until another one comes or a sensor is adopted. `duplicate_id` may be the noise of
   plugging a sensor in: it is reported when it comes twice in a row.
3. After a failure the sensor is left alone for a while, because each request writes to it. If the daemon goes on with
   it (`data` names it), it counts as adopted once the daemon polls it.
4. Where a response was lost, a device that appeared meanwhile is the adopted one.
5. An error that no plugging and unplugging will mend ends the loop.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Final

from lfs10d.cli.render.foreign import mapping, named
from lfs10d.system.dataclass import dataclass
from lfs10d.system.logs import escape

RETRY_AFTER: Final = 1.0
"""s until the request is repeated."""
RETRY_FAILED_AFTER: Final = 10.0
"""s for which a sensor is left alone after a failure."""
RECHECK_AFTER: Final = 3.0
"""s until the daemon's health is asked for again while it looks for a sensor."""
TEMPORARY: Final = frozenset(
    {"timeout", "duplicate_id", "not_recognised", "busy", "line_error", "rate_limited", "cancelled"}
)
"""Rejections that end by themselves, or once the person has changed something on the line."""
PERMANENT: Final = frozenset({"storage_full", "internal"})
"""Failures that would occur again."""
FIRST: Final = "Plug in a sensor. Ctrl-C when all are adopted."
NEXT: Final = "Plug in the next one."


@dataclass(frozen=True, slots=True)
class AdoptedSensor:
    """One sensor that is polled now, by its name, slave id and rate; None where the daemon did not say."""

    device: str
    slave: int | None
    baudrate: int | None

    @property
    def words(self) -> str:
        """The sensor in words, as a person writes them on it."""
        rate = "" if self.baudrate is None else f", {self.baudrate} baud"
        return f"{escape(self.device)}: slave id {'?' if self.slave is None else self.slave}{rate}"

    @property
    def data(self) -> dict[str, Any]:
        """The sensor as JSON data."""
        return {"device": self.device, "slave": self.slave, "baudrate": self.baudrate}


@dataclass(frozen=True, slots=True)
class AdoptTurn:
    """What follows from a response: a sensor, a problem in words, seconds to wait; `ends`: the loop is over."""

    adopted: AdoptedSensor | None = None
    problem: str | None = None
    pause: float = RETRY_AFTER
    ends: bool = False


class AdoptLoop:
    """`names` are given in turn, and it is complete when all are; without, each sensor gets its default name.

    `parameters` are the other parameters of every request.
    """

    def __init__(self, names: Sequence[str] = (), parameters: Mapping[str, Any] | None = None) -> None:
        self.adopted: list[AdoptedSensor] = []
        self._names = tuple(names)
        self._parameters = dict(parameters or {})
        self._baudrate: int | None = None
        self._known: frozenset[str] | None = None
        self._awaited: set[str] = set()
        self._lost = False
        self._reported: str | None = None
        self._duplicate_seen = False

    @property
    def complete(self) -> bool:
        """Whether all names are given."""
        return bool(self._names) and not self.unfinished

    @property
    def unfinished(self) -> bool:
        """Whether a name is not given yet."""
        return self._name is not None

    @property
    def _name(self) -> str | None:
        used = {each.device for each in self.adopted}
        return next((name for name in self._names if name not in used), None)

    @property
    def uncertain(self) -> bool:
        """Whether the daemon's health must be asked for before the next request."""
        return self._known is None or self._lost or bool(self._awaited)

    @property
    def content(self) -> dict[str, Any]:
        """The parameters of the next request."""
        name = self._name
        return self._parameters if name is None else {**self._parameters, "name": name}

    def answer_lost(self) -> None:
        """Note that a response may have been lost."""
        self._lost = True

    def on_health(self, health: object) -> Iterator[AdoptedSensor]:
        """Take the daemon's health; yield the sensors that are polled now without a response that said so."""
        rate, devices = mapping(mapping(health).get("line")).get("baudrate"), mapping(health).get("devices")
        self._baudrate = rate if isinstance(rate, int) else self._baudrate
        if not isinstance(devices, list):
            return
        now = {name: each.get("slave") for name, each in named(devices)}
        appeared = set() if self._known is None else now.keys() - self._known
        self._known = frozenset(now)
        for name in sorted(appeared):
            if name in self._awaited or self._lost:
                self._awaited.discard(name)
                yield self._adopt(name, now[name])

    def on_response(self, response: Mapping[str, Any]) -> AdoptTurn:
        """Take a response to `line/adopt`."""
        data, error = response.get("data"), mapping(response.get("error"))
        code = error.get("code")
        if response.get("status") == "ok" and isinstance(data, Mapping):
            self._lost = False
            return AdoptTurn(self._adopt(str(data.get("device")), data.get("slave")), pause=0.0)
        if response.get("status") == "failed":
            return self._on_failure(data, code, error)
        duplicate_seen, self._duplicate_seen = self._duplicate_seen, code == "duplicate_id"
        if code == "timeout":
            self._lost = False
            return AdoptTurn()
        if code == "duplicate_id" and not duplicate_seen:
            return AdoptTurn()
        if code == "address_in_use" and self.uncertain and error.get("param") == "from":
            return AdoptTurn(pause=RECHECK_AFTER)  # its old id is reserved for the sensor that is looked for
        return AdoptTurn(problem=self._report_once(_message(error)), ends=code not in TEMPORARY)

    def _on_failure(self, data: object, code: object, error: Mapping[str, Any]) -> AdoptTurn:
        device = mapping(data).get("device")
        if code in {"not_verified", "power_cycle_needed"} and isinstance(device, str):
            self._awaited.add(device)
        self._lost = self._lost or code == "cancelled"
        return AdoptTurn(problem=self._report_once(_message(error)), pause=RETRY_FAILED_AFTER, ends=code in PERMANENT)

    def _adopt(self, device: str, slave: object) -> AdoptedSensor:
        self._reported, self._duplicate_seen = None, False
        self._known = (self._known or frozenset()) | {device}
        one = AdoptedSensor(device, slave if isinstance(slave, int) else None, self._baudrate)
        self.adopted.append(one)
        return one

    def _report_once(self, problem: str) -> str | None:
        if problem == self._reported:
            return None
        self._reported = problem
        return problem


def _message(error: Mapping[str, Any]) -> str:
    return f"{escape(str(error.get('code')))}: {escape(str(error.get('message')))}"
