"""The books of a soak must be able to say no: each mutant of a true story is found out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from soak import ledger as books
from soak.ledger import Ledger, Life, Series, Told
from soak.oracle import Oracle, Sent, value_of

BOOT = "k0000001"
STARTED = 1_000.0
ENDED = 2_000.0
COUNT = 40


def sample(seq: int, *, device: str = "slave-1", boot: str = BOOT, historical: bool = False) -> Told:
    """Return sample `seq` of a sensor that is polled once a second and fails each fifth time."""
    ts = round((STARTED + seq) * 1000)
    if seq % 5 == 0:
        return Told(device, boot, seq, ts, None, "timeout", "bad", historical)
    return Told(device, boot, seq, ts, value_of(seq), None, "good", historical)


def story() -> list[Told]:
    """Return what a subscriber hears of one life in which all is well."""
    return [sample(seq) for seq in range(1, COUNT + 1)]


def judged(
    heard: list[Told], *, killed: bool = False, late: int | None = None, damaged: int | None = None
) -> tuple[Ledger, Oracle]:
    """Close the books on what was heard; `late` and `damaged` are numbers of answers not to be believed."""
    oracle = Oracle()
    for seq in range(1, COUNT + 1):
        if seq % 5:
            oracle.sent(Sent(seq, "slave-1", STARTED + seq, seq not in (late, damaged), seq != late))
    ledger = Ledger(oracle.fault_of)
    for place, told in enumerate(heard):
        ledger.told(told, float(place))
    ledger.close([Life(STARTED, ENDED, killed)])
    oracle.fold(ENDED)
    return ledger, oracle


def test_a_true_story_has_no_fault() -> None:
    ledger, oracle = judged(story())
    assert not ledger.failed
    assert not ledger.findings
    assert oracle.untold == 0
    assert ledger.counts["samples"] == COUNT
    assert (ledger.counts["good"], ledger.counts["bad"]) == (32, 8)
    assert oracle.told_of == 32


def dropped_by_the_subscriber(heard: list[Told]) -> list[Told]:
    return [told for told in heard if told.seq != 17]


def first_one_missing(heard: list[Told]) -> list[Told]:
    return heard[1:]


def sent_twice_with_another_seq(heard: list[Told]) -> list[Told]:
    return [*heard, replace(heard[-2], seq=COUNT + 1)]


def another_value(heard: list[Told]) -> list[Told]:
    return [replace(told, value=12.99) if told.seq == 17 else told for told in heard]


def a_value_nobody_can_send(heard: list[Told]) -> list[Told]:
    return [replace(told, value=1e39) if told.seq == 17 else told for told in heard]


def of_the_neighbour(heard: list[Told]) -> list[Told]:
    return [replace(told, device="slave-2", seq=1) if told.seq == COUNT - 1 else told for told in heard]


def at_another_time(heard: list[Told]) -> list[Told]:
    return [replace(told, ts=told.ts + 3000) if told.seq == 17 else told for told in heard]


def two_exchanged(heard: list[Told]) -> list[Told]:
    return [*heard[:16], heard[17], heard[16], *heard[18:]]


def changed_at_the_second_sending(heard: list[Told]) -> list[Told]:
    return [*heard, replace(heard[16], value=heard[17].value, historical=True)]


def a_failure_with_a_value(heard: list[Told]) -> list[Told]:
    return [replace(told, error="crc") if told.seq == 17 else told for told in heard]


def a_failure_without_a_code(heard: list[Told]) -> list[Told]:
    return [replace(told, error=None) if told.seq == 20 else told for told in heard]


def a_good_one_without_a_value(heard: list[Told]) -> list[Told]:
    return [replace(told, value=None) if told.seq == 17 else told for told in heard]


def numbered_from_nought(heard: list[Told]) -> list[Told]:
    return [replace(heard[0], seq=0), *heard]


@pytest.mark.parametrize(
    ("mutant", "word"),
    [
        (dropped_by_the_subscriber, "lost"),
        (first_one_missing, "lost"),
        (sent_twice_with_another_seq, "wrong"),
        (another_value, "wrong"),
        (a_value_nobody_can_send, "wrong"),
        (of_the_neighbour, "wrong"),
        (at_another_time, "wrong"),
        (two_exchanged, "disordered"),
        (changed_at_the_second_sending, "changed"),
        (a_failure_with_a_value, "wrong"),
        (a_failure_without_a_code, "wrong"),
        (a_good_one_without_a_value, "wrong"),
        (numbered_from_nought, "wrong"),
    ],
    ids=lambda each: getattr(each, "__name__", each),
)
def test_a_mutant_is_found_out(mutant: Callable[[list[Told]], list[Told]], word: str) -> None:
    ledger, _ = judged(mutant(story()))
    assert ledger.failed
    assert ledger.counts[word] == 1
    assert ledger.findings[0].startswith(f"{word}: ")


def test_a_late_answer_that_was_believed_is_wrong() -> None:
    ledger, _ = judged(story(), late=17)
    assert ledger.counts["wrong"] == 1


def test_a_damaged_answer_that_was_believed_is_wrong() -> None:
    ledger, _ = judged(story(), damaged=17)
    assert ledger.counts["wrong"] == 1


def test_a_poll_that_was_dropped_before_it_got_its_number_is_found_by_the_oracle() -> None:
    heard = story()
    renumbered = [*heard[:16], *(replace(told, seq=told.seq - 2) for told in heard[18:])]
    ledger, oracle = judged(renumbered)
    assert not ledger.counts["lost"]
    assert oracle.failed
    assert (oracle.untold, oracle.missed) == (1, 1)
    assert oracle.examples[0].number == 17


def test_a_duplicate_is_counted_and_no_fault() -> None:
    heard = story()
    ledger, _ = judged([*heard, *(replace(told, historical=True) for told in heard[10:])])
    assert not ledger.failed
    assert ledger.counts["duplicates"] == COUNT - 10
    assert ledger.counts["samples"] == COUNT


def test_the_past_comes_behind_what_is_live() -> None:
    past = [sample(seq, historical=True) for seq in range(1, 21)]
    live = [sample(seq) for seq in range(21, COUNT + 1)]
    ledger, _ = judged([*live[:3], *past, *live[3:]])
    assert not ledger.failed
    assert ledger.counts["history"] == 20


def test_order_begins_anew_with_a_connection() -> None:
    ledger = Ledger(lambda _: None)
    ledger.told(sample(2), 0.0)
    ledger.reconnected()
    ledger.told(sample(1), 0.0)
    ledger.close([])
    assert not ledger.failed


@given(st.permutations(range(1, 13)), st.sets(st.integers(1, 11)))
def test_what_is_missing_is_found_whatever_the_order_of_arrival(order: list[int], gone: set[int]) -> None:
    series = Series()
    for seq in order:
        if seq not in gone:
            assert not series.holds(seq)
            series.add(seq, seq * 1000)
    holes = series.holes(0.0)
    assert {seq for hole in holes for seq in range(hole.first, hole.last + 1)} == gone
    assert sum(hole.count for hole in holes) == len(gone)
    assert all(hole.seconds == hole.count + 1 for hole in holes)
    assert all(series.holds(seq) is (seq not in gone) for seq in range(1, 13))


def test_what_was_declared_is_not_lost() -> None:
    ledger = Ledger(lambda _: None)
    for told in story():
        if not 10 <= told.seq <= 14:
            ledger.told(told, 0.0)
    for _ in range(2):  # the event may come twice
        ledger.dropped("slave-1", BOOT, 10, 14, 5)
    ledger.close([Life(STARTED)])
    assert not ledger.failed
    assert ledger.counts["declared"] == 5


def test_a_declaration_that_is_too_small_does_not_cover() -> None:
    ledger = Ledger(lambda _: None)
    for told in story():
        if not 10 <= told.seq <= 14:
            ledger.told(told, 0.0)
    ledger.dropped("slave-1", BOOT, 10, 13, 4)
    ledger.close([Life(STARTED)])
    assert ledger.counts["lost"] == 5


def test_a_declaration_elsewhere_covers_nothing() -> None:
    ledger = Ledger(lambda _: None)
    ledger.told(sample(1), 0.0)
    ledger.told(sample(3), 0.0)
    ledger.dropped("slave-1", BOOT, 7, 9, 3)
    ledger.dropped("slave-9", BOOT, 2, 2, 1)
    ledger.close([Life(STARTED)])
    assert ledger.counts["lost"] == 1


@pytest.mark.parametrize(
    ("killed", "missing", "lost"), [(True, 7, 0), (True, 10, 10), (False, 7, 7)], ids=["8 s", "more", "no kill"]
)
def test_a_kill_may_cost_8_seconds_and_nothing_else_may(killed: bool, missing: int, lost: int) -> None:  # noqa: FBT001 - the test's parameter
    heard = [told for told in story() if not 20 < told.seq <= 20 + missing]
    ledger, _ = judged(heard, killed=killed)
    assert ledger.counts["lost"] == lost
    assert ledger.counts["killed with it"] == missing - lost
    assert ledger.killed_seconds == (0 if lost else missing + 1)


def test_a_life_is_found_by_the_time_of_its_samples() -> None:
    ledger = Ledger(lambda _: None)
    ledger.told(sample(1), 0.0)
    ledger.told(sample(3), 0.0)
    ledger.close([Life(STARTED - 100, STARTED - 50), Life(STARTED, ENDED, killed=True), Life(ENDED)])
    assert ledger.counts["killed with it"] == 1


def test_a_silent_life_is_judged_and_forgotten_and_what_comes_later_is_told() -> None:
    ledger = Ledger(lambda _: None)
    ledger.told(sample(1), 0.0)
    ledger.told(sample(3), 0.0)
    ledger.fold([Life(STARTED)], books.FOLDED_AFTER)
    assert not ledger.failed
    ledger.fold([Life(STARTED)], books.FOLDED_AFTER + 1)
    assert ledger.counts["lost"] == 1
    ledger.told(sample(2), 0.0)
    assert ledger.counts["unjudged"] == 1


def test_memory_stays_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(books, "REMEMBERED", 10)
    ledger = Ledger(lambda _: None)
    for told in story():
        ledger.told(told, 0.0)
    (series,) = ledger._series.values()
    assert len(series.contents) == 10
    assert len(series.stretches) == 1
    ledger.told(sample(1, historical=True), 0.0)
    assert ledger.counts["unjudged"] == 1  # it cannot be compared any more, and that is said
    for number in range(20):
        ledger.told(sample(1, boot=f"k{number:07}"), 0.0)
    ledger.close([])
    assert len(ledger._folded) == 10


def test_all_faults_are_counted_and_the_first_are_told() -> None:
    ledger = Ledger(lambda _: "no")
    random = Random(1)  # noqa: S311  # repeatable
    for seq in range(1, 100):
        ledger.told(Told("slave-1", BOOT, seq, seq, random.random(), None, "good", historical=False), 0.0)
    assert ledger.counts["wrong"] == 99
    assert len(ledger.findings) == books.EXAMPLES


def test_a_dropped_event_alone_is_no_loss() -> None:
    ledger = Ledger(lambda _: None)
    ledger.dropped("slave-1", BOOT, 1, 3, 3)
    ledger.close([Life(STARTED)])
    assert not ledger.failed
    assert ledger.counts["dropped events"] == 1
