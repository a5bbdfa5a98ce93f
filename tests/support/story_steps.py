"""What can happen in a story of a line (`tests/support/story.py`), for hypothesis to draw from."""

from __future__ import annotations

import os
from typing import Any

from hypothesis import HealthCheck, Phase, settings
from hypothesis import strategies as st

from tests.support.ails import NO_AIL, Ail
from tests.support.foreigners import FOREIGN

SEARCHED = os.environ.get("LFS10D_EXAMPLES")
"""So many stories are searched for one that fails; None: see above."""
AILMENTS: list[Ail] = [
    *[NO_AIL] * 4,
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
SPEAKING = [ail for ail in AILMENTS if ail[0] != "silent"]
FOLLOWS = st.sampled_from([0.005, 0.012, 0.02, 0.037, 0.05, 0.07, 0.1])
"""So long after an answer a second one comes, in s."""
ANSWERS_LATE = (0.02, 0.035, 0.052, 0.08, 0.115)
"""Turnarounds of a twin that answers 5 to 100 ms after a sensor that takes 5 ms, in s."""


def _follows(kind: str, rate: float) -> st.SearchStrategy[Ail]:
    return st.tuples(st.just(kind), st.fixed_dictionaries({"rate": st.just(rate), "delay": FOLLOWS}))


TWICE = st.one_of(st.just(NO_AIL), _follows("twin", 1.0), _follows("repeated", 1.0), _follows("repeated", 0.3))
"""A late twin or a repeater, or none."""
FIRST_REFUSED = st.one_of(
    st.just(NO_AIL),
    st.tuples(
        st.just("gateway"),
        st.fixed_dictionaries(
            {
                "rate": st.sampled_from([0.1, 0.3, 1.0]),
                "code": st.sampled_from([5, 10, 11]),
                "delay": st.sampled_from([0.01, 0.05, 0.1, 0.3, 0.6]),
            }
        ),
    ),
)
"""A gateway that refuses, and answers after that, or none."""
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


def plugs(*ails: st.SearchStrategy[Ail]) -> st.SearchStrategy[Any]:
    """Return strategies for a new sensor that is plugged in, with one of these ails or a usual one."""
    more = st.one_of(st.sampled_from(SPEAKING), *ails)
    return st.tuples(st.just("plug"), st.sampled_from([9600, 19200]), more, DONE)


PLUG = plugs()
BESIDES = st.one_of(TWICE, FIRST_REFUSED)


def aliens(ails: st.SearchStrategy[Ail]) -> st.SearchStrategy[Any]:
    """Return strategies for a device of another kind that is plugged in, with one of these ails."""
    more = st.tuples(st.sampled_from(FOREIGN), ails)
    return st.tuples(st.just("foreign"), st.sampled_from([9600, 19200]), more, DONE)


ALIEN = aliens(st.just(NO_AIL))
HAPPENINGS = st.one_of(
    st.tuples(st.just("power"), st.integers(0, 6), st.just(0), DONE),
    st.tuples(st.just("heal"), st.integers(0, 6), st.just(0), DONE),
    st.tuples(st.just("wait"), st.sampled_from([0.3, 2.0, 20.0]), st.just(0), DONE),
    st.tuples(st.just("unplug"), st.sampled_from([0.3, 2.0, 6.0]), st.just(0), DONE),
)
MASTER = st.tuples(
    st.just("master"),
    st.tuples(
        st.sampled_from([3, 3, 4, 9, 10, 1]),
        st.just(3),
        st.just(0),
        st.sampled_from([1, 5]),
        st.just(0),
        st.sampled_from([1, 2]),
    ),
    st.sampled_from([0.137, 0.25, 0.37, 1.0, 2.3]),
    DONE,
)
"""Another master comes at the line's rate (and the one before goes): what it asks, and how often."""
FREE = st.tuples(st.just("readdress"), NAMES, st.sampled_from([10, 200, 33]), ENDS)
"""To an id that mostly nobody has."""


def many(*others: st.SearchStrategy[Any]) -> st.SearchStrategy[list[Any]]:
    """Return strategies for stories that are requests in the main, most of them to free ids, and these things."""
    happening = HAPPENINGS.map(tuple)  # counts once
    each = st.one_of(FREE, FREE, FREE, READDRESS, BAUDRATE, BAUDRATE, ADOPT, ADOPT, happening, *others)
    return st.lists(each, min_size=2, max_size=6)


THREE = st.lists(st.sampled_from(AILMENTS), min_size=3, max_size=3)
CHECKS = settings(
    max_examples=int(SEARCHED or 40),
    derandomize=SEARCHED is None,
    database=None,
    phases=[Phase.generate, *([Phase.shrink] if SEARCHED else [])],
    deadline=None,
    suppress_health_check=list(HealthCheck),
)
