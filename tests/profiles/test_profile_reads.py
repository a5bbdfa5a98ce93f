"""Which reads bring the values of a device, some of them, or the others where some are refused."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from lfs10d.profiles.blocks import Block, batch
from lfs10d.profiles.profile import Profile

Build = Callable[..., Profile]
PLAIN: dict[str, object] = {"type": "uint16", "unit": "m"}


def spans(blocks: Iterable[Block]) -> list[tuple[int, int]]:
    return [(block.address, block.count) for block in blocks]


def test_a_setting_is_found_by_its_register_and_some_values_are_read_together(profile_of: Build) -> None:
    plain = {"type": "uint16", "unit": "m"}
    values = [{"name": name, "register": register} | plain for name, register in (("a", 1), ("b", 2), ("c", 3))]
    profile = profile_of(values=values, settings=[{"name": "average", "register": 16}], may_skip=1)
    setting = profile.setting_at(16)
    assert setting is not None
    assert setting.name == "average"
    assert profile.setting_at(17) is None
    first, second, last = profile.values
    (block,) = profile.batched((last, first, second))
    assert (block.address, block.count, block.values) == (1, 3, (first, second, last))
    assert [(each.address, each.count) for each in profile.batched((first, last))] == [(1, 1), (3, 1)]
    assert profile.first_of("speed") is None
    assert profile_of(values=[values[0], values[1] | {"device_class": "speed"}]).first_of("speed") is not None


def test_of_a_refused_read_the_required_values_are_read_without_the_optional_ones(profile_of: Build) -> None:
    values = [{"name": f"v{n}", "register": n, "optional": n in (1, 2)} | PLAIN for n in range(1, 5)]
    profile = profile_of(values=values)
    assert spans(profile.without_optional(profile.main_read)) == [(3, 2)]
    assert spans(profile.without_optional(profile.batched(profile.values[2:])[0])) == []


def test_of_a_refused_read_of_optional_values_each_is_read_alone_parts_of_one_register_together(
    profile_of: Build,
) -> None:
    values: list[dict[str, object]] = [PLAIN | {"name": "a", "register": 1}]
    values += [PLAIN | {"name": byte, "register": 2, "byte": byte} for byte in ("high", "low")]
    profile = profile_of(values=[each | {"optional": True} for each in values])
    (a, both) = profile.without_optional(profile.main_read)
    assert spans((a, both)) == [(1, 1), (2, 1)]
    assert [value.name for value in both.values] == ["high", "low"]
    assert profile.without_optional(both) == ()


def test_a_read_spans_no_register_that_a_value_names_which_is_not_in_it() -> None:
    """An optional one may be absent: then the device would refuse the others with it."""
    plain = {"type": "uint16", "unit": "1"}
    gap = [{"name": "b", "register": 2, "optional": True}, {"name": "c", "register": 4, "interval": "1m"}]
    values = [{"name": "a", "register": 0}, *gap, {"name": "d", "register": 6}, {"name": "e", "register": 8}]
    profile = Profile.model_validate(
        {"name": "p", "title": "P", "values": [plain | each for each in values], "may_skip": 9}
    )
    assert [(block.address, block.count) for block in profile.reads()] == [(0, 3), (6, 3), (4, 1)]
    (first, *_) = profile.reads()
    assert [(block.address, block.count) for block in profile.without_optional(first)] == [(0, 1)]
    a, b, _, d, e = profile.values
    assert [(block.address, block.count) for block in profile.batched((a, d, e))] == [(0, 1), (6, 3)]
    assert [(block.address, block.count) for block in batch((a, b, d), 125, 9)] == [(0, 7)]


def test_a_value_that_lies_in_another_is_in_its_read_and_one_of_another_function_in_no_way() -> None:
    plain = {"unit": "1"}
    values = [
        {"name": "a", "register": 0, "type": "uint32", "word_order": "high_first"},
        {"name": "b", "register": 1, "type": "uint16", "interval": "1m"},
        {"name": "c", "register": 2, "type": "uint16"},
        {"name": "d", "register": 3, "type": "uint16", "function": 4},
        {"name": "e", "register": 5, "type": "uint16"},
    ]
    profile = Profile.model_validate(
        {"name": "p", "title": "P", "values": [plain | each for each in values], "may_skip": 2}
    )
    spans = [(block.function, block.address, block.count) for block in profile.reads()]
    assert spans == [(3, 0, 6), (3, 1, 1), (4, 3, 1)]
