"""What a request is made of, and what it may use of the daemon."""

from __future__ import annotations

from collections.abc import Callable, Coroutine, Mapping
from dataclasses import dataclass
from typing import Any, Protocol, TypeAlias

from lfs10d.command import Command, Result
from lfs10d.commands.admission import CommandSpec
from lfs10d.commands.reads import ReadResult
from lfs10d.config.effective import Edit, Effective
from lfs10d.config.models import SlaveConfig
from lfs10d.line.jobs.ping import Ping
from lfs10d.line.jobs.register_access import Access
from lfs10d.line.jobs.scan import Scan
from lfs10d.modbus.request import Request as RegisterRequest
from lfs10d.profiles.profile import Profile


class Context(Protocol):
    """What the daemon lets requests do. Called in the thread of the asyncio loop."""

    def health(self) -> dict[str, object]:
        """Return how the daemon, the line and the devices are, as in `status.json`."""
        ...

    def devices(self) -> tuple[str, ...]:
        """Return the names of the configured devices, disabled ones too."""
        ...

    async def read(self, device: str) -> ReadResult | None:
        """Poll a configured device now; None if it was removed or became another one before it was asked."""
        ...

    def trace(self, duration: float) -> None:
        """Tell every frame for `duration` s from now on, whatever was said before."""
        ...

    async def scan(self, ids: tuple[int, ...], rates: tuple[int, ...], share: float) -> Scan:
        """Find out who is on the line, with at most that `share` of its time; return the scan that is over.

        No `rates` are the usual ones. Raises RefusedError while a physical change or another scan is under way.
        """
        ...

    async def pause(self, duration: float) -> None:
        """Free the port for `duration` s from now on, whatever was said before; return when it is free.

        Raises RefusedError while a physical change or a scan is under way.
        """
        ...

    def cancel(self) -> tuple[str, ...]:
        """End what ends before its time when told to; return what that was: `trace`, `scan`, `pause`."""
        ...

    def republish(self) -> int:
        """Send every retained topic once more; return how many."""
        ...

    def configuration(self) -> dict[str, object]:
        """Return the effective configuration, secrets left out, and where its values come from."""
        ...

    def effective(self) -> Effective:
        """Return the configuration that holds, with what requests changed."""
        ...

    async def change(self, edit: Edit) -> tuple[Effective, Effective]:
        """Change what holds, on the disk first; return what held before and what holds now.

        Raises StateError where it cannot be put on the disk, and what `edit` raises; nothing is changed then.
        """
        ...

    def applied(self, request: str, call: Command, **facts: object) -> None:
        """Tell everybody what a request changed."""
        ...

    async def knock(self, slave: int, profile: Profile) -> Ping:
        """Ask a slave id that nobody polls whether anybody is there; return the job that is over."""
        ...

    async def access(self, what: RegisterRequest, device: SlaveConfig | None) -> Access:
        """Read or write registers of a configured device, or of a slave that is not; return the job that is over."""
        ...

    def reserved(self) -> Mapping[int, str]:
        """Return the slave ids that no device may be given now, with the reason: `is reserved by ...`."""
        ...

    async def readdress(self, device: str, to: int, *, dry_run: bool, call: Command) -> Result:
        """Give a sensor another slave id, verified on the line; with `dry_run` only find out whether it could be."""
        ...

    async def baudrate(self, to: int, *, power_cycle: bool, dry_run: bool, call: Command) -> Result:
        """Move every sensor and the port to another rate, verified, or back."""
        ...

    async def adopt(
        self, *, name: str | None, label: str | None, profile: str, factory: int | None, to: int | None, call: Command
    ) -> Result:
        """Give a factory-new sensor of a `profile` at id `factory` the id `to` and the line's rate, and poll it.

        None is the profile's factory id, and the next free id. `profile` is a word that can be loaded.
        """
        ...

    async def reload(self) -> dict[str, list[str]]:
        """Read the files again and apply what changed; return `applied` and `restart_required`.

        Raises ConfigError where a file is wrong; the running configuration stays.
        """
        ...


Perform: TypeAlias = "Callable[[Any, Context, Command], Coroutine[Any, Any, Result]]"
"""Takes the parameters in their form, the powers, and the call they came with."""


@dataclass(frozen=True, slots=True)
class Handler:
    """A request: what admission must know, and what it does with its parameters and the daemon's powers."""

    form: CommandSpec
    perform: Perform
