"""Changes of sensors: carries out their commands, one at a time, and recovers changes that are still open.

A change that the daemon did not live to finish is followed at the next start until its sensor is found; its command is
answered then.
"""

from __future__ import annotations

import contextlib
import logging
from collections.abc import Callable, Iterator, Mapping

from lfs10d.command import Command, Result
from lfs10d.config.models import Config
from lfs10d.errors import StateError
from lfs10d.reconfiguration import adopt, baudrate, readdress
from lfs10d.reconfiguration.adopt_request import AdoptRequest
from lfs10d.reconfiguration.journal import OpenChange
from lfs10d.reconfiguration.journal_commands import command_record
from lfs10d.reconfiguration.locate import Locator
from lfs10d.reconfiguration.recovery import Recovery
from lfs10d.reconfiguration.runner import ChangeRunner

log = logging.getLogger(__name__)


class Reconfiguration:
    """Changes of the sensors of one line. Used in the thread of the asyncio loop.

    `act` publishes what the line is busy with (None: polling), `repoll` has the line polled by a configuration.
    """

    def __init__(
        self, runner: ChangeRunner, *, act: Callable[[str | None], None], repoll: Callable[[Config], None]
    ) -> None:
        self.journal = runner.journal
        self.recall = runner.recall
        self.new_run = runner.new_run
        self._runner = runner
        self._act = act
        self._recovery = Recovery(runner)
        self._locator = Locator(runner, lambda: repoll(self.polled()))
        trouble = runner.journal.take()
        if trouble is not None:
            log.error("%s", trouble)
        runner.reservations.update()

    # -- one at a time

    @property
    def open(self) -> tuple[OpenChange, ...]:
        """The open changes: their sensors are still to be found."""
        return self.journal.open

    @property
    def busy(self) -> Result | None:
        """The rejection of whatever must wait until a scan or a change is over, None if nothing must."""
        return self._runner.reservations.busy

    @contextlib.contextmanager
    def place(self, request: str, slaves: frozenset[int] = frozenset()) -> Iterator[None]:
        """Reserve the line for one scan or change; see `lfs10d.reconfiguration.reservations`."""
        try:
            with self._runner.reservations.held(request, slaves):
                yield
        finally:
            self.follow()

    def polled(self) -> Config:
        """Return the configuration for the line: without the devices that it must be asked for first."""
        config, withheld = self._runner.running().polled, self._locator.withheld()
        slaves = tuple(slave for slave in config.slaves if slave.name not in withheld)
        return config.model_copy(update={"slaves": slaves})

    def reserved(self) -> Mapping[int, str]:
        """Return the slave ids that no device may be given now, with the reason."""
        return self._runner.reservations.reserved

    # -- the commands

    async def baudrate(self, to: int, *, power_cycle: bool, dry_run: bool, call: Command) -> Result:
        """Move every sensor and the port to another rate, verified, or back."""
        command = command_record(baudrate.NAME, call)
        if (busy := self.busy) is not None:
            return await self._runner.refuse(command, busy)
        with self.place(baudrate.NAME):
            self._act(baudrate.ACTIVITY)
            try:
                if (settled := baudrate.settled(self._runner, to)) is not None:
                    return await self._runner.refuse(command, settled)
                self._recovery.leave(frozenset(change.number for change in self.open))
                return await baudrate.perform(
                    self._runner, to, power_cycle=power_cycle, dry_run=dry_run, command=command
                )
            finally:
                self._act(None)

    async def adopt(self, request: AdoptRequest, call: Command) -> Result:
        """Adopt a factory-new sensor: it gets a free id and the line's rate, and is polled."""
        command = command_record(adopt.NAME, call)
        if (busy := self.busy or baudrate.unsettled(self._runner)) is not None:
            return await self._runner.refuse(command, busy)
        with self.place(adopt.NAME, request.slaves):
            return await adopt.perform(self._runner, request, command)

    async def readdress(self, device: str, to: int, *, dry_run: bool, call: Command) -> Result:
        """Give a sensor another slave id, verified."""
        command = command_record(readdress.NAME, call)
        slave = readdress.fit(self._runner, device, to)
        if isinstance(slave, Result):
            return await self._runner.refuse(command, slave)
        if (busy := self.busy or baudrate.unsettled(self._runner, device)) is not None:
            return await self._runner.refuse(command, busy)
        with self.place(readdress.NAME, frozenset({slave.id, to})):
            self._recovery.leave(self._runner.id_changes_of(device))
            return await readdress.perform(self._runner, slave, to, command, dry_run=dry_run)

    # -- what else happens

    def follow(self) -> None:
        """Search for the sensors of every open change, and for devices with several possible places."""
        self._locator.begin()
        self._recovery.begin()

    async def reconfigured(self, before: Config, after: Config) -> None:
        """Take another configuration: open changes of removed devices are dropped."""
        gone = {slave.name for slave in before.slaves} - {slave.name for slave in after.slaves}
        for change in self.open:
            if self._runner.underway is not None and change.asked == self._runner.underway:
                continue  # its own command ends and answers it
            if change.devices and change.devices <= gone:
                self._recovery.leave(frozenset({change.number}))
                with contextlib.suppress(StateError):
                    await self._runner.drop(change, f"{', '.join(sorted(change.devices))} was removed")
        self._locator.begin()

    async def stop(self) -> None:
        """Send no new frame of any change."""
        self._runner.ending = True
        self._locator.stop()
        self._recovery.stop()
        await self._runner.stop()
