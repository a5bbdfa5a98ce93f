"""A sensor whose place is in doubt is looked for at each of them until it answers."""

from __future__ import annotations

from lfs10d.reconfiguration.journal import Endpoint
from lfs10d.reconfiguration.procedures.locate import locate
from tests.support.sensors import Pretence

FILE, LAST = Endpoint(slave=3, baudrate=9600), Endpoint(slave=7, baudrate=19200)


def test_the_first_place_at_which_somebody_answers_is_taken(pretence: Pretence) -> None:
    pretence.sensor(3)
    pretence.sensor(7, baudrate=19200)
    assert pretence.carry_out(locate((FILE, LAST), pretence.query(), longest_pause=15.0)) == FILE
    assert pretence.carry_out(locate((LAST, FILE), pretence.query(), longest_pause=15.0)) == LAST
    assert pretence.awaited == []


def test_the_second_place_is_asked_when_the_first_was_silent_three_times(pretence: Pretence) -> None:
    pretence.sensor(7, baudrate=19200)
    assert pretence.carry_out(locate((FILE, LAST), pretence.query(), longest_pause=15.0)) == LAST
    assert [request.slave for request in pretence.requests] == [3, 3, 3, 7]


def test_that_nobody_answers_is_told_once_and_the_places_are_asked_on_until_somebody_does(pretence: Pretence) -> None:
    pretence.later.append((40.0, lambda: pretence.sensor(7, baudrate=19200)))
    assert pretence.carry_out(locate((FILE, LAST), pretence.query(), longest_pause=4.0)) == LAST
    assert pretence.awaited == [None]
    assert pretence.clock.now < 40.0 + 2 * 4.0 + 2.0


def test_the_pauses_grow_up_to_the_longest(pretence: Pretence) -> None:
    begun: list[float] = []
    steps = locate((FILE,), pretence.query(), longest_pause=4.0)
    pretence.later = [(float(second), lambda: begun.append(len(pretence.asked))) for second in range(60)]
    pretence.later.append((60.0, lambda: pretence.sensor(3)))
    pretence.carry_out(steps)
    # Each look costs at most one question of 0.2 s here, after pauses of 1, 2, 4, 4, 4 ... s.
    assert 3 + (60 - 4) / 4.7 < len(pretence.asked) < 3 + 2 + (60 - 4) / 4.0 + 2


def test_a_longest_pause_below_a_second_holds_for_the_first_too(pretence: Pretence) -> None:
    pretence.later.append((1.9, lambda: pretence.sensor(3)))
    assert pretence.carry_out(locate((FILE,), pretence.query(), longest_pause=0.1)) == FILE
    assert pretence.clock.now < 3.5
