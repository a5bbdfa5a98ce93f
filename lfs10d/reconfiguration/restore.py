"""Restores where the devices were from the daemon's own retained topics, when `changes.yaml` is gone.

Rules
-----
1. What a broker retains is not trusted: a payload that is not exactly in our form, or out of a profile's range, counts
   as absent.
2. It counts for the devices of the file alone, and only where no change says where they are.
3. An id that was published for two devices counts for neither, unless the file has one of them there: it keeps it.
4. A device that answers at the file's place is there, and so is the line's rate; that is announced, and nothing is
   kept. Not so where another device was published at that id: then it is not known yet which of them answers there.
5. The others are kept as verified there once (rule 3 of `lfs10d.config.merge`): the line is queried, the file's place
   first.
"""

from __future__ import annotations

import logging
from collections import Counter
from collections.abc import Awaitable, Callable, Iterable, Mapping
from collections.abc import Set as AbstractSet
from dataclasses import replace
from typing import Annotated

from pydantic import BaseModel, ConfigDict, ValidationError
from pydantic_core import from_json

from lfs10d.config.changes import Changes, Place, Rate, Verified
from lfs10d.config.effective import Edit, Effective
from lfs10d.config.models import LineConfig
from lfs10d.line.device import Device
from lfs10d.schema.fields import Choice, Whole
from lfs10d.system.dataclass import dataclass
from lfs10d.telemetry.publication import CONFIG, LINE_STATE, EventType, device_of, device_topic

log = logging.getLogger(__name__)

LARGEST = 4096
"""Bytes of the longest payload that is read; ours have a few hundred."""

_Baudrate = Annotated[
    int, next(kind for kind in LineConfig.model_fields["baudrate"].metadata if isinstance(kind, Choice))
]


class _Payload(BaseModel):
    """The keys that are read of a payload; other versions of lfs10d may have more."""

    model_config = ConfigDict(strict=True, extra="ignore", frozen=True)

    slave: Annotated[int, Whole(1, 255)] | None = None
    baudrate: _Baudrate | None = None


@dataclass(frozen=True, slots=True)
class RetainedState:
    """The slave id of each device by name, and the line's rate, as last published; None where nothing is known."""

    slaves: Mapping[str, int]
    baudrate: int | None = None


@dataclass(frozen=True, slots=True)
class ConfirmedPlace:
    """A device that answers at the place of the file, although it was last published at another."""

    device: str
    file: Place
    last: Place


class Restore:
    """Used in the thread of the asyncio loop.

    `learn` puts into force what is to be queried; `devices()` are those of the line's thread; `announce` publishes an
    event.
    """

    def __init__(
        self,
        *,
        running: Callable[[], Effective],
        learn: Callable[[Edit], Awaitable[object]],
        devices: Callable[[], Iterable[Device]],
        announce: Callable[[EventType, Mapping[str, object]], None],
    ) -> None:
        self._running = running
        self._learn = learn
        self._devices = devices
        self._announce = announce

    @property
    def topics(self) -> frozenset[str]:
        """The topics under `B` to be read."""
        return topics(self._running())

    async def on_retained(self, payloads: Mapping[str, bytes]) -> None:
        """Take the retained payloads of those topics."""
        state = retained_state(payloads)
        online = {device.spec.name for device in self._devices() if device.online}
        confirmed: tuple[ConfirmedPlace, ...] = ()

        def edit(now: Effective) -> Changes:
            nonlocal confirmed
            changes, confirmed = restored(now, state, online)
            return changes

        await self._learn(edit)
        for each in confirmed:
            facts = {"device": each.device, "file": _fields(each.file), "last": _fields(each.last)}
            self._announce("change_conflict", {**facts, "used": _fields(each.file)})
            log.warning(
                "%s answers at slave id %d, %s baud, as in the file; it was last published at %d, %s",
                each.device, each.file.id, each.file.baudrate, each.last.id, each.last.baudrate,
            )  # fmt: skip


def topics(now: Effective) -> frozenset[str]:
    """Return the topics under `B` that say where the file's devices were."""
    return frozenset((LINE_STATE, *(device_topic(name, CONFIG) for name in now.file_values.slaves)))


def retained_state(payloads: Mapping[str, bytes]) -> RetainedState:
    """Return what the payloads on `topics` say; those not in our form say nothing."""
    slaves: dict[str, int] = {}
    baudrate = None
    for topic, payload in payloads.items():
        found = _parsed(payload)
        if topic == LINE_STATE:
            baudrate = found.baudrate
        elif (device := device_of(topic, CONFIG)) is not None and found.slave is not None:
            slaves[device] = found.slave
    return RetainedState(slaves, baudrate)


def _parsed(payload: bytes) -> _Payload:
    """Return what is read of a payload; nothing of one that is not in our form."""
    if len(payload) > LARGEST:
        return _Payload()
    try:
        return _Payload.model_validate(from_json(payload, allow_inf_nan=False))
    except (ValueError, ValidationError):
        return _Payload()


def restored(
    now: Effective, state: RetainedState, online: AbstractSet[str]
) -> tuple[Changes, tuple[ConfirmedPlace, ...]]:
    """Return the changes with the places to search at, and the places that are already confirmed.

    `online` are the devices that answer at the file's place now.
    """
    filed = {name: entry["id"] for name, entry in now.file_values.slaves.items() if now.slave(name) is not None}
    unproven = {name: slave for name, slave in filed.items() if _unproven(now.changes, name)}
    elsewhere = _elsewhere(now, state, unproven)
    answering = unproven.keys() & online
    claimed = frozenset(elsewhere.values())
    there = [name for name in filed if name in answering and filed[name] not in claimed]
    rate, last_rate = now.file_values.baudrate, _last_rate(now, state)
    changes = now.changes
    for name, last in elsewhere.items():
        if name not in there:
            changes = changes.with_device(name, replace(changes.of(name), verified=Verified(Place(last))))
    if last_rate != rate and not answering:
        changes = replace(changes, baudrate=Rate(last_rate, last_rate))
    confirmed = [name for name in there if name in elsewhere]
    if last_rate != rate and answering and not confirmed:
        confirmed = [name for name in filed if name in answering][:1]  # the rate is the line's: announced once
    return changes, tuple(
        ConfirmedPlace(name, Place(filed[name], rate), Place(elsewhere.get(name, filed[name]), last_rate))
        for name in confirmed
    )


def _elsewhere(now: Effective, state: RetainedState, filed: Mapping[str, int]) -> dict[str, int]:
    """Return the devices last published at another id than the file's, with that id (rules 1 to 3)."""
    published = {name: state.slaves[name] for name in filed if name in state.slaves}
    times = Counter(published.values())
    return {
        name: slave
        for name, slave in published.items()
        if slave != filed[name] and times[slave] == 1 and _settable(now, name, slave)
    }


def _last_rate(now: Effective, state: RetainedState) -> int:
    """Return the rate last published where a command can have given it to the line, else the file's."""
    if state.baudrate is None or now.changes.baudrate is not None:
        return now.file_values.baudrate
    used = (now.loaded.profiles[slave.profile] for slave in now.config.slaves)
    settable = frozenset().union(*(profile.rate_codes for profile in used))
    return state.baudrate if state.baudrate in settable else now.file_values.baudrate


def _unproven(changes: Changes, name: str) -> bool:
    """Whether no change says where a device of the file is."""
    change = changes.of(name)
    return change.verified is None and change.added is None


def _settable(now: Effective, name: str, slave: int) -> bool:
    """Whether a command can have given this id to the device."""
    profile = now.loaded.profiles[next(each.profile for each in now.config.slaves if each.name == name)]
    return profile.slave_id is not None and profile.ids[0] <= slave <= profile.ids[1]


def _fields(place: Place) -> dict[str, int | None]:
    return {"slave": place.id, "baudrate": place.baudrate}
