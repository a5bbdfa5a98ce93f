"""Three reads in a row that agree tell whether the adapter has an echo."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lfs10d.modbus.echo import AGREEING, Echo, EchoLearner


def learned(*seen: bool | None) -> Echo:
    learner = EchoLearner()
    for each in seen:
        learner.observed(each)
    return learner.state


@pytest.mark.parametrize(
    ("seen", "state"),
    [
        ((), Echo.UNKNOWN),
        ((True, True), Echo.UNKNOWN),
        ((True, True, True), Echo.ON),
        ((False, False, False), Echo.OFF),
        ((False, False, True, False, False), Echo.UNKNOWN),
        ((False, None, False, None, False), Echo.OFF),
        ((None,) * 9, Echo.UNKNOWN),
        ((True, True, True, False, False), Echo.ON),
        ((True, True, True, False, False, False), Echo.OFF),
    ],
)
def test_what_is_known_after_some_reads(seen: tuple[bool | None, ...], state: Echo) -> None:
    assert learned(*seen) is state


@given(st.lists(st.sampled_from([True, False, None]), max_size=20))
def test_it_is_known_only_after_three_that_agree(seen: list[bool | None]) -> None:
    told = [each for each in seen if each is not None]
    runs = [told[n : n + AGREEING] for n in range(len(told) - AGREEING + 1)]
    agreed = [run[0] for run in runs if len(set(run)) == 1]
    expected = Echo.UNKNOWN if not agreed else Echo.ON if agreed[-1] else Echo.OFF
    assert learned(*seen) is expected


@pytest.mark.parametrize(("setting", "state"), [("on", Echo.ON), ("off", Echo.OFF)])
def test_what_the_configuration_says_holds(setting: str, state: Echo) -> None:
    learner = EchoLearner("on" if setting == "on" else "off")
    for _ in range(5):
        learner.observed(state is not Echo.ON)
    learner.reopened()
    assert learner.state is state


def test_at_each_opening_of_the_port_it_is_learned_anew() -> None:
    learner = EchoLearner()
    for _ in range(AGREEING):
        learner.observed(True)  # noqa: FBT003 - an observation
    learner.reopened()
    assert learner.state is Echo.UNKNOWN
    learner.observed(True)  # noqa: FBT003 - an observation
    learner.observed(True)  # noqa: FBT003 - an observation
    assert learner.state is Echo.UNKNOWN


def test_only_what_was_observed_is_proved_not_what_is_configured() -> None:
    assert not EchoLearner("off").proved
    learner = EchoLearner()
    assert not learner.proved
    for _ in range(AGREEING):
        learner.observed(False)  # noqa: FBT003 - an observation
    assert learner.proved
