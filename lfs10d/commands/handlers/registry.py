"""All requests by name, with the class of each, its parameters and its handler.

`config/reload` is `B/request/config/reload`.
"""

from __future__ import annotations

from collections.abc import Mapping

from lfs10d.commands.admission import CommandSpec
from lfs10d.commands.context import Handler
from lfs10d.commands.handlers import config, device, general, line, reconfigure, register, scan

A_DAY = 86_400.0
"""Seconds for which the response to a physical change is kept for repeats of the request."""

HANDLERS: Mapping[str, Handler] = {
    "health": Handler(CommandSpec("always"), general.health),
    "republish": Handler(CommandSpec("always"), general.republish),
    "config/get": Handler(CommandSpec("always"), config.get),
    "config/reload": Handler(CommandSpec("polling"), config.reload),
    "config/reset": Handler(CommandSpec("polling", config.WhichChange), config.reset),
    "device/add": Handler(CommandSpec("polling", device.NewDevice), device.add),
    "device/remove": Handler(CommandSpec("polling", device.OneDevice), device.remove),
    "device/options": Handler(CommandSpec("polling", device.Options), device.options),
    "device/read": Handler(CommandSpec("polling", device.OneDevice), device.read),
    "line/trace": Handler(CommandSpec("sensors", line.HowLong), line.trace),
    "line/pause": Handler(CommandSpec("sensors", line.HowLong), line.pause),
    "line/cancel": Handler(CommandSpec("sensors"), line.cancel),
    "register/read": Handler(CommandSpec("registers", register.SomeRegisters), register.read),
    "register/write": Handler(CommandSpec("registers", register.OneRegister), register.write),
    "line/scan": Handler(CommandSpec("sensors", scan.WhomToFind), scan.scan),
    "device/readdress": Handler(CommandSpec("sensors", reconfigure.ReaddressParameters, A_DAY), reconfigure.readdress),
    "line/adopt": Handler(CommandSpec("sensors", reconfigure.AdoptParameters, A_DAY), reconfigure.adopt),
    "line/baudrate": Handler(CommandSpec("sensors", reconfigure.BaudrateParameters, A_DAY), reconfigure.baudrate),
}
