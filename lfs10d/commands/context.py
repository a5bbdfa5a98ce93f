"""What a handler may use of the daemon, and the type of a handler."""

from __future__ import annotations

from collections.abc import Callable, Coroutine
from typing import TYPE_CHECKING, Any, TypeAlias

from lfs10d.command import Command, RefusedError, Result
from lfs10d.commands.admission import CommandSpec
from lfs10d.commands.message import Parameters
from lfs10d.system.dataclass import dataclass

if TYPE_CHECKING:  # `lfs10d request` reads from the handlers what there is to ask, and speaks to no line
    from lfs10d.commands.line_access import LineAccess
    from lfs10d.config.live_config import LiveConfig
    from lfs10d.mqtt.publisher import Publisher
    from lfs10d.reconfiguration.reconfiguration import Reconfiguration


@dataclass(frozen=True, slots=True)
class Context:
    """Everything a handler may use. Used in the thread of the asyncio loop."""

    config: LiveConfig
    line: LineAccess
    reconfiguration: Reconfiguration
    publisher: Publisher


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
