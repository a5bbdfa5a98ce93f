"""What test_laws.py says holds, too, where more answers come than one, late or to somebody else.

A late twin, a repeater, a gateway that refuses before it answers, another master: each kind of story has one of them,
the last has all.
"""

from __future__ import annotations

from typing import Any

from hypothesis import given
from hypothesis import strategies as st

from tests.support.ails import Ail
from tests.support.lives import Bench
from tests.support.story import Story
from tests.support.story_steps import (
    ALIEN,
    ANSWERS_LATE,
    BESIDES,
    CHECKS,
    FIRST_REFUSED,
    MASTER,
    PLUG,
    SPEAKING,
    THREE,
    TWICE,
    aliens,
    many,
    plugs,
)

TWINS = st.one_of(st.none(), st.sampled_from(SPEAKING))


def three(besides: st.SearchStrategy[Any]) -> st.SearchStrategy[list[Any]]:
    return st.lists(besides, min_size=3, max_size=3)


@given(
    THREE,
    three(TWICE),
    TWINS,
    st.sampled_from(ANSWERS_LATE),
    many(plugs(TWICE), plugs(TWICE), aliens(TWICE)),
)
@CHECKS
def test_nobody_is_stranded_where_a_twin_answers_late_or_answers_are_repeated(
    bench: Bench, ails: list[Any], besides: list[Any], twin: Ail | None, turnaround: float, steps: list[Any]
) -> None:
    bench.renew()
    Story(bench, ails, besides=besides, twin=twin, turnaround=turnaround).tell(steps)


@given(
    THREE,
    three(FIRST_REFUSED),
    many(plugs(FIRST_REFUSED), plugs(FIRST_REFUSED), aliens(FIRST_REFUSED)),
)
@CHECKS
def test_nobody_is_stranded_where_a_gateway_refuses_before_it_answers(
    bench: Bench, ails: list[Any], besides: list[Any], steps: list[Any]
) -> None:
    bench.renew()
    story = Story(bench, ails, besides=besides)
    story.tell(steps)
    story.newcomers_known()


@given(
    THREE,
    MASTER,
    many(MASTER, PLUG, PLUG, ALIEN),
)
@CHECKS
def test_nobody_is_stranded_where_another_master_speaks(
    bench: Bench, ails: list[Any], master: tuple[Any, ...], steps: list[Any]
) -> None:
    bench.renew()
    story = Story(bench, ails)
    story.tell([master, *steps])
    story.newcomers_known()


@given(
    THREE,
    three(BESIDES),
    st.tuples(st.one_of(TWINS, BESIDES), st.one_of(TWINS, BESIDES)),
    st.sampled_from(ANSWERS_LATE),
    st.tuples(st.booleans(), st.sampled_from([0.0, 0.0, 0.004, 0.016])),
    many(MASTER, plugs(BESIDES), plugs(BESIDES), aliens(BESIDES)),
)
@CHECKS
def test_nobody_is_stranded_by_any_mix_of_second_answers(
    bench: Bench,
    ails: list[Any],
    besides: list[Any],
    others: tuple[Any, Any],
    turnaround: float,
    adapter: tuple[bool, float],
    steps: list[Any],
) -> None:
    bench.renew()
    echo, latency = adapter
    Story(
        bench,
        ails,
        besides=besides,
        twin=others[0],
        stranger=others[1],
        turnaround=turnaround,
        echo=echo,
        latency=latency,
    ).tell(steps)
