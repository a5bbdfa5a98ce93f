"""Whoever reads late, and whatever else answers: no number is published but the slave's own answer to that request.

The same lines are run every time, some 25 000 exchanges. With `LFS10D_EXAMPLES=1500` so many others are run of each
kind, each time others.
"""

from __future__ import annotations

import os
from random import SystemRandom

import pytest

from tests.support.late_readers import KINDS, Count, tell

SEARCHED = os.environ.get("LFS10D_EXAMPLES")
"""So many lines of each kind are searched for one that goes wrong; None: see above."""
LINES = int(SEARCHED or 12)
FIRST = SystemRandom().randrange(1 << 32) if SEARCHED else 0


@pytest.mark.parametrize("kind", KINDS)
def test_no_second_answer_is_published_as_good_however_late_it_is_read(kind: str) -> None:
    count = Count()
    for seed in range(FIRST, FIRST + LINES):
        tell(seed, kind, count)
    assert count.wrong == []
    assert count.gaps == 0
    assert count.good > 0.3 * count.readings


def test_no_poll_of_a_well_line_is_lost_by_it() -> None:
    count = Count()
    for seed in range(40):
        tell(seed, "none", count, share=0.0)
    assert count.codes.keys() == {"good"}
