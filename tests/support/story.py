"""A story of a line: requests, faults, crashes and power cuts in any order, and what must hold after each of them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any

from lfs10d.simulator.sensor import Sensor
from lfs10d.simulator.wire import Format
from tests.support.ails import NO_AIL, Ail, ail, has_a_twin
from tests.support.faulty_sensors import power_cycle
from tests.support.foreigners import Foreigner, Stranger
from tests.support.happenings import happen
from tests.support.lives import Bench, Life
from tests.support.volatile_disk import PowerCutError

IDS = (3, 4, 5)
RATES = 9600 + 19200
LONGEST = 4000
"""Turns of 50 ms after which a request counts as never answered."""


@dataclass
class Asked:
    """One request, and how often its answer was heard before it was repeated."""

    name: str
    parameters: dict[str, Any]
    journalled: bool = False
    """Its intent was on the disk, or its life went on to the end: it has to be answered."""
    answers: list[dict[str, Any]] = field(default_factory=list)


class Story:
    """One run. `ails` are those of `s3`, `s4` and `s5`, of a twin of s3 and of a stranger at 9 if there are.

    `besides` are further ones of the three. `echo` and `latency` (s) are the adapter's.
    """

    def __init__(
        self,
        bench: Bench,
        ails: Sequence[Ail],
        *,
        besides: Sequence[Ail] = (NO_AIL,) * 3,
        twin: Ail | None = None,
        stranger: Ail | None = None,
        turnaround: float = 0.005,
        echo: bool = False,
        latency: float = 0.0,
    ) -> None:
        self.bench = bench
        self.life: Life = bench.sensors(*IDS, poll="{interval: 500ms}", echo=echo, latency=latency)
        self.by_name = {f"s{sensor.slave}": sensor for sensor in bench.line.sensors}
        self.others: list[Sensor] = []
        self.newcomers: list[Sensor] = []
        self.foreigners: list[Foreigner] = []
        self.asked: list[Asked] = []
        self.told: list[tuple[str, Any]] = []
        """Events of the lives that are over."""
        self.leave: Callable[[], None] = lambda: None
        """Ends the other master, if there is one."""
        self.twin: Sensor | None = None
        self.hushed = ails[0][0] == "silent"
        """Nobody can hear s3 beside its twin, for some time or ever: then the daemon may take the twin for it."""
        self.twin_missed = False
        """The twin was deaf when a request came: then nobody can know that it did not move with s3."""
        for sensor, one, other in zip(bench.line.sensors, ails, besides, strict=True):
            ail(sensor, one, other)
        for slave, its, kind in ((3, twin, Sensor), (9, stranger, Stranger)):
            if its is not None:
                added = bench.line.add(kind(slave, format=Format(9600), turnaround=turnaround))
                ail(added, its)
                self.others.append(added)
                self.twin = added if slave == 3 else self.twin
        self.reunited = False
        self.before = self.ids()
        bench.go(self.life, 3.0)

    # -- what happens

    def tell(self, steps: Iterable[tuple[str, Any, Any, tuple[str, int]]]) -> None:
        """Let things happen one after the other, mend all in the end, and judge."""
        for step in steps:
            self.step(*step)
        self.mend()
        self.settled()

    def step(self, what: str, one: Any, more: Any, end: tuple[str, int]) -> None:  # noqa: ANN401 - as it wants
        """Let one thing happen, and judge."""
        match what:
            case "readdress":
                self.ask("device/readdress", end, device=one, to=more)
            case "baudrate":
                self.ask("line/baudrate", end, to=RATES - self.rate, power_cycle=one)
            case "adopt":
                self.ask("line/adopt", end)
            case _:
                happen(self, what, one, more)
        self.check()

    def ask(self, name: str, end: tuple[str, int], **parameters: Any) -> Asked:  # noqa: ANN401 - any JSON
        """Send a request, and end the daemon as `end` says: at its answer, at a step on the disk, after some turns."""
        bench = self.bench
        asked = Asked(name, {"id": len(self.asked), **parameters})
        self.asked.append(asked)
        self.hushed |= self._is_deaf(self.by_name["s3"])  # its flash is not done yet
        self.twin_missed |= self.twin is not None and self._is_deaf(self.twin)
        pair = self._pair() if (name, parameters.get("device")) == ("device/readdress", "s3") else ()
        pair += tuple(each for each in self.sensors if each.faults and has_a_twin(each))
        together = [(each.slave, each.words[5]) for each in pair]
        how, after = end
        if how == "crash":
            bench.files.steps_left = bench.files.steps + after
        try:
            self.life.request(name, **asked.parameters)
            for _ in range(after if how in ("leave", "sigterm") else LONGEST):
                bench.turn(self.life)
                if self.answers_of(asked) or self._dead:
                    break
        except PowerCutError:  # the loop was told by the task that met it
            pass
        asked.journalled = any(change.asked and change.asked.id == asked.parameters["id"] for change in self._open)
        if how == "sigterm":
            self.life.end()
            assert self.answers_of(asked), "SIGTERM answers what is under way"
        assert [(each.slave, each.words[5]) for each in pair] == together, "of two sensors of one id none is moved"
        dead, bench.files.steps_left = self._dead, None
        if how in ("leave", "sigterm") or dead:
            self.restart()
        else:
            assert self.answers_of(asked), "a request is answered"
        return asked

    def _is_deaf(self, sensor: Sensor) -> bool:
        return sensor.deaf_until > self.bench.clock.now * 1e9

    def _pair(self) -> tuple[Sensor, ...]:
        """Return s3 and its twin where both can be heard at one id and rate, else nothing."""
        one = self.by_name["s3"]
        if self.twin is None or (one.slave, one.format) != (self.twin.slave, self.twin.format):
            return ()
        pair = (one, self.twin)
        mute = any(self._is_deaf(each) or any(fault.kind == "silent" for fault in each.faults) for each in pair)
        return () if mute else pair

    @property
    def _dead(self) -> bool:
        left = self.bench.files.steps_left
        return left is not None and self.bench.files.steps >= left

    @property
    def _open(self) -> Any:  # noqa: ANN401 - changes
        return self.life.physical.open

    def restart(self) -> None:
        """Cut the gateway's power and begin another life."""
        self.told += self.life.events
        self.bench.cut()
        self.life = self.bench.begin()
        self.bench.go(self.life, 1.0)

    def mend(self, seconds: float = 200.0) -> None:
        """Heal all, power them anew, take the others and the other master off; wait until nothing is open."""
        self.leave()
        self.powered()
        for sensor in self.sensors:
            sensor.faults.clear()
            power_cycle(sensor)
        if self.twin is not None and not self.twin_missed:
            known = {3, self.life.place("s3"), *self.life.physical.reserved()}
            assert self.twin.slave in known, "the twin of s3 is not lost either"
            assert self._at_rate("s3", self.twin)
        for other in (*self.others, *self.foreigners):
            self.bench.line.sensors.remove(other)
        self.restart()
        begun = self.bench.clock.now
        while self.bench.clock.now < begun + (seconds if self._open else 5.0):
            self.bench.turn(self.life)

    def powered(self) -> None:
        """Note whether s3 and its twin may meet again at a power cycle, before the daemon had the time to part them."""
        self.reunited |= any("s3" in change.devices and not change.answered for change in self._open)

    # -- what must hold

    @property
    def sensors(self) -> list[Sensor]:
        """Everybody on the line."""
        return [*self.by_name.values(), *self.others, *self.newcomers]

    @property
    def rate(self) -> int:
        """The line's."""
        return self.life.running.now.config.line.baudrate

    def ids(self) -> dict[int, int]:
        """Return the slave id of everybody."""
        return {id(sensor): sensor.slave for sensor in self.sensors}

    def answers_of(self, asked: Asked) -> list[dict[str, Any]]:
        """Return every response to a request so far."""
        key = asked.parameters["id"]
        return [each for each in self.bench.responses if (each["request"], each["id"]) == (asked.name, key)]

    def check(self) -> None:
        """Judge: ids, places, rates and responses."""
        self._apart()
        for name, sensor in self.by_name.items():
            self._known(name, sensor)
        assert not any(each.written for each in self.foreigners), "nothing is written to another kind of device"
        assert not any(each.written for each in self.others if isinstance(each, Stranger)), "nor to a stranger"
        for asked in self.asked:
            assert len(self.answers_of(asked)) <= 1, "no request is answered twice"

    def _apart(self) -> None:
        """Nobody who had another id than somebody else has the same now."""
        now = self.ids()
        for one, its in now.items():
            for other, others in now.items():
                unknown = self.reunited or self.hushed
                together = unknown and self.twin and {one, other} == {id(self.by_name["s3"]), id(self.twin)}
                if one < other and its == others and not together:
                    assert self.before[one] == self.before[other], "two sensors that had different ids share one"
        self.before = now

    def _known(self, name: str, sensor: Sensor) -> None:
        """Judge that a configured sensor is where the daemon has it, or where it says it may be."""
        place, reserved = self.life.place(name), set(self.life.physical.reserved())
        where = f"{name} is at {sensor.slave}, {sensor.format.baudrate}; configured at {place}, reserved {reserved}"
        excused = self.twin is not None and name == "s3" and self._beside(sensor, self.twin)
        assert self._placed(name, sensor) or excused, where

    def _placed(self, name: str, sensor: Sensor) -> bool:
        place, reserved = self.life.place(name), set(self.life.physical.reserved())
        return self._at_rate(name, sensor) and (sensor.slave == place or {sensor.slave, place} <= reserved)

    def _at_rate(self, name: str, sensor: Sensor) -> bool:
        opened = any(name in change.devices for change in self._open if change.kind == "baudrate")
        return opened or sensor.format.baudrate == self.rate

    def _beside(self, sensor: Sensor, twin: Sensor) -> bool:
        """Whether s3 is where it was told that two are, or keeps silent while its twin answers for it."""
        slaves = {facts["slave"] for kind, facts in (*self.told, *self.life.events) if kind == "duplicate_id"}
        told = sensor.slave in slaves and self._at_rate("s3", sensor)
        return told or (self.hushed and self._placed("s3", twin))

    def settled(self) -> None:
        """Judge the end: all are found, every request has its answer, and its repeat gets the same."""
        self.check()
        for name, sensor in self.by_name.items():
            if not (self.twin is not None and name == "s3"):
                assert sensor.slave == self.life.place(name), "healed and powered anew, it is found"
                assert sensor.format.baudrate == self.rate
        assert not [change for change in self._open if not change.answered], "every request has its answer"
        for asked in self.asked:
            self._repeated(asked)

    def newcomers_known(self) -> None:
        """Judge that each newcomer is polled, or still at the factory's id, where it can be adopted."""
        errors = [response["error"] for response in self.bench.responses if response["request"] == "line/adopt"]
        if any(error and error["code"] == "duplicate_id" for error in errors):
            return  # two were plugged in at once: that was told, and a person must part them
        places = {slave.id for slave in self.life.running.now.config.slaves}
        for newcomer in self.newcomers:
            polled = newcomer.slave in places and newcomer.format.baudrate == self.rate
            assert newcomer.slave == 1 or polled, f"a newcomer is at {newcomer.slave}, {newcomer.format.baudrate}"

    def _repeated(self, asked: Asked) -> None:
        """Judge that a request that was answered, or may have written, is answered alike and not carried out twice."""
        heard, first = len(self.bench.responses), self.answers_of(asked)
        if not first and not asked.journalled:
            return  # it died with its life before anything was written
        if first and self._forgotten(asked, first[0]):
            return
        writes = self._writes()
        self.life.request(asked.name, **asked.parameters)
        self.bench.turn(self.life)
        (again,) = self.bench.responses[heard:]
        assert self._writes() == writes
        if first:
            assert {**again, "took_ms": 0} == {**first[0], "took_ms": 0}

    def _forgotten(self, asked: Asked, answer: dict[str, Any]) -> bool:
        """Whether the answer to a request that wrote nothing was lost in a power cut.

        It is on the disk some seconds later only (a flood of refused requests must not wear it out); asked again,
        the request is judged anew.
        """
        keys = {told.asked.id for told in self.life.physical.journal.answers}
        return answer["status"] != "failed" and not asked.journalled and asked.parameters["id"] not in keys

    def _writes(self) -> int:
        return sum(request.body[1:2] == b"\x06" for request in self.bench.line.log)
