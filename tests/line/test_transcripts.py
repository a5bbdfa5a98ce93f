"""The line, byte for byte: what is sent (`>>`) and heard (`<<`) at which virtual millisecond, and the readings.

A transcript is checked in as text. To write one anew, delete it, run the test (which then fails once) and read it.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from lfs10d.line.device import PollRules
from lfs10d.modbus.bus import LineRules
from lfs10d.reading import Event, Exchanged, PortChanged, Reading
from lfs10d.simulator.line_faults import babble
from tests.support.faulty_sensors import add_fault
from tests.support.lines import Rig, Rigs

FOLDER = Path(__file__).parent / "transcripts"


def healthy(rigs: Rigs) -> Rig:
    return rigs(2, interval=0.25).run(0.55)


def late_answer(rigs: Rigs) -> Rig:
    rig = rigs(2, interval=1.0, response_timeout=0.5, in_turn=True).run(1.9)
    add_fault(rig.line.sensor(1), "late", delay=0.55, last=2.5)
    return rig.run(4.3)


def broken_answers(rigs: Rigs) -> Rig:
    rig = rigs(2, interval=1.0).run(0.9)
    add_fault(rig.line.sensor(1), "noisy", last=1.03)
    add_fault(rig.line.sensor(2), "truncated", length=4, last=1.6)
    return rig.run(2.3)


def dead(rigs: Rigs) -> Rig:
    rig = rigs(2, interval=1.0, rules=PollRules(retries=0, offline_after=2)).run(0.9)
    add_fault(rig.line.sensor(1), "silent", last=5.0)
    return rig.run(7.9)


def refusals(rigs: Rigs) -> Rig:
    rig = rigs(1, interval=0.5).run(0.4)
    add_fault(rig.line.sensor(1), "exception", last=0.9)
    add_fault(rig.line.sensor(1), "exception", code=6, first=0.9, last=1.4)
    add_fault(rig.line.sensor(1), "nan", first=1.4, last=1.9)
    return rig.run(2.4)


def echo(rigs: Rigs) -> Rig:
    return rigs(1, interval=0.25, echo=True, line_rules=LineRules(extra_gap=0.001)).run(0.9)


def unplugged(rigs: Rigs) -> Rig:
    rig = rigs(2, interval=1.0).run(1.01)
    rig.port.unplug()
    rig.run(1.5)
    rig.port.replug()
    return rig.run(2.2)


def babbling(rigs: Rigs) -> Rig:
    rig = rigs(1, interval=0.5, response_timeout=0.1)
    babble(rig.line, 0.4, 0.75)
    return rig.run(1.2)


SCENARIOS: dict[str, Callable[[Rigs], Rig]] = {
    scenario.__name__: scenario
    for scenario in (healthy, late_answer, broken_answers, dead, refusals, echo, unplugged, babbling)
}


def milliseconds(seconds: float) -> str:
    return f"{seconds * 1000:10.3f}"


def lines_of(event: Event) -> list[str]:
    """Return what one event adds to the transcript."""
    at = milliseconds(event.at)
    if isinstance(event, Exchanged):
        sent = [] if event.began is None else [f"{milliseconds(event.began)} >> {event.sent.hex(' ')}"]
        heard = [] if not event.heard else [f"{at} << {event.heard.hex(' ')}"]
        late = [f"{at}    late: {event.late}"] if event.late else []
        return sent + heard + late
    if isinstance(event, Reading):
        said = event.fault.code.value if event.fault else str(dict(event.values or {})["wind_speed"])
        extra = "".join(f" {word}" for word in ("probe" * event.probe, *event.failed_attempts) if word)
        return [f"{at} == {event.device} {said} {'online' if event.online else 'offline'}{extra}"]
    if isinstance(event, PortChanged):
        return [f"{at} == port {event.fault.message if event.fault else 'open'}"]
    return []


@pytest.mark.parametrize("name", SCENARIOS)
def test_the_line_is_spoken_as_written_down(rigs: Rigs, name: str) -> None:
    rig = SCENARIOS[name](rigs).prove()
    text = "".join(f"{line}\n" for event in rig.events for line in lines_of(event))
    file = FOLDER / f"{name}.txt"
    if not file.exists():
        file.write_text(text, "ascii")
        pytest.fail(f"{file.name} was written: read it, then run again")
    assert text == file.read_text("ascii")


def test_no_transcript_is_left_over() -> None:
    assert {file.stem for file in FOLDER.iterdir()} == set(SCENARIOS)
