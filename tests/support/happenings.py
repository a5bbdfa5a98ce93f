"""What happens to a line in a story but requests: devices come, power fails, somebody else speaks."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from lfs10d.simulator.sensor import Sensor
from lfs10d.simulator.wire import Format
from tests.support.ails import ail
from tests.support.faulty_sensors import power_cycle
from tests.support.foreigners import Foreigner
from tests.support.second_masters import passing_master

if TYPE_CHECKING:
    from tests.support.story import Story


def happen(story: Story, what: str, one: Any, more: Any) -> None:  # noqa: ANN401 - as it wants
    """Let one thing happen; `one` and `more` are its particulars."""
    bench = story.bench
    match what:
        case "plug":
            story.newcomers.append(bench.line.add(Sensor(1, format=Format(one))))
            ail(story.newcomers[-1], more)
            story.before = story.ids()
        case "foreign":
            words, its = more
            story.foreigners.append(Foreigner(words, one))
            ail(bench.line.add(story.foreigners[-1]), its)
        case "master":
            story.leave()
            bench.line.format = Format(story.rate)
            story.leave = passing_master(bench.line, bytes(one), bench.clock.now + 0.01, more)
        case "power":
            story.powered()
            power_cycle(story.sensors[one % len(story.sensors)])
        case "heal":
            story.sensors[one % len(story.sensors)].faults.clear()
        case "wait":
            bench.go(story.life, one)
        case "unplug":
            bench.port.unplug()
            bench.go(story.life, one)
            bench.port.replug()
            bench.go(story.life, 3.0)
