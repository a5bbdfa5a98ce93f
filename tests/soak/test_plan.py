"""Laws of every plan, whatever the seed."""

from __future__ import annotations

from itertools import pairwise

from hypothesis import given
from hypothesis import strategies as st

from soak.plan import CALM_BEFORE_KILL, ENDS_THE_DAEMON, LASTS, Act, Kind, Step, shortest_life, steps

SEEDS = st.integers(0, 1 << 32)
LENGTHS = st.sampled_from([10.0, 20.0, 60.0, 300.0, 3600.0, 7200.0])

EAR_BACK_WITHIN = 10.0


def acts(plan: list[Step]) -> list[tuple[float, Act]]:
    return [(due.at, due.act) for step in plan for due in step.acts()]


@given(SEEDS, LENGTHS)
def test_the_same_seed_is_the_same_plan(seed: int, seconds: float) -> None:
    assert list(steps(seed, seconds)) == list(steps(seed, seconds))


@given(SEEDS, LENGTHS)
def test_acts_come_in_order_and_are_over_in_time(seed: int, seconds: float) -> None:
    times = [at for at, _ in acts(list(steps(seed, seconds)))]
    assert times == sorted(times)
    assert all(0 < at <= seconds for at in times)


@given(SEEDS, LENGTHS)
def test_what_goes_comes_back_before_it_goes_again(seed: int, seconds: float) -> None:
    pairs = {
        Act.BROKER_START: {Act.BROKER_KILL, Act.BROKER_END},
        Act.BROKER_GO_ON: {Act.BROKER_STOP},
        Act.EAR_BACK: {Act.EAR_AWAY},
        Act.PORT_BACK: {Act.PORT_PULL},
        Act.DAEMON_START: {Act.DAEMON_KILL, Act.DAEMON_END},
    }
    happened = [act for _, act in acts(list(steps(seed, seconds)))]
    for back, away in pairs.items():
        turns = [act in away for act in happened if act is back or act in away]
        assert turns == [n % 2 == 0 for n in range(len(turns))]
        assert len(turns) % 2 == 0


@given(SEEDS, LENGTHS)
def test_the_subscriber_is_back_within_10_s_of_the_broker(seed: int, seconds: float) -> None:
    happened = acts(list(steps(seed, seconds)))
    for (away, act), (back, _) in pairwise([one for one in happened if one[1] in (Act.EAR_AWAY, Act.EAR_BACK)]):
        if act is Act.EAR_AWAY and back - away > EAR_BACK_WITHIN:
            lost = {Act.BROKER_KILL, Act.BROKER_END, Act.BROKER_START}
            assert not [each for at, each in happened if away - 1 < at < back and each in lost]


@given(SEEDS, LENGTHS)
def test_the_daemon_is_killed_in_calm_or_with_the_subscriber_there(seed: int, seconds: float) -> None:
    plan = list(steps(seed, seconds))
    for before, step in pairwise(plan):
        if step.kind is Kind.DAEMON_KILLED:
            assert step.at - before.ends >= CALM_BEFORE_KILL
        if step.kind in ENDS_THE_DAEMON:
            assert not step.within


@given(SEEDS, LENGTHS)
def test_the_daemon_lives_long_enough_to_be_judged(seed: int, seconds: float) -> None:
    ends = [step.at for step in steps(seed, seconds) if step.kind in ENDS_THE_DAEMON]
    assert all(later - earlier >= shortest_life(seconds) for earlier, later in pairwise(ends))


def test_every_kind_of_disturbance_comes_in_an_hour() -> None:
    assert {step.kind for step in steps(1, 3600.0)} == set(Kind)


def test_a_month_is_planned_too() -> None:
    plan = list(steps(1, 30 * 86400.0))
    assert len(plan) > 20_000
    assert max(step.lasts for step in plan if step.kind is Kind.BROKER_AWAY) > LASTS[Kind.BROKER_AWAY][1]


def test_a_step_is_one_line() -> None:
    step = next(step for step in steps(1, 3600.0) if step.within)
    assert "\n" not in str(step)
    assert step.kind.value in str(step)
    assert step.within[0].act.value in str(step)
