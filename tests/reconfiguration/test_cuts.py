"""The daemon dies at every step on the disk and at every exchange of a change, one after the other: none is left out.

At an exchange it dies when the request was heard and before the answer is; what happens on the disk between two
exchanges is cut at each of its steps. What was not synced is lost.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import pytest

from lfs10d.simulator.judge import HeardRequest
from lfs10d.simulator.sensor import Sensor
from lfs10d.simulator.wire import Format
from tests.support.faulty_sensors import add_fault, power_cycle
from tests.support.lives import Bench, Life
from tests.support.volatile_disk import PowerCutError

pytestmark = pytest.mark.long(15)

LONGEST = 3000
"""Turns of 50 ms after which a change counts as endless."""
SETTLED_WITHIN = 140.0
"""Virtual seconds after the last power cycle within which everything is found; a roll-back takes up to 60."""


@dataclass(frozen=True)
class Case:
    """One change of the sensors 3 and 4, and what ails them; the newcomer is a third."""

    name: str
    parameters: dict[str, Any]
    ails: dict[int, str] = field(default_factory=dict)
    newcomer: int | None = None

    def begin(self, bench: Bench) -> Life:
        """Put up a line anew."""
        bench.renew()
        life = bench.sensors(3, 4, poll="{interval: 5s}")
        bench.go(life, 3.0)
        if self.newcomer is not None:
            bench.line.add(Sensor(1, format=Format(self.newcomer)))
        for slave, fault in self.ails.items():
            add_fault(bench.line.sensor(slave), fault)
        return life

    def ask(self, bench: Bench, life: Life) -> None:
        """Ask for it, and go on until there is an answer; raises PowerCutError where the daemon dies before."""
        life.request(self.name, id="c1", **self.parameters)
        for _ in range(LONGEST):
            if bench.responses:
                return
            left = bench.files.steps_left
            if left is not None and bench.files.steps >= left:
                raise PowerCutError
            bench.turn(life)
        pytest.fail("no answer")

    def settle(self, bench: Bench) -> Life:
        """Begin another life, switch the power of all off and on, and go on until nothing is open any more."""
        bench.cut()
        life = bench.begin()
        bench.go(life, 8.0)
        for sensor in bench.line.sensors:
            sensor.faults.clear()
            power_cycle(sensor)
        until = bench.clock.now + SETTLED_WITHIN
        while bench.clock.now < until and (life.physical.open or bench.clock.now < until - SETTLED_WITHIN + 3):
            bench.turn(life)
        return life

    def judge(self, bench: Bench, life: Life, why: str) -> None:
        """Nobody is stranded, the configuration tells the truth, and the request and its repeat have one answer."""
        assert not life.physical.open, why
        rate = life.running.now.config.line.baudrate
        names = {slave.name: slave.id for slave in life.running.now.config.slaves}
        newcomers = [] if self.newcomer is None else [bench.line.sensors[2]]
        if newcomers and set(names) == {"s3", "s4"}:
            assert newcomers.pop().slave == 1, why  # the same request finds it
        first = dict(zip(("s3", "s4"), bench.line.sensors, strict=False))
        assert {name: (sensor.slave, sensor.format.baudrate) for name, sensor in first.items()} == {
            name: (names[name], rate) for name in first
        }, why
        for sensor in newcomers:
            assert (sensor.slave, sensor.format.baudrate) == (names["slave-2"], rate), why
        heard = len(bench.responses)
        assert heard <= 1, why
        life.request(self.name, id="c1", **self.parameters)
        for _ in range(LONGEST):
            if len(bench.responses) > heard:
                break
            bench.turn(life)
        answers = [{**response, "took_ms": 0} for response in bench.responses]
        assert len(answers) == heard + 1, why
        assert answers[0] == answers[-1], why


CASES = {
    "readdress": Case("device/readdress", {"device": "s3", "to": 9}),
    "readdress, power cycle": Case("device/readdress", {"device": "s3", "to": 9}, {3: "power_cycle"}),
    "baudrate": Case("line/baudrate", {"to": 19200}),
    "baudrate, canary": Case("line/baudrate", {"to": 19200}, {3: "power_cycle"}),
    "baudrate, rolled back": Case("line/baudrate", {"to": 19200}, {4: "power_cycle"}),
    "baudrate, power cycle": Case(
        "line/baudrate", {"to": 19200, "power_cycle": True}, {3: "power_cycle", 4: "power_cycle"}
    ),
    "adopt": Case("line/adopt", {}, newcomer=9600),
    "adopt, other rate": Case("line/adopt", {}, newcomer=19200),
}


def measured(bench: Bench, case: Case) -> tuple[int, int]:
    """Return how many exchanges and how many steps on the disk a change takes that nothing cuts short."""
    life = case.begin(bench)
    exchanges, steps = len(bench.line.log), bench.files.steps
    case.ask(bench, life)
    return len(bench.line.log) - exchanges, bench.files.steps - steps


@pytest.mark.parametrize("name", CASES)
def test_cut_at_every_exchange_nobody_is_stranded(bench: Bench, name: str) -> None:
    case = CASES[name]
    exchanges, _ = measured(bench, case)
    assert exchanges >= 10
    for last in range(1, exchanges + 1):
        life = case.begin(bench)
        heard: list[HeardRequest] = []

        def cut(request: HeardRequest, heard: list[HeardRequest] = heard, last: int = last) -> None:
            heard.append(request)
            if len(heard) == last:
                raise PowerCutError

        bench.line.after_each_request(cut)
        try:
            case.ask(bench, life)
        except PowerCutError:
            case.judge(bench, case.settle(bench), f"cut at exchange {last} of {exchanges}")
        else:
            assert last > exchanges - 3, "polls may fall otherwise by an exchange or two"


@pytest.mark.parametrize("surviving", ["nothing", "all"])
@pytest.mark.parametrize("name", CASES)
def test_cut_at_every_step_on_the_disk_nobody_is_stranded(bench: Bench, name: str, surviving: str) -> None:
    case = CASES[name]
    _, steps = measured(bench, case)
    assert steps >= 8, "an intent and an end"
    for last in range(steps):
        life = case.begin(bench)
        bench.files.steps_left = bench.files.steps + last
        with pytest.raises(PowerCutError):
            case.ask(bench, life)
        if surviving == "all":
            bench.cut(*bench.files.seen)
        case.judge(bench, case.settle(bench), f"cut at step {last} of {steps}")


@pytest.mark.parametrize("name", CASES)
def test_at_its_end_the_daemon_sends_no_new_frame_of_a_change_and_answers(bench: Bench, name: str) -> None:
    case = CASES[name]
    exchanges, _ = measured(bench, case)
    for last in range(1, exchanges):
        life = case.begin(bench)
        before = len(bench.line.log)
        life.request(case.name, id="c1", **case.parameters)
        while len(bench.line.log) - before < last and not bench.responses:
            bench.turn(life)
        life.end()
        (response,) = bench.responses
        assert response["error"] is None or response["error"]["code"] == "cancelled" or last > exchanges - 4
        sent = len(bench.line.log)
        bench.go(life, 8.0)
        rest = {(request.frame[0], request.frame[1:4]) for request in bench.line.log[sent + 1 :]}
        polls = {(slave, b"\x03\x00" + register) for slave in (3, 4) for register in (b"\x01", b"\x05")}
        assert rest <= polls, "polls and barriers alone"
        case.judge(bench, case.settle(bench), f"ended at exchange {last}")
