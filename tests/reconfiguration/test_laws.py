"""What holds whatever the sensors are like, whoever dies when: nobody is stranded, no id is shared, all is answered.

Nor is anything written to a device of another kind at the factory's id, and of two sensors of one id that can both be
heard none is moved.

The same 40 stories of each kind are told every time. With `LFS10D_EXAMPLES=1000` so many are told of each, others
each time, and one that fails is made shorter. Those that once failed are in test_laws_regressions.py.
"""

from __future__ import annotations

from typing import Any

from hypothesis import given
from hypothesis import strategies as st

from tests.support.lives import Bench
from tests.support.story import Story
from tests.support.story_steps import (
    ADOPT,
    ALIEN,
    BAUDRATE,
    CHECKS,
    HAPPENINGS,
    PLUG,
    READDRESS,
    SPEAKING,
    THREE,
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
