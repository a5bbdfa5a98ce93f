"""`device/readdress` from the request to the journal, the line, the configuration and the answer."""

from __future__ import annotations

import logging
from functools import partial
from typing import TYPE_CHECKING, Any

from lfs10d.command import Result, failed, rejected
from lfs10d.config.effective import Effective
from lfs10d.config.models import SlaveConfig
from lfs10d.errors import StateError
from lfs10d.line.jobs.procedure import ProcedureClock
from lfs10d.profiles.profile import Profile
from lfs10d.reconfiguration import readdress_answers
from lfs10d.reconfiguration.journal import CommandRecord, Endpoint, Move, OpenChange
from lfs10d.reconfiguration.procedures.readdress import (
    NOTHING_WRITTEN,
    IdWrite,
    ReaddressEnding,
    ReaddressReport,
    ReaddressWish,
    readdress,
)

if TYPE_CHECKING:
    from lfs10d.reconfiguration.reconfiguration import Reconfiguration

log = logging.getLogger(__name__)

NAME = "device/readdress"


class Readdress:
    """Sensors that get another slave id; a part of `Reconfiguration`."""

    def __init__(self, physical: Reconfiguration) -> None:
        self._physical = physical

    def fit(self, device: str, to: int) -> SlaveConfig | Result:
        """Return the device that may be moved as far as is known here, or why the line need not even be asked."""
        physical = self._physical
        now = physical.running()
        slave = now.slave(device)
        if slave is None:
            names = ", ".join(other.name for other in now.config.slaves) or "none"
            return rejected("unknown_device", f"there is no device {device}; configured are: {names}", param="device")
        profile = now.loaded.profiles[slave.profile]
        first, last = profile.ids
        if profile.slave_id is None:
            return rejected("not_allowed", f"{device}: profile {profile.name} does not say how its slave id is set")
        if not first <= to <= last:
            return rejected("invalid_param", f"to: must be {first} to {last} for {profile.name}", param="to")
        if device in now.conflicts:
            return rejected("not_allowed", f"{device}: {now.conflicts[device]}")
        return self._taken(device, to, now) or slave

    def _taken(self, device: str, to: int, now: Effective) -> Result | None:
        physical = self._physical
        for other in now.config.slaves:
            if to in {other.id, *(place.id for place in now.places[other.name])}:
                return rejected("address_in_use", f"slave id {to} is that of {other.name}", param="to")
        reserved = physical.reserved()
        mine = physical.changes_of(device)
        own = frozenset().union(*(each.slaves for each in physical.open if each.number in mine))
        if to in reserved and to not in own:
            return rejected("address_in_use", f"slave id {to} {reserved[to]}", param="to")
        return None

    async def perform(self, slave: SlaveConfig, to: int, asked: CommandRecord, *, dry_run: bool) -> Result:
        """Give a sensor another slave id, verified; see `lfs10d.reconfiguration.procedures.readdress`."""
        physical = self._physical
        now = physical.running()
        profile, rate = now.loaded.profiles[slave.profile], now.config.line.baudrate
        rates = tuple(profile.baudrate.codes) if profile.baudrate else ()
        wish = ReaddressWish(Endpoint(slave=slave.id, baudrate=rate), to, rates, dry_run)
        physical.leave(physical.changes_of(slave.name))
        clock = ProcedureClock()
        talk = physical.talk()
        steps = readdress(wish, physical.asking(slave, clock), physical.wire().echo_known)
        talk.begin(steps, clock, line_rate=rate, excludes=frozenset({slave.id, to}))

        def intend(write: IdWrite) -> OpenChange:
            move = Move(device=slave.name, old=write.old, new=write.new, register_before=write.register_before)
            return physical.journal.intend("readdress", (move,), physical.now().ts(), asked)

        async def conclude(result: Any, change: OpenChange | None) -> Result:  # noqa: ANN401 - a course's
            verdict = result or ReaddressReport(ReaddressEnding.LOST_BEFORE)
            return await self._conclude(slave.name, wish, verdict, change, asked, profile)

        return await physical.carried_out(talk, asked, intend, conclude)

    async def _conclude(
        self,
        device: str,
        wish: ReaddressWish,
        verdict: ReaddressReport,
        change: OpenChange | None,
        asked: CommandRecord,
        profile: Profile,
    ) -> Result:
        """Put on the disk what came of it; return the answer."""
        physical = self._physical
        journal = physical.journal
        answer = readdress_answers.readdressed(device, wish, verdict, profile)
        if verdict.ending is ReaddressEnding.TWINS:
            self.tell_duplicate(device, wish.old, wish.old)
        if change is None or verdict.ending in NOTHING_WRITTEN:
            return await physical.refused(asked, answer)
        told = physical.told(asked, answer)
        try:
            if verdict.ending is ReaddressEnding.MOVED:
                await physical.record(device, wish.new)
                await physical.close(physical.changes_of(device), change, told)
                self.tell_moved(device, wish.old, wish.new)
            elif verdict.stays_open:
                if verdict.ending is ReaddressEnding.PENDING:
                    await physical.close(physical.changes_of(device) - {change.number}, change, None)
                await physical.put(partial(journal.keep, change.number, told))
            else:
                await physical.put(partial(journal.close, frozenset({change.number}), told))
        except StateError as error:
            if verdict.ending is ReaddressEnding.MOVED:
                message = f"{device} answers at slave id {wish.to} now, but that cannot be kept: {error}"
                return failed("storage_full", message, data=answer.data)
            log.warning("%s", error)
        if verdict.ending in (ReaddressEnding.BOTH, ReaddressEnding.GARBAGE):
            self.tell_duplicate(device, wish.old, wish.new)
        return answer

    def tell_moved(self, device: str, old: Endpoint, new: Endpoint) -> None:
        """Tell that a sensor has another slave id now."""
        self._physical.tell("readdressed", {"device": device, "from": old.slave, "to": new.slave})

    def tell_duplicate(self, device: str, old: Endpoint, new: Endpoint) -> None:
        """Tell that two sensors have one slave id, or had."""
        self._physical.tell("duplicate_id", {"device": device, "slave": new.slave, "from": old.slave})
