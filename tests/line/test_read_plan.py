"""Which registers the next poll reads."""

from __future__ import annotations

from typing import Any

import pytest

from lfs10d.line.read_plan import ABSENT_AGAIN, ReadPlan, part_of_polls
from lfs10d.profiles.profile import Profile
from lfs10d.reading import Fault, FaultCode, Value

REFUSED = Fault(FaultCode.EXCEPTION, "exception 02", 2)


def station(*more: dict[str, Any], **keys: Any) -> Profile:  # noqa: ANN401  # a file's data
    """Return a station of wind and rain, and what else it measures; rain may be absent."""
    plain = {"type": "uint16", "unit": "1"}
    values = [{"name": "wind", "register": 0}, {"name": "rain", "register": 1, "optional": True}, *more]
    return Profile.model_validate(
        {"name": "station", "title": "A station", "values": [plain | each for each in values], **keys}
    )


def spans(plan: ReadPlan, now: float, *, everything: bool = False) -> list[tuple[int, int]]:
    """Return address and count of each read of a poll at `now`; the device is polled every second."""
    return [(block.address, block.count) for block in plan.reads(now, 1.0, everything=everything)]


def absent(plan: ReadPlan, now: float) -> None:
    """Have what is optional refused, alone, in a poll at `now`."""
    (together,) = plan.reads(now, 1.0)
    instead = plan.refused(together, REFUSED, now)
    assert instead is not None
    assert plan.refused(instead[-1], REFUSED, now) == ()
    plan.complete({"wind": 1}, {}, now, 1.0)


def test_a_device_without_optional_or_slow_values_is_read_as_its_profile_says() -> None:
    profile = Profile.model_validate(
        {"name": "a", "title": "A", "values": [{"name": "x", "register": 1, "type": "uint16", "unit": "m"}]}
    )
    assert ReadPlan(profile).simple
    assert ReadPlan(profile).reads(0.0, 1.0) is profile.reads()


def test_the_rest_is_read_in_the_same_poll_without_what_is_absent_and_later_polls_do_not_ask_for_it() -> None:
    plan = ReadPlan(station({"name": "gust", "register": 2}))
    (together,) = plan.reads(0.0, 1.0)
    assert (together.address, together.count) == (0, 3)
    instead = plan.refused(together, REFUSED, 0.0)
    assert instead is not None
    assert [(block.address, block.count) for block in instead] == [(0, 1), (2, 1), (1, 1)]
    assert plan.refused(instead[2], REFUSED, 0.0) == ()
    values: dict[str, Value | None] = {"wind": 5, "gust": 7}
    faults: dict[str, Fault] = {}
    assert plan.complete(values, faults, 0.1, 1.0) == {}
    assert values == {"wind": 5, "gust": 7, "rain": None}
    assert faults == {"rain": REFUSED}
    assert spans(plan, 1.0) == [(0, 1), (2, 1)]
    assert plan.reads(1.0, 1.0) is plan.reads(2.0, 1.0)


def test_a_read_that_may_skip_registers_does_not_skip_the_absent_one() -> None:
    plan = ReadPlan(station({"name": "gust", "register": 2}, {"name": "battery", "register": 4}, may_skip=3))
    (together,) = plan.reads(0.0, 1.0)
    assert (together.address, together.count) == (0, 5)
    instead = plan.refused(together, REFUSED, 0.0)
    assert instead is not None
    assert [(block.address, block.count) for block in instead] == [(0, 1), (2, 3), (1, 1)]
    assert plan.refused(instead[2], REFUSED, 0.0) == ()
    plan.complete({"wind": 5, "gust": 7, "battery": 12}, {}, 0.1, 1.0)
    assert spans(plan, 1.0) == [(0, 1), (2, 3)]


def test_what_is_absent_is_asked_again_alone_after_ten_minutes_and_is_back_when_it_answers() -> None:
    plan = ReadPlan(station())
    absent(plan, 0.0)
    assert spans(plan, ABSENT_AGAIN - 1) == [(0, 1)]
    assert spans(plan, ABSENT_AGAIN) == [(0, 1), (1, 1)]
    again = plan.reads(ABSENT_AGAIN, 1.0)[1]
    assert plan.refused(again, REFUSED, ABSENT_AGAIN) == ()
    assert spans(plan, ABSENT_AGAIN + 1) == [(0, 1)]
    faults: dict[str, Fault] = {}
    plan.complete({"wind": 1, "rain": 2}, faults, 2 * ABSENT_AGAIN, 1.0)
    assert faults == {}
    assert spans(plan, 2 * ABSENT_AGAIN + 1) == [(0, 2)]


def test_after_an_outage_everything_is_asked() -> None:
    plan = ReadPlan(station())
    absent(plan, 0.0)
    plan.forget()
    assert spans(plan, 1.0) == [(0, 2)]


def test_optional_registers_that_answer_alone_stay_alone_unless_another_is_found_to_be_the_culprit() -> None:
    plan = ReadPlan(station({"name": "snow", "register": 2, "optional": True}))
    (together,) = plan.reads(0.0, 1.0)
    instead = plan.refused(together, REFUSED, 0.0)
    assert instead is not None
    plan.complete({"wind": 1, "rain": 2, "snow": 3}, {}, 0.0, 1.0)
    assert spans(plan, 1.0) == [(0, 1), (1, 1), (2, 1)]
    assert plan.refused(instead[2], REFUSED, 1.0) == ()
    plan.complete({"wind": 1, "rain": 2}, {}, 1.0, 1.0)
    assert spans(plan, 2.0) == [(0, 2)]


def test_another_exception_or_a_read_of_nothing_optional_fails_the_poll() -> None:
    plan = ReadPlan(station({"name": "far", "register": 9}))
    near, far = plan.reads(0.0, 1.0)
    assert plan.refused(far, REFUSED, 0.0) is None
    assert plan.refused(near, Fault(FaultCode.EXCEPTION, "exception 04", 4), 0.0) is None
    assert plan.refused(near, Fault(FaultCode.TIMEOUT, "no answer"), 0.0) is None


def test_parts_of_one_register_are_absent_together() -> None:
    halves = {"a": "high", "b": "low"}
    parts = [{"name": name, "register": 1, "optional": True, "byte": half} for name, half in halves.items()]
    plain = {"type": "uint16", "unit": "1"}
    values = [plain | each for each in ({"name": "wind", "register": 0}, *parts)]
    plan = ReadPlan(Profile.model_validate({"name": "s", "title": "S", "values": values}))
    absent(plan, 0.0)
    assert spans(plan, 1.0) == [(0, 1)]


def test_a_device_all_of_whose_values_are_absent_is_asked_for_all() -> None:
    only = [{"name": "rain", "register": 1, "optional": True, "type": "uint16", "unit": "mm"}]
    plan = ReadPlan(Profile.model_validate({"name": "s", "title": "S", "values": only}))
    (block,) = plan.reads(0.0, 1.0)
    assert plan.refused(block, REFUSED, 0.0) == ()
    assert spans(plan, 1.0) == [(1, 1)]


def test_a_slow_value_is_read_at_its_own_interval_and_its_age_is_told_in_between() -> None:
    plan = ReadPlan(station({"name": "battery", "register": 2, "interval": "1m"}))
    assert spans(plan, 0.0) == [(0, 2), (2, 1)]
    plan.complete({"wind": 1, "rain": 0, "battery": 12}, {}, 0.0, 1.0)
    assert spans(plan, 1.0) == [(0, 2)]
    assert spans(plan, 1.0, everything=True) == [(0, 2), (2, 1)]
    values: dict[str, Value | None] = {"wind": 2, "rain": 0}
    assert plan.complete(values, {}, 0.9, 1.0) == {}  # no older than the device's interval
    values = {"wind": 2, "rain": 0}
    assert plan.complete(values, {}, 30.0, 1.0) == {"battery": 30.0}
    assert values == {"wind": 2, "rain": 0, "battery": 12}
    assert spans(plan, 59.8) == [(0, 2)]
    assert spans(plan, 59.95) == [(0, 2), (2, 1)]  # a poll that comes a little early is the one


def test_a_slow_value_that_was_unavailable_stays_so_until_it_is_read_again() -> None:
    plan = ReadPlan(station({"name": "battery", "register": 2, "interval": "1m"}))
    nothing = Fault(FaultCode.UNAVAILABLE, "battery is not available")
    plan.complete({"wind": 1, "rain": 0, "battery": None}, {"battery": nothing}, 0.0, 1.0)
    values: dict[str, Value | None] = {"wind": 2, "rain": 0}
    faults: dict[str, Fault] = {}
    assert plan.complete(values, faults, 30.0, 1.0) == {}
    assert (values["battery"], faults) == (None, {"battery": nothing})


def test_a_poll_reads_something_though_every_value_is_slow() -> None:
    slow = [{"name": "rain", "register": 1, "interval": "1m", "type": "uint16", "unit": "mm"}]
    plan = ReadPlan(Profile.model_validate({"name": "s", "title": "S", "values": slow}))
    plan.complete({"rain": 1}, {}, 0.0, 1.0)
    assert spans(plan, 1.0) == [(1, 1)]


def test_a_poll_that_an_outage_overtook_knows_nothing_of_what_it_did_not_read() -> None:
    plan = ReadPlan(station({"name": "battery", "register": 2, "interval": "1m"}))
    plan.forget()
    faults: dict[str, Fault] = {}
    values: dict[str, Value | None] = {"wind": 1, "rain": 0}
    plan.complete(values, faults, 5.0, 1.0)
    assert values["battery"] is None
    assert faults["battery"].code is FaultCode.UNAVAILABLE


def test_another_profile_of_the_same_device_is_followed() -> None:
    plan = ReadPlan(station())
    absent(plan, 0.0)
    plan.follow(station({"name": "gust", "register": 2}))
    assert spans(plan, 1.0) == [(0, 1), (2, 1)]


def test_where_every_value_is_slow_a_poll_reads_the_least_slow_ones() -> None:
    plan = ReadPlan(all_slow())
    plan.complete({"rain": 1, "battery": 1}, {}, 0.0, 1.0)
    assert spans(plan, 1.0) == [(1, 1)]
    assert spans(plan, 3600.0) == [(1, 1), (9, 1)]


def test_where_the_only_fast_value_is_absent_a_poll_reads_the_least_slow_ones() -> None:
    slow = [value.model_dump(by_alias=True) for value in all_slow().values]
    fast = {"name": "wind", "register": 0, "type": "uint16", "unit": "1", "optional": True}
    plan = ReadPlan(Profile.model_validate({"name": "s", "title": "S", "values": [fast, *slow]}))
    assert plan.refused(plan.reads(0.0, 1.0)[0], REFUSED, 0.0) == ()
    plan.complete({"rain": 1, "battery": 1}, {}, 0.0, 1.0)
    assert spans(plan, 1.0) == [(1, 1)]


def all_slow() -> Profile:
    values = [{"name": "rain", "register": 1, "interval": "1m"}, {"name": "battery", "register": 9, "interval": "1h"}]
    plain = {"type": "uint16", "unit": "1"}
    return Profile.model_validate({"name": "s", "title": "S", "values": [plain | each for each in values]})


@pytest.mark.parametrize(
    ("interval", "parts"), [(1.0, [1.0, 1 / 60]), (7.0, [1.0, 1 / 9]), (120.0, [1.0, 1.0]), (0.0, [1.0, 0.0])]
)
def test_a_slow_read_is_a_part_of_the_polls(interval: float, parts: list[float]) -> None:
    profile = station({"name": "battery", "register": 9, "interval": "1m"})
    assert [part_of_polls(profile, block, interval) for block in profile.reads()] == parts


def test_the_least_slow_read_is_in_each_poll_where_all_are_slow() -> None:
    profile = all_slow()
    assert [part_of_polls(profile, block, 60.0) for block in profile.reads()] == [1.0, 1 / 60]


@pytest.mark.parametrize("interval", [1.0, 7.0, 13.0, 45.0, 60.0, 120.0])
def test_the_part_of_the_polls_is_how_often_they_really_ask(interval: float) -> None:
    """Polls on their grid, each of which takes 50 ms."""
    profile = station({"name": "battery", "register": 9, "interval": "1m"})
    plan, polls, asked = ReadPlan(profile), round(36_000 / interval), 0
    for number in range(polls):
        now = number * interval
        names = {value.name for block in plan.reads(now, interval) for value in block.values}
        asked += "battery" in names
        plan.complete(dict.fromkeys(names, 1), {}, now + 0.05, interval)
    assert asked / polls == pytest.approx(part_of_polls(profile, profile.reads()[1], interval), rel=0.01)
