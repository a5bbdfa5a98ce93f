"""Finds devices whose id or rate in the file differs from the last verified one: the place that answers is used."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping
from functools import partial

from lfs10d.config.changes import Changes, Place
from lfs10d.config.effective import Effective
from lfs10d.reading import Purpose
from lfs10d.reconfiguration.baudrate import at_rate
from lfs10d.reconfiguration.journal import Endpoint
from lfs10d.reconfiguration.procedure_run import ProcedureRun
from lfs10d.reconfiguration.procedures.locate import locate
from lfs10d.reconfiguration.runner import ChangeRunner
from lfs10d.reconfiguration.searches import Searches

log = logging.getLogger(__name__)


class Locator:
    """Searches on the line; `repoll()` polls the devices that are no longer `withheld`."""

    def __init__(self, runner: ChangeRunner, repoll: Callable[[], None]) -> None:
        self._runner = runner
        self._repoll = repoll
        self._answered_nowhere: dict[str, tuple[Place, ...]] = {}
        """Places of devices that answered at none of them."""
        self._searches: Searches[tuple[str, tuple[Place, ...]]] = Searches(runner.new_run)

    def contested(self) -> dict[str, tuple[Place, ...]]:
        """Return the devices with several possible places; without ids at which another device was verified."""
        now = self._runner.running()
        contested: dict[str, tuple[Place, ...]] = {}
        for slave in now.config.slaves:
            places, conflict = now.places[slave.name], slave.name in now.conflicts
            free = tuple(place for place in places if not (conflict and place.id == slave.id))
            if len(places) > 1 and free:
                contested[slave.name] = free
        return contested

    def withheld(self) -> frozenset[str]:
        """Return the devices that must not be polled before they were found."""
        return frozenset(
            name for name, places in self.contested().items() if self._answered_nowhere.get(name) != places
        )

    def begin(self) -> None:
        """Search for every contested device whose turn it is, unless that is under way."""
        if self._runner.ending:
            return
        contested, withheld = self.contested(), self.withheld()
        waiting = withheld - in_turn({name: contested[name] for name in withheld})
        self._searches.end_all(but=contested.items())
        for name, places in contested.items():
            if name in waiting or (name, places) in self._searches:
                continue
            now = self._runner.running()
            slave = now.slave(name)
            if slave is None or now.loaded.profiles[slave.profile].slave_id is None:
                # It has no id register: the file's place is kept.
                self._answered_nowhere[name] = places
                continue
            self._searches.begin((name, places), f"locate {name}", partial(self._locate, name, places))

    def stop(self) -> None:
        """Query no more."""
        self._searches.end_all()

    async def _locate(self, name: str, places: tuple[Place, ...], run: ProcedureRun) -> None:
        runner = self._runner
        now = runner.running()
        slave = now.slave(name)
        if slave is None:
            return
        rate = now.config.line.baudrate
        known, endpoints = (
            [Endpoint(slave=place.id, baudrate=place.baudrate or rate) for place in each]
            for each in (now.places[name], places)
        )
        query = runner.query(slave, run.clock)
        purpose = Purpose.PROBE if self._answered_nowhere.get(name) == places else Purpose.CHANGE
        steps = locate(endpoints, query, longest_pause=now.config.poll.probe_interval_max)
        async for _ in run.carry_out(steps, line_rate=rate, purpose=purpose):
            if self._answered_nowhere.get(name) != places:
                self._answered_nowhere[name] = places
                self._announce(name, known, None)
                self._repoll()
                self.begin()
        run.resume()
        if isinstance(run.result, Endpoint):
            self._searches.let_end((name, places))  # another configuration must not end this task
            await self._found(name, known, run.result)

    async def _found(self, name: str, known: list[Endpoint], endpoint: Endpoint) -> None:
        def edit(now: Effective) -> Changes:
            if now.slave(name) is None:
                return now.changes
            changes = now.changes.moving(name, Place(endpoint.slave), now.file_values)
            if endpoint.baudrate != now.config.line.baudrate or changes.baudrate is not None:
                return at_rate(changes, endpoint.baudrate, now.file_values.baudrate)
            return changes

        await self._runner.learn(edit)
        self._announce(name, known, endpoint)
        self._repoll()
        self.begin()

    def _announce(self, name: str, known: list[Endpoint], used: Endpoint | None) -> None:
        first, last = known[0], known[-1]
        facts = {"device": name, "file": first.model_dump(), "last": last.model_dump()}
        self._runner.announce("change_conflict", {**facts, "used": None if used is None else used.model_dump()})
        where = "at neither; both are queried" if used is None else f"at slave id {used.slave}, {used.baudrate} baud"
        log.warning(
            "%s: the file has it at slave id %d, %d baud; it was last verified at %d, %d baud: it answers %s",
            name, first.slave, first.baudrate, last.slave, last.baudrate, where,
        )  # fmt: skip


def in_turn(waiting: Mapping[str, tuple[Place, ...]]) -> frozenset[str]:
    """Return the devices to query now.

    A device waits while another one's last place has the id of its first one: that one may answer there. If that blocks
    every device, all are queried.
    """
    last = {name: places[-1].id for name, places in waiting.items()}
    free = (
        name
        for name, places in waiting.items()
        if not any(slave == places[0].id for other, slave in last.items() if other != name)
    )
    return frozenset(free) or frozenset(waiting)
