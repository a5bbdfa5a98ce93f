"""What to look for: ids in people's words, the order of asking, and how long it takes."""

from __future__ import annotations

from pathlib import Path

import pytest

from lfs10d.line.jobs.scan_plan import LAST_TIMEOUT, ScanPlan
from lfs10d.modbus.frames import Codec, Framing
from lfs10d.modbus.request import ReadRegisters
from lfs10d.modbus.timing import LineTiming
from lfs10d.profiles.library import load_profile

LFS10 = load_profile("lfs10", relative_to=Path())
SLOW, FAST = LineTiming.of(9600), LineTiming.of(19200)


def search(ids: tuple[int, ...], *, share: float = 1.0) -> ScanPlan:
    return ScanPlan(ids, (SLOW, FAST), Codec(Framing.RTU), (LFS10,), share=share)


def test_reserved_ids_are_asked_last_at_every_rate() -> None:
    assert search((1, 248, 2, 255)).rounds == ((SLOW, (1, 2)), (FAST, (1, 2)), (SLOW, (248, 255)), (FAST, (248, 255)))


def test_there_is_no_round_without_ids() -> None:
    assert search((250,)).rounds == ((SLOW, (250,)), (FAST, (250,)))


def test_all_ids_at_one_rate_take_about_an_eighth_of_a_second_each() -> None:
    whole = ScanPlan(tuple(range(1, 256)), (SLOW,), Codec(Framing.RTU), (LFS10,))
    assert 255 * 0.1 < whole.expected < 255 * 0.125


def test_a_share_of_the_line_takes_longer_in_proportion() -> None:
    assert search((1, 2), share=0.25).expected == pytest.approx(4 * search((1, 2)).expected)


def test_the_last_id_of_a_round_is_waited_for_longer() -> None:
    each = search((1,)).cost(SLOW) + search((1,)).cost(FAST)
    assert search((1,)).expected == pytest.approx(each + 2 * LAST_TIMEOUT)


def test_the_first_question_is_for_the_id_register() -> None:
    assert search((9,)).opening(9) == ReadRegisters(9, 0x0005, 1)


def test_a_device_is_read_by_the_profile_it_is_tried_for_unless_the_plan_knows_its_calibration() -> None:
    plan = ScanPlan((3,), (LineTiming.of(9600),), Codec(Framing.RTU), (LFS10,))
    assert plan.read_as(3, 9600, LFS10) is LFS10
