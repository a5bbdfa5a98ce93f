"""The interfaces that a handler may use of the daemon, and the type of a handler."""

from __future__ import annotations

from collections.abc import Callable, Coroutine, Mapping
from typing import TYPE_CHECKING, Any, Protocol, TypeAlias

from lfs10d.command import Command, RefusedError, Result
from lfs10d.commands.admission import CommandSpec
from lfs10d.commands.message import Parameters
from lfs10d.commands.reads import ReadResult
from lfs10d.system.dataclass import dataclass

if TYPE_CHECKING:  # `lfs10d request` reads from the handlers what there is to ask, and speaks to no line
    from lfs10d.config.live_config import LiveConfig
    from lfs10d.config.models import SlaveConfig
    from lfs10d.line.jobs.ping import Ping
    from lfs10d.line.jobs.register_access import Access
    from lfs10d.line.jobs.scan import Scan
    from lfs10d.modbus.request import Request as RegisterRequest
    from lfs10d.profiles.profile import Profile
    from lfs10d.reconfiguration.adopt_request import AdoptRequest


class LineCommands(Protocol):
    """The line, for handlers; see `lfs10d.commands.line_access.LineAccess`."""

    @property
    def paused(self) -> bool:
        """Whether the port is freed for another program."""

    async def read(self, device: str) -> ReadResult | None:
        """Poll a configured device now; None if it was removed or replaced before the poll."""

    def trace(self, duration: float) -> None:
        """Publish every frame for `duration` s from now on, in place of what was set before."""

    async def scan(self, ids: tuple[int, ...], rates: tuple[int, ...], share: float) -> Scan:
        """Search the line for devices, with at most that `share` of its time; return the scan that is over.

        No `rates` are the usual ones. Raises RefusedError while a change of sensors or another scan is under way.
        """

    async def pause(self, duration: float) -> None:
        """Free the port for `duration` s from now on, in place of what was set before; return when it is free.

        Raises RefusedError while a change of sensors or a scan is under way.
        """

    def cancel(self) -> tuple[str, ...]:
        """End trace, scan and pause; return those that were under way: `trace`, `scan`, `pause`."""

    async def ping(self, slave: int, profile: Profile) -> Ping:
        """Ask a slave id that is not polled whether a device answers; return the job that is over."""

    async def access(self, request: RegisterRequest, device: SlaveConfig | None) -> Access:
        """Read or write registers of a configured device, or of a slave that is not; return the job that is over."""


class SensorChanges(Protocol):
    """Changes of sensors, for handlers; see `lfs10d.reconfiguration.reconfiguration.Reconfiguration`."""

    def reserved(self) -> Mapping[int, str]:
        """Return the slave ids that no device may be given now, with the reason: `is reserved by ...`."""

    async def readdress(self, device: str, to: int, *, dry_run: bool, call: Command) -> Result:
        """Give a sensor another slave id, verified on the line; with `dry_run` only check whether that is possible."""

    async def baudrate(self, to: int, *, power_cycle: bool, dry_run: bool, call: Command) -> Result:
        """Move every sensor and the port to another rate, verified, or back."""

    async def adopt(self, wanted: AdoptRequest, call: Command) -> Result:
        """Give a factory-new sensor its id and the line's rate, and poll it."""


class Announcements(Protocol):
    """Publishing, for handlers; see `lfs10d.mqtt.publisher.Publisher`."""

    def health(self) -> dict[str, object]:
        """Return the state of the daemon, the line and the devices, as in `status.json`."""

    def republish(self) -> int:
        """Publish every retained topic again; return their number."""

    def applied(self, request: str, command: Command, **facts: object) -> None:
        """Publish on `event` what a request changed."""


@dataclass(frozen=True, slots=True)
class Context:
    """Everything a handler may use. Used in the thread of the asyncio loop."""

    config: LiveConfig
    line: LineCommands
    reconfiguration: SensorChanges
    publisher: Announcements


Perform: TypeAlias = "Callable[[Any, Context, Command], Coroutine[Any, Any, Result]]"
"""Takes the parameters in their form, the context, and the command they came with."""


@dataclass(frozen=True, slots=True)
class Handler:
    """One request: what admission must know, and what carries it out; where that raises RefusedError, it is refused."""

    spec: CommandSpec
    work: Perform

    async def perform(self, parameters: Parameters, context: Context, command: Command) -> Result:
        """Carry it out and return its result."""
        try:
            return await self.work(parameters, context, command)
        except RefusedError as error:
            return error.result
