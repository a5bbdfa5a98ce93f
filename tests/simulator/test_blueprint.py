"""What a simulated device is made of."""

from __future__ import annotations

import struct
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lfs10d.profiles.library import builtin_names, load_profile
from lfs10d.profiles.profile import Profile
from lfs10d.simulator.blueprint import LFS10, Blueprint, blueprint_of
from lfs10d.simulator.signals import Signal

LD_E = Signal(0x1004, "int32", low_word_first=True)


def test_12_99_is_the_words_of_the_lfs10_manual() -> None:
    assert LFS10.signals[0].words(12.99) == (0x414F, 0xD70A)


def test_the_low_word_of_an_ld_e_comes_first() -> None:
    assert LD_E.words(53493) == (0xD0F5, 0x0000)


def test_swapped_bytes_are_swapped_within_each_register() -> None:
    assert Signal(0, "float32", swapped=True).words(12.99) == (0x4F41, 0x0AD7)


def test_scale_and_offset_are_undone() -> None:
    assert Signal(0, "uint16", scale=0.01, offset=-10).words(40.0) == (5000,)


@given(value=st.floats(min_value=-1e12, max_value=1e12), kind=st.sampled_from(("uint16", "int16", "uint32", "int32")))
def test_a_value_that_does_not_fit_becomes_the_nearest_that_does(value: float, kind: str) -> None:
    signal = Signal(0, kind)  # type: ignore[arg-type]  # hypothesis loses the literal
    words = signal.words(value)
    bits = 16 * len(words)
    number = int.from_bytes(struct.pack(f">{len(words)}H", *words), "big")
    if kind.startswith("i") and number >= 1 << bits - 1:
        number -= 1 << bits
    low, high = (0, (1 << bits) - 1) if kind.startswith("u") else (-(1 << bits - 1), (1 << bits - 1) - 1)
    assert number == min(max(round(value), low), high)
    assert len(words) == signal.count


def test_a_whole_number_tells_the_value_it_can_hold() -> None:
    assert Signal(0, "uint16", scale=0.1).settled(12.34) == 12.3
    assert Signal(0, "int16", offset=0.5).settled(-3.2) == -3.5
    assert Signal(0).settled(12.99) == 12.99


def test_a_broken_whole_number_is_all_ones() -> None:
    assert LD_E.broken(0x7FC0_0000) == (0xFFFF, 0xFFFF)
    assert Signal(0).broken(0x7FC0_0000) == (0x7FC0, 0x0000)


@pytest.mark.parametrize("name", builtin_names())
def test_every_built_in_profile_can_be_played(name: str) -> None:
    profile = load_profile(name, relative_to=Path())
    device = blueprint_of(profile)
    assert device.name == name
    assert [signal.address for signal in device.signals] == [value.register for value in profile.values]
    assert device.check == profile.checksum
    assert (profile.write_function in device.functions) == bool(device.writable)


def test_the_lfs10_of_the_profile_sets_id_and_rate_where_ours_does() -> None:
    device = blueprint_of(load_profile("lfs10", relative_to=Path()))
    assert (device.id_register, device.rate_register) == (LFS10.id_register, LFS10.rate_register)
    assert dict(device.rate_codes) == dict(LFS10.rate_codes)
    assert device.signals == LFS10.signals
    for register, allowed in LFS10.writable.items():
        words = range(300)
        assert [word in device.writable[register] for word in words] == [word in allowed for word in words]


def vane(**more: object) -> Blueprint:
    """Return the device of a small profile."""
    value = {"name": "direction", "register": 7, "type": "uint16", "unit": "deg", "function": 4}
    return blueprint_of(Profile.model_validate({"name": "vane", "title": "A vane", "values": [value], **more}))


def test_a_device_of_which_nothing_is_known_but_a_value_can_only_be_read() -> None:
    assert vane().functions == {4}
    assert vane().words == {}


def test_a_writable_setting_takes_what_the_profile_allows() -> None:
    settings = [
        {"name": "offset", "register": 9, "range": [5, 20], "writable": True},
        {"name": "serial", "register": 10},
    ]
    device = vane(settings=settings)
    assert device.words == {9: 5, 10: 0}
    assert device.functions == {3, 4, 6}
    assert 20 in device.writable[9]
    assert 21 not in device.writable[9]
    assert 10 not in device.writable


def test_the_register_of_the_barrier_exists() -> None:
    assert vane(barrier={"function": 3, "register": 30, "count": 2}).words == {30: 0, 31: 0}


@pytest.mark.parametrize(
    ("limits", "rtu", "in_ascii"),
    [({}, 125, 125), ({"ascii_max_data": 16}, 125, 7), ({"ascii_max_data": 16, "max_words": 5}, 5, 5)],
)
def test_a_read_in_ascii_is_bounded_by_the_data_bytes_of_its_answer(
    limits: dict[str, int], rtu: int, in_ascii: int
) -> None:
    device = vane(**limits)
    assert (device.most_words("rtu"), device.most_words("ascii")) == (rtu, in_ascii)
