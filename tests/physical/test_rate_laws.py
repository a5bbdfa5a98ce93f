"""What holds of every change of rate, whatever the sensors are like and whoever dies when: nobody is stranded."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from lfs10d.commands import Call
from lfs10d.forgetful import PowerCutError

if TYPE_CHECKING:
    from tests.physical.conftest import Bench, Life

IDS = (3, 4, 5)
AILMENTS: list[tuple[str, dict[str, Any]]] = [
    ("none", {}),
    ("none", {}),
    ("none", {}),
    ("at_once", {}),
    ("echo_losing", {}),
    ("power_cycle", {}),
    ("stores_but_ignores", {}),
    ("slow_flash", {"delay": 5.0}),
    ("late", {"delay": 0.35}),
    ("silent", {"first": 4.0, "last": 9.0}),
    ("silent", {"first": 8.0}),
]
STEPS = st.one_of(
    st.tuples(st.just("ask"), st.booleans(), st.just(0)),
    st.tuples(st.just("crash"), st.booleans(), st.integers(0, 18)),
    st.tuples(st.just("leave"), st.booleans(), st.integers(1, 400)),
    st.tuples(st.just("power"), st.booleans(), st.sampled_from(range(3))),
    st.tuples(st.just("wait"), st.booleans(), st.integers(1, 30)),
)


class Story:
    """One run; each request asks for the rate that the line has not."""

    def __init__(self, bench: Bench, ailments: list[tuple[str, dict[str, Any]]]) -> None:
        self.bench = bench
        self.life = bench.sensors(*IDS, poll="{interval: 500ms}")
        for sensor, (kind, particulars) in zip(bench.line.sensors, ailments, strict=True):
            if kind != "none":
                sensor.ail(kind, **particulars)
        bench.go(self.life, 3.0)

    def step(self, what: str, power_cycle: bool, more: int) -> None:  # noqa: FBT001 - as drawn
        bench = self.bench
        if what == "wait":
            bench.go(self.life, float(more))
        elif what == "power":
            bench.line.sensors[more].power_cycle()
        else:
            to = 28800 - self.life.running.now.config.line.baudrate
            request = self.life.physical.baudrate(to, power_cycle=power_cycle, dry_run=False, call=Call("r"))
            task = bench.loop.create_task(request)
            if what == "crash":
                bench.files.steps_left = bench.files.steps + more
            for _ in range(more if what == "leave" else 6000):
                bench.turn(self.life)
                if task.done():
                    break
            if what == "leave" or isinstance(task.exception(), PowerCutError):
                self.restart()
            bench.files.steps_left = None
        self.check()

    def restart(self) -> None:
        self.bench.cut()
        self.life = self.bench.begin()
        self.bench.go(self.life, 1.0)

    def check(self) -> None:
        """Each sensor is at the line's rate, or an open change says where it may be."""
        rate = self.life.running.now.config.line.baudrate
        for sensor in self.bench.line.sensors:
            assert sensor.format.baudrate == rate or sensor.slave in self.life.physical.reserved()


def fresh(bench: Bench, life: Life) -> set[str]:
    before = len(life.readings)
    bench.go(life, 40.0)
    return {reading.device for reading in life.readings[before:] if reading.values}


@given(st.lists(st.sampled_from(AILMENTS), min_size=3, max_size=3), st.lists(STEPS, min_size=1, max_size=4))
@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_no_sensor_is_stranded_whatever_happens(
    bench: Bench, ailments: list[tuple[str, dict[str, Any]]], steps: list[tuple[str, bool, int]]
) -> None:
    bench.renew()
    story = Story(bench, ailments)
    for step in steps:
        story.step(*step)
    for sensor in bench.line.sensors:
        sensor.heal()
        sensor.power_cycle()
    story.restart()
    bench.go(story.life, 200.0)
    story.check()
    assert not story.life.physical.open, "healed and powered anew, all are found"
    assert fresh(bench, story.life) == {"s3", "s4", "s5"}
