"""Where the devices were when an earlier life published it: our own retained topics, when `changes.yaml` is gone. Pure.

Rules
-----
1. What a broker retains is a stranger's word: what is not exactly in our form, or out of a profile's range, is no word.
2. It counts for the devices of the file alone, and only where no change says where they are.
3. One id told of two devices is told of neither of them, unless the file says the same of one: that one keeps it.
4. A device that answers at the file's place is there, and so is the line's rate; that is told, and nothing is kept.
   Not so where another device is told to have been at that id: then who answers there is not known yet.
5. The others are kept as verified there once (rule 3 of `lfs10d.config.merge`): the line is asked, the file's place
   first.
"""

from __future__ import annotations

import logging
from collections import Counter
from collections.abc import Awaitable, Callable, Iterable, Mapping
from collections.abc import Set as AbstractSet
from dataclasses import dataclass, replace
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, ValidationError
from pydantic_core import from_json

from lfs10d.config.changes import Changes, Place, Rate, Verified
from lfs10d.config.effective import Effective
from lfs10d.config.live_config import Edit
from lfs10d.config.models import LineConfig
from lfs10d.line.device import Device
from lfs10d.schema.fields import Choice, Whole
from lfs10d.telemetry.publication import CONFIG, LINE_STATE, device_of, device_topic

LARGEST = 4096
"""Bytes of a payload that is looked at; ours have a few hundred."""

_Baudrate = Annotated[
    int, next(kind for kind in LineConfig.model_fields["baudrate"].metadata if isinstance(kind, Choice))
]


class _Word(BaseModel):
    """What we read of a payload; another version of lfs10d may say more in it."""

    model_config = ConfigDict(strict=True, extra="ignore", frozen=True)


class _Config(_Word):
    slave: Annotated[int, Whole(1, 255)]


class _LineState(_Word):
    baudrate: _Baudrate


@dataclass(frozen=True, slots=True)
class RetainedState:
    """The slave id of each device by name, and the line's rate, as last published; None where nothing is known."""

    slaves: Mapping[str, int]
    baudrate: int | None = None


@dataclass(frozen=True, slots=True)
class ConfirmedPlace:
    """A device that answers at the file's place, though it was last published at another."""

    device: str
    file: Place
    last: Place


def topics(now: Effective) -> frozenset[str]:
    """Return the topics under `B` that tell where the file's devices were."""
    return frozenset((LINE_STATE, *(device_topic(name, CONFIG) for name in now.said.slaves)))


def recollect(payloads: Mapping[str, bytes]) -> RetainedState:
    """Return what is said on `topics`; of what is not in our form, nothing."""
    slaves: dict[str, int] = {}
    baudrate = None
    for topic, payload in payloads.items():
        if topic == LINE_STATE:
            state = _understood(_LineState, payload)
            baudrate = None if state is None else state.baudrate
        elif (device := device_of(topic, CONFIG)) is not None and (word := _understood(_Config, payload)) is not None:
            slaves[device] = word.slave
    return RetainedState(slaves, baudrate)


def _understood(form: type[Any], payload: bytes) -> Any:  # noqa: ANN401 - an instance of `form`, or None
    if len(payload) > LARGEST:
        return None
    try:
        return form.model_validate(from_json(payload, allow_inf_nan=False))
    except (ValueError, ValidationError):
        return None


def remembering(
    now: Effective, recalled: RetainedState, answering: AbstractSet[str]
) -> tuple[Changes, tuple[ConfirmedPlace, ...]]:
    """Return the changes with what is to be asked for, and what is settled already.

    `answering` are the devices that answer at the file's place now.
    """
    filed = {name: entry["id"] for name, entry in now.said.slaves.items() if now.slave(name) is not None}
    open_ones = {name for name in filed if _unproven(now.changes, name)}
    elsewhere = _elsewhere(now, recalled, {name: slave for name, slave in filed.items() if name in open_ones})
    changes, rate = now.changes, now.said.baudrate
    last_rate = rate
    if recalled.baudrate is not None and recalled.baudrate in _rates(now) and changes.baudrate is None:
        last_rate = recalled.baudrate
    known = open_ones & answering
    claimed = set(elsewhere.values())
    there = [name for name in filed if name in known and filed[name] not in claimed]
    moved = [name for name in there if name in elsewhere]
    if last_rate != rate and known and not moved:
        moved = [name for name in filed if name in known][:1]  # the rate is the line's: told once
    for name, last in elsewhere.items():
        if name not in there:
            changes = changes.with_device(name, replace(changes.of(name), verified=Verified(Place(last))))
    if last_rate != rate and not known:
        changes = replace(changes, baudrate=Rate(last_rate, last_rate))
    settled = (
        ConfirmedPlace(name, Place(filed[name], rate), Place(elsewhere.get(name, filed[name]), last_rate))
        for name in moved
    )
    return changes, tuple(settled)


def _elsewhere(now: Effective, recalled: RetainedState, filed: Mapping[str, int]) -> dict[str, int]:
    """Return the devices last published at another id than the file's, with that id (rules 1 to 3)."""
    told = {name: recalled.slaves[name] for name in filed if name in recalled.slaves}
    times = Counter(told.values())
    return {
        name: slave
        for name, slave in told.items()
        if slave != filed[name] and times[slave] == 1 and _settable(now, name, slave)
    }


def _rates(now: Effective) -> frozenset[int]:
    """Return the rates that a request can have given to the line."""
    used = (now.loaded.profiles[slave.profile].baudrate for slave in now.config.slaves)
    return frozenset(rate for baudrate in used if baudrate is not None for rate in baudrate.codes)


def _unproven(changes: Changes, name: str) -> bool:
    """Tell whether no change says where a device of the file is."""
    change = changes.of(name)
    return change.verified is None and change.added is None


def _settable(now: Effective, name: str, slave: int) -> bool:
    """Tell whether a request can have given this id to the device."""
    profile = now.loaded.profiles[next(each.profile for each in now.config.slaves if each.name == name)]
    return profile.slave_id is not None and profile.ids[0] <= slave <= profile.ids[1]


log = logging.getLogger(__name__)


class Restore:
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
        return topics(self._running())

    async def take(self, payloads: Mapping[str, bytes]) -> None:
        """Take what is retained on those topics."""
        recalled = recollect(payloads)
        answering = {device.spec.name for device in self._devices() if device.online}
        settled: tuple[ConfirmedPlace, ...] = ()

        def edit(now: Effective) -> Changes:
            nonlocal settled
            changes, settled = remembering(now, recalled, answering)
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
