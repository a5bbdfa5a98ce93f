"""What a slave's silence teaches about the rest it needs, and about its sleep."""

from __future__ import annotations

from collections.abc import Iterable
from math import inf

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lfs10d.line.request_gap import AWAKE, HELPED, LONG_PAUSE, STEPS, RequestGap


class Line:
    """A slave that answers, or not, after pauses told in s; an exchange takes 20 ms."""

    def __init__(self, configured: float = 0.0) -> None:
        self.gap = RequestGap(configured)
        self.now = 0.0

    def ask(self, after: float, answer: str = "a") -> bool:
        """`answer`: `a` an answer, `s` silence, `n` noise. Return whether the gap was widened."""
        began = self.now = self.now + after
        self.now += 0.02
        return self.gap.exchanged(began, self.now, spoke=answer == "a", silent=answer == "s")

    def pair(self, apart: float, answer: str = "s") -> bool:
        """Have a request answered, well rested, and one right behind it met by `answer`."""
        self.ask(5.0)
        return self.ask(apart, answer)


@pytest.mark.parametrize(
    ("apart", "learned"), [(0.004, 0.1), (0.099, 0.1), (0.101, 0.2), (0.25, 0.4), (0.7, 0.8), (0.9, 1.0)]
)
def test_two_requests_ignored_right_behind_an_answer_give_the_next_longer_gap(apart: float, learned: float) -> None:
    line = Line()
    assert not line.pair(apart)
    assert line.gap.seconds == 0
    assert line.pair(apart)
    assert line.gap.seconds == line.gap.learned == learned


def test_the_gap_doubles_at_each_further_silence_until_it_answers() -> None:
    line = Line()
    line.pair(0.004)
    line.pair(0.004)
    gaps = [line.gap.learned]
    for _ in STEPS[1:]:
        assert line.pair(line.gap.learned)
        gaps.append(line.gap.learned)
    assert gaps == list(STEPS)


def test_once_it_answered_right_behind_two_more_silences_are_needed() -> None:
    line = Line()
    line.pair(0.004)
    line.pair(0.004)
    line.pair(0.11, "a")
    assert not line.pair(0.05)
    assert line.pair(0.05)
    assert line.gap.learned == 0.2


def test_where_the_longest_gap_does_not_help_none_is_kept_nor_tried_again() -> None:
    line = Line()
    for _ in range(len(STEPS) + 1):
        line.pair(max(0.004, line.gap.learned))
    assert line.gap.learned == STEPS[-1]
    assert not line.pair(1.0)
    assert line.gap.seconds == 0
    assert not any(line.pair(0.004) for _ in range(9))


def test_who_answered_as_close_before_needs_no_rest() -> None:
    line = Line()
    line.pair(0.005, "a")
    assert not any(line.pair(apart) for apart in (0.004, 0.0036, 0.9) * 9)
    line.gap.offline()  # another sensor may be in its place
    assert [line.pair(0.004), line.pair(0.004)] == [False, True]


def test_an_answer_right_behind_another_ends_the_count() -> None:
    line = Line()
    line.pair(0.004)
    line.pair(0.09, "a")
    assert not line.pair(0.004)
    assert line.pair(0.004)


@pytest.mark.parametrize("answers", ["sss", "nsn", "asn", "nas"])
def test_silence_behind_silence_noise_and_what_comes_long_after_teach_nothing(answers: str) -> None:
    line = Line()
    assert not any(line.ask(1.5, answer) for answer in answers * 5)
    assert line.gap.seconds == 0


def test_noise_behind_an_answer_teaches_nothing() -> None:
    line = Line()
    assert not any(line.pair(0.004, "n") for _ in range(5))


def test_a_late_answer_shows_that_it_was_slow_not_silent() -> None:
    line = Line()
    line.pair(0.004)
    line.gap.late()
    assert not line.pair(0.004)
    assert line.pair(0.004)
    line.gap.late()
    assert line.gap.seconds == 0


def test_the_configured_rest_holds_where_it_is_longer_and_is_widened_from_there() -> None:
    line = Line(0.3)
    assert line.gap.seconds == 0.3
    line.pair(0.3)
    assert line.pair(0.3)
    assert (line.gap.learned, line.gap.seconds) == (0.4, 0.4)
    line = Line(2.0)
    assert not any(line.pair(0.5) for _ in range(5))
    assert line.gap.seconds == 2.0


@given(st.lists(st.tuples(st.sampled_from((0.004, 0.05, 0.3, 0.97, 3.0)), st.floats(0, 1)), max_size=300))
def test_a_slave_that_needs_no_rest_and_loses_answers_by_chance_is_given_none(
    exchanges: Iterable[tuple[float, float]],
) -> None:
    """Once it has answered right behind an answer; nothing is known of it before."""
    line = Line()
    line.pair(0.004, "a")
    for after, chance in exchanges:
        assert not line.ask(after, "s" if chance < 0.3 else "a")


@given(st.floats(0.05, 0.8), st.lists(st.floats(0.004, 1.2), min_size=40, max_size=80))
def test_a_slave_that_needs_rest_is_given_no_more_than_the_next_step_above_it(
    rest: float, pauses: Iterable[float]
) -> None:
    line = Line()
    for pause in pauses:
        line.ask(5.0)
        after = max(pause, line.gap.seconds)
        line.ask(after, "s" if after < rest else "a")
    assert line.gap.learned in (0.0, *(step for step in STEPS if step < 2 * rest or step == 0.1))


def test_one_that_loses_the_first_request_after_a_pause_sleeps_once_asking_again_helped_twice() -> None:
    line = Line()
    line.ask(5.0)
    sleeping = []
    for _ in range(HELPED + 1):
        line.ask(0.9, "s")
        line.ask(0.01)
        sleeping.append((line.gap.may_sleep(line.now + 0.5), line.gap.may_sleep(line.now + 1.0), line.gap.sleeps))
    assert sleeping == [(False, True, False), (False, True, True), (False, True, True)]
    assert line.gap.seconds == 0


def test_a_pause_longer_than_known_counts_as_a_second() -> None:
    line = Line()
    line.ask(inf, "s")
    line.now = 10.0
    line.gap = RequestGap()
    line.ask(0.0, "s")
    line.ask(0.01)
    assert line.gap.may_sleep(line.now + LONG_PAUSE)
    assert not line.gap.may_sleep(line.now + 0.5)


def test_one_that_answers_first_requests_again_is_awake() -> None:
    line = Line()
    for _ in range(HELPED):
        line.ask(2.0, "s")
        line.ask(0.01)
    for count in range(AWAKE):
        assert line.gap.sleeps, count
        line.ask(2.0)
    assert not line.gap.may_sleep(line.now + 100.0)


def test_one_lost_request_is_no_sleep_once_the_next_first_one_is_answered() -> None:
    line = Line()
    line.ask(2.0, "s")
    line.ask(0.01)
    assert line.gap.may_sleep(line.now + 2.0)
    line.ask(2.0)
    assert not line.gap.may_sleep(line.now + 2.0)


def test_one_that_stays_silent_does_not_sleep() -> None:
    line = Line()
    for _ in range(5):
        line.ask(2.0, "s")
        line.ask(0.01, "s")
    line.ask(2.0)
    assert not line.gap.may_sleep(line.now + 2.0)


def test_an_answer_long_after_the_lost_request_does_not_show_that_asking_again_helps() -> None:
    line = Line()
    line.ask(0.5)
    for _ in range(3):
        line.ask(0.3, "s")
        line.ask(2.0)
    assert not line.gap.may_sleep(line.now + 1.0)


def test_sleep_is_not_taken_for_a_want_of_rest() -> None:
    line = Line()
    line.ask(5.0)
    for _ in range(5):
        assert not line.ask(0.9, "s")
        line.ask(0.01)
    line.gap.late()
    assert line.gap.sleeps
