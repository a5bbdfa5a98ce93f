"""When the whole line is kept quiet, to hear whether a second answer follows."""

from __future__ import annotations

import itertools
from math import inf

import pytest

from lfs10d.line.quiet_watch import AGAIN, AGAIN_MOST, ANY, REACH, SAME, VAIN, QuietWatch, spoilt
from lfs10d.modbus.duplicates import AWAITED_MOST, WATCHED, Duplicates
from lfs10d.modbus.outcome import Outcome
from lfs10d.modbus.request import ReadRegisters
from lfs10d.reading import Fault, FaultCode
from tests.support.outcomes import ended


def over(slave: int, at: float = 1.0, code: FaultCode | None = None, *, unsolicited: int = 0) -> Outcome:
    fault = None if code is None else Fault(code, "failed")
    answer = (1, 2) if code is None else None
    return ended(ReadRegisters(slave, 1, 2), answer=answer, fault=fault, ended=at, unsolicited=unsolicited)


@pytest.fixture
def duplicates() -> Duplicates:
    return Duplicates()


@pytest.fixture
def watch(duplicates: Duplicates) -> QuietWatch:
    return QuietWatch(duplicates, 0.0)


def spoil(watch: QuietWatch, slave: int, at: float, fault: FaultCode = FaultCode.CRC, *, online: bool = True) -> None:
    watch.exchanged(over(slave, at, fault), online=online)


@pytest.mark.parametrize("fault", [FaultCode.CRC, FaultCode.MALFORMED, FaultCode.TIMEOUT])
def test_a_neighbour_that_is_spoilt_each_time_has_the_line_kept_quiet(watch: QuietWatch, fault: FaultCode) -> None:
    for n in range(SAME):
        watch.answered(1, float(n))
        assert watch.until == -inf
        spoil(watch, 2, n + 0.05, fault)
    watch.answered(1, float(SAME))
    assert watch.until == SAME + WATCHED


def test_one_that_is_offline_and_silent_raises_no_suspicion_nor_does_what_is_long_after(watch: QuietWatch) -> None:
    for n in range(9):
        watch.answered(1, float(n))
        spoil(watch, 2, n + 0.05, FaultCode.TIMEOUT, online=False)
        spoil(watch, 3, n + REACH + 0.01)
        watch.exchanged(over(2, n + 0.1), online=True)
    assert watch.until == -inf


def test_different_ones_take_longer(watch: QuietWatch) -> None:
    for n in range(ANY):
        watch.answered(1, float(n))
        assert watch.until == -inf
        spoil(watch, 2 + n, n + 0.05)
    watch.answered(1, float(ANY))
    assert watch.until == ANY + WATCHED


def test_one_whose_own_answers_are_spoilt_is_listened_to_after_one_that_is_not(watch: QuietWatch) -> None:
    quiet: list[int] = []
    for n in range(20):
        if n % 2:
            spoil(watch, 1, n - 0.85)
        watch.answered(1, float(n))
        quiet += [n] if watch.until == n + WATCHED else []
    assert quiet[0] < 12
    assert not any(n % 2 for n in quiet)


def test_what_is_spoilt_seldom_is_no_suspicion(watch: QuietWatch) -> None:
    for n in range(300):
        watch.answered(1, float(n))
        if n % 4 == 0:
            spoil(watch, 2, n + 0.05)
    assert watch.until == -inf


def test_in_vain_it_is_kept_quiet_ever_more_seldom(watch: QuietWatch) -> None:
    quiet: list[float] = []
    for n in range(6000):
        watch.answered(1, float(n))
        if watch.until == n + WATCHED:
            quiet.append(n)
        spoil(watch, 2, n + 0.05)
    pauses = [later - earlier for earlier, later in itertools.pairwise(quiet)]
    assert pauses[0] == AGAIN
    assert pauses == sorted(pauses)
    assert pauses[-1] == AGAIN_MOST


def test_all_watches_take_a_small_share_of_the_line(watch: QuietWatch) -> None:
    quiet = 0
    for n in range(100):
        for slave in range(1, 101):
            watch.answered(slave, n + slave / 1000)
            quiet += watch.until == n + slave / 1000 + WATCHED
        spoil(watch, 200, n + 0.15)
    assert 5 < quiet < 15


def test_after_one_too_many_the_line_is_quiet_until_the_second_has_come(
    watch: QuietWatch, duplicates: Duplicates
) -> None:
    for n in (1.0, 2.0):
        duplicates.answered(1, n)
        watch.answered(1, n)
        duplicates.second(1, n + 0.04)
        watch.second(1, n + 0.04)
        assert watch.until <= n + 0.04
    duplicates.answered(1, 3.0)
    watch.answered(1, 3.0)
    assert 3.04 < watch.until < 3.0 + WATCHED
    watch.second(1, 3.04)
    assert watch.until == 3.04
    watch.second(9, 3.05)  # never heard


def test_where_none_comes_the_line_waits_no_more_until_one_does(watch: QuietWatch, duplicates: Duplicates) -> None:
    for n in (1.0, 2.0):
        duplicates.answered(1, n)
        duplicates.second(1, n + 0.04)
    quiet: list[bool] = []
    for n in range(3, 9):
        watch.answered(1, float(n))
        quiet.append(watch.until > n)
        if n == 6:
            watch.second(1, n + 0.9)
        if n == 7:
            watch.second(1, n + 0.04)
    assert quiet == [True] * VAIN + [False] * 3 + [True]


def test_for_one_that_comes_long_after_the_line_does_not_wait(watch: QuietWatch, duplicates: Duplicates) -> None:
    for n in (1.0, 2.0):
        duplicates.answered(1, n)
        duplicates.second(1, n + AWAITED_MOST)
    watch.answered(1, 3.0)
    assert watch.until == -inf


def test_bytes_that_belong_to_nothing_spoil_an_exchange() -> None:
    assert spoilt(over(1, unsolicited=1))
    assert spoilt(over(1, code=FaultCode.CRC))
    assert not spoilt(over(1, code=FaultCode.TIMEOUT))
    assert not spoilt(over(1))
