"""The parts of docs/commands.md: every request as it was sent to a daemon on a simulated line, and what it answered.

The answers are kept in recorded.json; `python -m docs.generate.record` makes them anew. A test sends the same requests
to a running daemon and holds its answers to the recorded ones.
"""

from __future__ import annotations

import json
import shlex
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, get_args

from docs.generate.markdown import example, table
from docs.generate.meanings import ADVICE, ERROR_CODES
from lfs10d.command import ErrorCode
from lfs10d.commands.handlers.registry import HANDLERS

RECORDED: Final = Path(__file__).with_name("recorded.json")

SLAVES: Final = (2, 3, 5)
"""Sensors on the line at `BAUDRATE`; besides there is a factory-new one, 1 at 9600 baud."""
BAUDRATE: Final = 19200
CONFIG: Final[Mapping[str, Any]] = {
    "slaves": [{"id": 2, "name": "mast-top", "label": "Mast, 10 m"}, 3],
    "poll": {"interval": "1s"},
    "commands": ["polling", "sensors", "registers"],
}
"""What the daemon is told besides the port and the broker."""


@dataclass(frozen=True, slots=True)
class Step:
    """One request of the walk; `words` say in the page why it is shown. `slow`: it takes many seconds."""

    name: str
    words: str
    parameters: Mapping[str, Any]
    slow: bool = False

    @property
    def arguments(self) -> list[str]:
        """What is typed after `lfs10d request`."""
        return [self.name, *(f"{key}={_typed(value)}" for key, value in self.parameters.items())]


def _typed(value: object) -> str:
    return value if isinstance(value, str) else json.dumps(value, separators=(",", ":"))


WALK: Final = (
    Step("health", "The state of the daemon, the line and every sensor; on the command line as a table.", {}),
    Step("republish", "Publishes every retained topic again; the response gives their number.", {}),
    Step("config/get", "The effective configuration without secrets, with the origin of each value.", {}),
    Step("config/reload", "The same as SIGHUP: changes in the file take effect.", {}),
    Step(
        "device/read",
        "Polls the device now, in turn with the others. The sample is published on `telemetry` too.",
        {"device": "mast-top"},
    ),
    Step("device/read", "A name that no device has:", {"device": "mast"}),
    Step("device/add", "Slave id 5 is asked first, and polled because it answers.", {"slave": 5, "name": "crane"}),
    Step(
        "device/add",
        "No device answers, so nothing is changed. With `probe=false` it is added all the same.",
        {"slave": 44},
    ),
    Step(
        "device/options",
        "Takes effect at once, and is kept across restarts.",
        {"device": "slave-3", "interval": "500ms", "label": "South"},
    ),
    Step(
        "config/reset",
        "Undoes what requests changed of a device, or of one of its keys: the value in the file holds again.",
        {"device": "slave-3"},
    ),
    Step("device/remove", "Its retained topics are cleared.", {"device": "crane"}),
    Step("register/read", "The slave id as the sensor holds it.", {"device": "mast-top", "address": 5}),
    Step(
        "register/write",
        "An LFS10 has no register that may be written this way:",
        {"device": "mast-top", "address": 5, "value": 9},
    ),
    Step(
        "line/trace",
        "Publishes every frame on `B/trace` for the time given; `lfs10d trace` shows them.",
        {"for": "10s"},
    ),
    Step("line/pause", "Frees the port for another program for the time given.", {"for": "30s"}),
    Step("line/cancel", "Ends the trace and the pause early.", {}),
    Step(
        "line/scan",
        "Polling goes on; `scan_progress` events report the progress.",
        {"ids": "2-6", "baudrates": [BAUDRATE]},
        slow=True,
    ),
    Step(
        "device/readdress",
        "First only a check whether it can be done:",
        {"device": "slave-3", "to": 9, "dry_run": True},
        slow=True,
    ),
    Step(
        "device/readdress",
        "Then for real. The response comes when the sensor has answered at its new id, after 10 to 25 s.",
        {"device": "slave-3", "to": 9},
        slow=True,
    ),
    Step("device/readdress", "An id that is in use is rejected at once:", {"device": "slave-3", "to": 2}),
    Step(
        "line/adopt",
        "The factory-new sensor, slave id 1 at 9600 baud, gets the next free id and the line's rate, in half a "
        "minute. With `--repeat` one after the other: [installation.md](installation.md#mounting-sensors).",
        {"name": "north", "label": "North side"},
        slow=True,
    ),
    Step("line/baudrate", "Moves all sensors, the first one as a trial, and then the port.", {"to": 9600}, slow=True),
)
"""In this order, for one leads to the next."""


def recorded() -> list[dict[str, Any]]:
    """Return the responses, one for each step of the walk."""
    found: list[dict[str, Any]] = json.loads(RECORDED.read_text(encoding="utf-8"))
    return found


def parts() -> Mapping[str, str]:
    """Return the generated parts by name."""
    return {
        "requests": "\n\n".join(_requests()),
        "codes": table(("code", "it means", "what to do"), _codes()),
        "example": example(recorded()[4]),
    }


def _requests() -> Iterator[str]:
    """Yield a section for each request, in the order of the walk; ValueError where one is not walked."""
    answers = list(zip(WALK, recorded(), strict=True))
    names = dict.fromkeys(step.name for step in WALK)
    if set(names) != set(HANDLERS):
        raise ValueError(f"not walked, or unknown: {', '.join(sorted(set(names) ^ set(HANDLERS)))}")
    for name in names:
        yield f"### `{name}`"
        yield f"Class `{HANDLERS[name].spec.klass}`. Its parameters: [mqtt.md](mqtt.md#{name.replace('/', '')})."
        for step, response in answers:
            if step.name == name:
                yield step.words
                yield f"```sh\n{shlex.join(['lfs10d', 'request', *step.arguments])}\n```"
                payload = json.dumps({"id": response["id"], **step.parameters}, ensure_ascii=False)
                yield f"```sh\nmosquitto_pub -t lfs10d/line0/request/{name} -m '{payload}'\n```"
                yield example(response)


def _codes() -> Iterator[tuple[str, ...]]:
    codes = tuple(map(str, get_args(ErrorCode)))
    if set(ADVICE) != set(codes):
        raise ValueError(f"advice and codes differ in {', '.join(sorted(set(ADVICE) ^ set(codes)))}")
    yield from ((f"`{code}`", ERROR_CODES[code], ADVICE[code]) for code in codes)
