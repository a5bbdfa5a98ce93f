"""Which message ends the connection is found without a guess."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from lfs10d.outbox.suspects import Culprit, Suspects


def test_what_alone_was_under_way_at_two_ends_in_a_row_is_the_culprit() -> None:
    suspects = Suspects()
    assert suspects.ended({"a": 100, "b": 50}, certain=False) is None
    assert not suspects.goes_alone("a")
    assert suspects.ended({"a": 100, "c": 50}, certain=False) == Culprit("a", 100)


def test_several_go_alone_after_the_second_end() -> None:
    suspects = Suspects()
    suspects.ended({"a": 1, "b": 1, "c": 1}, certain=False)
    assert suspects.ended({"a": 1, "b": 1, "d": 1}, certain=False) is None
    assert [suspects.goes_alone(topic) for topic in "abcd"] == [True, True, False, False]
    assert suspects.ended({"b": 1}, certain=False) == Culprit("b", 1)


def test_after_a_reason_that_speaks_of_a_message_they_go_alone_at_once() -> None:
    suspects = Suspects()
    suspects.ended({"a": 1, "b": 1}, certain=True)
    assert suspects.goes_alone("a")


def test_an_acknowledgement_clears_what_is_about_as_large() -> None:
    suspects = Suspects()
    suspects.ended({"a": 1000, "b": 1000}, certain=True)
    suspects.acknowledged("a", 899)
    assert suspects.goes_alone("a")
    suspects.acknowledged("a", 900)
    assert not suspects.goes_alone("a")
    assert suspects.goes_alone("b")
    suspects.acknowledged("b", 2000)
    suspects.acknowledged("b", 2000)
    suspects.acknowledged("never seen", 1)
    assert suspects.ended({"a": 1000, "b": 1000}, certain=False) is None


def test_ends_that_have_nothing_in_common_accuse_nobody() -> None:
    suspects = Suspects()
    suspects.ended({"a": 1}, certain=False)
    assert suspects.ended({"b": 1}, certain=False) is None
    assert suspects.ended({}, certain=False) is None
    assert suspects.ended({"b": 1}, certain=False) is None


def test_what_is_cut_is_found_guilty_again_at_the_next_end_or_cleared_by_its_half() -> None:
    suspects = Suspects()
    suspects.ended({"a": 8000}, certain=False)
    culprit = suspects.ended({"a": 8000}, certain=False)
    assert culprit is not None
    suspects.cut(culprit)
    assert suspects.ended({"a": 4000, "b": 1}, certain=False) == Culprit("a", 4000)
    suspects.cut(Culprit("a", 4000))
    suspects.acknowledged("a", 1900)
    assert not suspects.goes_alone("a")


def test_an_end_is_explained_by_what_was_under_way_at_the_one_before() -> None:
    suspects = Suspects()
    assert not suspects.explain({"a": 1})
    suspects.ended({"a": 1, "b": 1}, certain=False)
    assert suspects.explain({"b": 1, "c": 1})
    assert not suspects.explain({"c": 1})


@given(
    bad=st.integers(0, 9),
    window=st.integers(1, 20),
    acknowledged_before=st.booleans(),
)
def test_a_broker_that_throws_us_out_for_one_topic_is_understood_in_three_ends(
    bad: int,
    window: int,
    acknowledged_before: bool,  # noqa: FBT001 - drawn by hypothesis
) -> None:
    """Ten topics go in order at each connect; the broker takes all but one, and may not get to acknowledge them."""
    suspects, ends = Suspects(), 0
    while True:
        ends += 1
        under_way: dict[str, int] = {}
        for number in range(10):
            topic = f"t{number}"
            if suspects.goes_alone(topic) or len(under_way) >= window:
                for each in list(under_way):
                    suspects.acknowledged(each, 100)
                under_way.clear()
            under_way[topic] = 100
            if number == bad and (suspects.goes_alone(topic) or acknowledged_before):
                break
            if suspects.goes_alone(topic):
                suspects.acknowledged(topic, 100)
                under_way.clear()
            if f"t{bad}" in under_way and (len(under_way) >= window or number == 9):
                break
        culprit = suspects.ended(under_way, certain=False)
        if culprit is not None:
            break
        assert ends < 3
    assert culprit == Culprit(f"t{bad}", 100)
