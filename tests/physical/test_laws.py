"""What holds whatever the sensors are like, whoever dies when: nobody is stranded, no id is shared, all is answered."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from lfs10d.commands import Call
from lfs10d.forgetful import PowerCutError

if TYPE_CHECKING:
    import asyncio

    from tests.physical.conftest import Bench

IDS = (3, 4, 5)
AILMENTS: list[tuple[str, dict[str, Any]]] = [
    ("none", {}),
    ("none", {}),
    ("none", {}),
    ("none", {}),
    ("dip_locked", {"answer": "echo", "reads": "old"}),
    ("dip_locked", {"answer": "echo", "reads": "new"}),
    ("dip_locked", {"answer": "exception", "reads": "old", "code": 3}),
    ("dip_locked", {"answer": "exception", "reads": "new", "code": 3}),
    ("stores_but_ignores", {}),
    ("power_cycle", {}),
    ("at_once", {}),
    ("slow_flash", {"delay": 1.0}),
    ("slow_flash", {"delay": 5.0}),
    ("echo_losing", {}),
    ("silent", {}),
    ("exception", {"code": 4}),
    ("late", {"delay": 0.35}),
    ("late", {"delay": 0.75}),
]
STEPS = st.one_of(
    st.tuples(st.just("ask"), st.sampled_from(IDS), st.sampled_from([3, 4, 5, 9, 10, 200])),
    st.tuples(st.just("ask then crash"), st.sampled_from(IDS), st.tuples(st.sampled_from([9, 10]), st.integers(0, 18))),
    st.tuples(
        st.just("ask then leave"), st.sampled_from(IDS), st.tuples(st.sampled_from([9, 10]), st.integers(1, 260))
    ),
    st.tuples(st.just("sensor power"), st.sampled_from(IDS), st.just(0)),
    st.tuples(st.just("heal"), st.sampled_from(IDS), st.just(0)),
    st.tuples(st.just("wait"), st.just(0), st.integers(1, 200)),
    st.tuples(st.just("unplug"), st.just(0), st.integers(1, 60)),
)


class Story:
    """One run: sensors by their first id, the lives that follow one another, what was asked."""

    def __init__(self, bench: Bench, ailments: list[tuple[str, dict[str, Any]]]) -> None:
        self.bench = bench
        self.life = bench.sensors(*IDS, poll="{interval: 500ms}")
        self.by_name = {f"s{sensor.slave}": sensor for sensor in bench.line.sensors}
        for sensor, (kind, particulars) in zip(bench.line.sensors, ailments, strict=True):
            if kind != "none":
                sensor.ail(kind, **particulars)
        bench.go(self.life, 3.0)

    def step(self, what: str, slave: int, more: Any) -> None:  # noqa: ANN401 - as the step wants
        bench, name = self.bench, f"s{slave}"
        match what:
            case "ask":
                bench.readdress(self.life, name, more)
            case "ask then crash":
                to, steps = more
                self._crash(name, to, steps)
            case "ask then leave":
                to, turns = more
                self._begin(name, to)
                for _ in range(turns):
                    bench.turn(self.life)
                self._restart()
            case "sensor power":
                self.by_name[name].power_cycle()
            case "heal":
                self.by_name[name].heal()
            case "wait":
                bench.go(self.life, more * 0.1)
            case _:
                bench.port.unplug()
                bench.go(self.life, more * 0.1)
                bench.port.replug()
                bench.go(self.life, 3.0)
        self.check()

    def _begin(self, name: str, to: int) -> asyncio.Task[Any]:
        request = self.life.physical.readdress(name, to, dry_run=False, call=Call("x", fingerprint=str(to)))
        return self.bench.loop.create_task(request)

    def _crash(self, name: str, to: int, steps: int) -> None:
        """Die at this step on the disk of the request, if it gets so far."""
        bench = self.bench
        task = self._begin(name, to)
        bench.files.steps_left = bench.files.steps + steps
        for _ in range(800):
            bench.turn(self.life)
            if task.done():
                break
        if task.done() and isinstance(task.exception(), PowerCutError):
            self._restart()
        bench.files.steps_left = None

    def _restart(self) -> None:
        self.bench.cut()
        self.life = self.bench.begin()
        self.bench.go(self.life, 1.0)

    def check(self) -> None:
        """No two sensors have one id, and each is where the daemon has it, or where it says it may be."""
        ids = [sensor.slave for sensor in self.by_name.values()]
        assert len(set(ids)) == len(ids)
        for name, sensor in self.by_name.items():
            place = self.life.place(name)
            assert sensor.slave == place or {sensor.slave, place} <= set(self.life.physical.reserved())


@given(st.lists(st.sampled_from(AILMENTS), min_size=3, max_size=3), st.lists(STEPS, min_size=1, max_size=6))
@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_no_sensor_is_stranded_whatever_happens(
    bench: Bench, ailments: list[tuple[str, dict[str, Any]]], steps: list[tuple[str, int, Any]]
) -> None:
    bench.renew()
    story = Story(bench, ailments)
    for step in steps:
        story.step(*step)
    for sensor in story.by_name.values():
        sensor.heal()
        sensor.power_cycle()
    story._restart()
    bench.go(story.life, 60.0)
    story.check()
    for name, sensor in story.by_name.items():
        assert story.life.place(name) == sensor.slave, "healed and powered anew, it is found"
    assert not [change for change in story.life.physical.open if not change.answered], "every request has its answer"
