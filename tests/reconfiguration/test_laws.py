"""What holds whatever the sensors are like, whoever dies when: nobody is stranded, no id is shared, all is answered.

Nor is anything written to a device of another kind at the factory's id, and of two sensors of one id that can both be
heard none is moved.

The same 40 stories of each kind are told every time. With `LFS10D_EXAMPLES=1000` so many are told of each, others
each time, and one that fails is made shorter. Those that once failed are in test_laws_regressions.py.
"""

from __future__ import annotations

import os
from typing import Any

from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st

from tests.support.lives import Bench
from tests.support.story import FOREIGN, Story

SEARCHED = os.environ.get("LFS10D_EXAMPLES")
"""So many stories are searched for one that fails; None: see above."""
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
    ("silent", {"first": 4.0, "last": 9.0}),
    ("silent", {"first": 8.0}),
    ("exception", {"code": 4}),
    ("late", {"delay": 0.35}),
    ("late", {"delay": 0.75}),
]
SPEAKING = [sensor_fault for sensor_fault in AILMENTS if sensor_fault[0] != "silent"]
ENDS = st.one_of(
    st.just(("finish", 0)),
    st.just(("finish", 0)),
    st.tuples(st.just("crash"), st.integers(0, 18)),
    st.tuples(st.just("leave"), st.integers(1, 400)),
    st.tuples(st.just("sigterm"), st.integers(1, 260)),
)
DONE = st.just(("finish", 0))
NAMES = st.sampled_from(["s3", "s3", "s4", "s5"])
TARGETS = st.sampled_from([3, 4, 5, 9, 10, 200])
READDRESS = st.tuples(st.just("readdress"), NAMES, TARGETS, ENDS)
BAUDRATE = st.tuples(st.just("baudrate"), st.booleans(), st.just(0), ENDS)
ADOPT = st.tuples(st.just("adopt"), st.just(0), st.just(0), ENDS)
PLUG = st.tuples(st.just("plug"), st.sampled_from([9600, 19200]), st.sampled_from(SPEAKING), DONE)
ALIEN = st.tuples(st.just("foreign"), st.sampled_from([9600, 19200]), st.sampled_from(FOREIGN), DONE)
HAPPENINGS = st.one_of(
    st.tuples(st.just("power"), st.integers(0, 6), st.just(0), DONE),
    st.tuples(st.just("heal"), st.integers(0, 6), st.just(0), DONE),
    st.tuples(st.just("wait"), st.sampled_from([0.3, 2.0, 20.0]), st.just(0), DONE),
    st.tuples(st.just("unplug"), st.sampled_from([0.3, 2.0, 6.0]), st.just(0), DONE),
)
THREE = st.lists(st.sampled_from(AILMENTS), min_size=3, max_size=3)
CHECKS = settings(
    max_examples=int(SEARCHED or 40),
    derandomize=SEARCHED is None,
    database=None,
    phases=[Phase.generate, *([Phase.shrink] if SEARCHED else [])],
    deadline=None,
    suppress_health_check=list(HealthCheck),
)


@given(THREE, st.lists(st.one_of(READDRESS, READDRESS, HAPPENINGS), min_size=1, max_size=6))
@CHECKS
def test_no_sensor_is_stranded_by_new_ids(bench: Bench, ails: list[Any], steps: list[Any]) -> None:
    bench.renew()
    Story(bench, ails).tell(steps)


@given(THREE, st.lists(st.one_of(BAUDRATE, BAUDRATE, HAPPENINGS), min_size=1, max_size=4))
@CHECKS
def test_no_sensor_is_stranded_by_another_rate(bench: Bench, ails: list[Any], steps: list[Any]) -> None:
    bench.renew()
    Story(bench, ails).tell(steps)


@given(THREE, st.lists(st.one_of(READDRESS, BAUDRATE, PLUG, ALIEN, ADOPT, HAPPENINGS), min_size=2, max_size=7))
@CHECKS
def test_no_sensor_is_stranded_by_any_mix_of_changes(bench: Bench, ails: list[Any], steps: list[Any]) -> None:
    bench.renew()
    story = Story(bench, ails)
    story.tell(steps)
    story.newcomers_known()


@given(
    THREE,
    st.tuples(st.sampled_from([None, *SPEAKING]), st.sampled_from([None, *SPEAKING])),
    st.sampled_from([0.005, 0.0055, 0.009, 0.04]),
    st.lists(st.one_of(READDRESS, READDRESS, BAUDRATE, PLUG, ALIEN, ADOPT, HAPPENINGS), min_size=1, max_size=5),
)
@CHECKS
def test_duplicates_are_told_and_nobody_is_stranded(
    bench: Bench, ails: list[Any], others: tuple[Any, Any], turnaround: float, steps: list[Any]
) -> None:
    bench.renew()
    Story(bench, ails, twin=others[0], stranger=others[1], turnaround=turnaround).tell(steps)
