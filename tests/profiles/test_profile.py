"""A profile as a whole: defaults, what its keys must agree on, and the view that others have of it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from pydantic import ValidationError

from lfs10d.profiles.library import builtin_names, load_profile, parse_profile
from lfs10d.profiles.profile import Profile
from lfs10d.reading import Fault, FaultCode

Build = Callable[..., Profile]

TWO_VALUES = [
    {"name": "level", "register": 1, "type": "uint16", "unit": "m"},
    {"name": "volume", "register": 2, "type": "float32", "word_order": "low_first", "unit": "m3", "range": [0, 9]},
]


def problems(build: Build, **changed: Any) -> list[tuple[tuple[int | str, ...], str]]:  # noqa: ANN401  # a file's data
    with pytest.raises(ValidationError) as caught:
        build(**changed)
    return [(wrong["loc"], wrong["msg"]) for wrong in caught.value.errors()]


def test_what_a_file_leaves_out_is_what_modbus_says(profile_of: Build) -> None:
    profile = profile_of()
    assert profile.ids == (1, 247)
    assert profile.framings == ("rtu",)
    assert profile.checksum == "crc"
    assert profile.max_words == 125
    assert profile.busy_exceptions == (6,)
    assert (profile.barrier, profile.slave_id, profile.baudrate, profile.factory) == (None, None, None, None)
    assert not profile.broadcast
    assert profile.min_interval == 0


def test_the_values_keep_the_order_of_the_file_the_primary_first(profile_of: Build) -> None:
    profile = profile_of(values=list(reversed(TWO_VALUES)))
    assert profile.value_names == ("volume", "level")
    assert profile.units == {"volume": "m3", "level": "m"}


def test_the_reads_are_the_same_objects_every_time(profile_of: Build) -> None:
    profile = profile_of(values=TWO_VALUES)
    assert profile.reads() is profile.reads()
    assert [(block.function, block.address, block.count) for block in profile.reads()] == [(3, 1, 3)]


def test_a_block_becomes_numbers_or_one_fault(profile_of: Build) -> None:
    profile = profile_of(values=TWO_VALUES)
    (block,) = profile.reads()
    assert block.decode((7, 0x0000, 0x4010)) == {"level": 7, "volume": 2.25}
    fault = block.decode((7, 0x0000, 0x4120))
    assert fault == Fault(FaultCode.OUT_OF_RANGE, "volume 10 m3 is outside 0..9 m3")


def test_a_profile_equals_another_of_the_same_file_and_no_other(profile_of: Build) -> None:
    assert profile_of(values=TWO_VALUES) == profile_of(values=TWO_VALUES)
    assert profile_of(values=TWO_VALUES) != profile_of()


@pytest.mark.parametrize(
    ("limits", "reads"),
    [
        ({"max_words": 3}, [(1, 3)]),
        ({"max_words": 2}, [(1, 1), (2, 2)]),
        ({"framings": ["rtu", "ascii"], "ascii_max_data": 6}, [(1, 1), (2, 2)]),
        ({"framings": ["rtu", "ascii"], "ascii_max_data": 7}, [(1, 3)]),
        ({"framings": ["rtu"], "ascii_max_data": 6}, [(1, 3)]),
        ({"framings": ["rtu", "ascii"], "max_words": 2, "ascii_max_data": 16}, [(1, 1), (2, 2)]),
    ],
)
def test_a_read_keeps_the_limit_of_every_framing_that_the_device_speaks(
    profile_of: Build, limits: dict[str, Any], reads: list[tuple[int, int]]
) -> None:
    profile = profile_of(values=TWO_VALUES, **limits)
    assert [(block.address, block.count) for block in profile.reads()] == reads


def test_id_and_rate_have_registers_of_their_own_that_are_no_settings(profile_of: Build) -> None:
    profile = profile_of(
        slave_id={"register": 5},
        baudrate={"register": 4, "codes": {9600: 1}},
        settings=[{"name": "average", "register": 6}],
    )
    assert profile.slave_id is not None
    assert profile.baudrate is not None
    assert (profile.slave_id.register, profile.baudrate.register) == (5, 4)
    assert profile.setting_at(5) is None
    setting = profile.setting_at(6)
    assert setting is not None
    assert setting.name == "average"


def test_a_profile_without_id_and_rate_registers_sets_neither(profile_of: Build) -> None:
    assert (profile_of().slave_id, profile_of().baudrate) == (None, None)


TOO_SHORT = {"max_words": 1, "values": TWO_VALUES}
WRONG: list[tuple[dict[str, Any], tuple[int | str, ...], str]] = [
    ({"ids": [2, 1]}, ("ids",), "the first id is greater than the last"),
    ({"ids": []}, ("ids",), "must be the first and the last slave id, such as [1, 247], not an empty list"),
    ({"ids": [1, 2, 3]}, ("ids",), "must be the first and the last slave id, such as [1, 247], not a list"),
    ({"ids": 5}, ("ids",), "must be the first and the last slave id, such as [1, 247], not 5"),
    ({"framings": []}, ("framings",), "must name at least one, each once"),
    ({"checksums": ["crc", "crc"]}, ("checksums",), "must name at least one, each once"),
    ({"ids": [1, 9], "factory": {"id": 10, "baudrate": 9600}}, ("factory", "id"), "10 is none of the ids 1 to 9"),
    (
        {"slave_id": {"register": 5}, "baudrate": {"register": 5, "codes": {9600: 1}}},
        ("baudrate", "register"),
        "is the register of the slave id",
    ),
    ({"baudrate": {"register": 4, "codes": {}}}, ("baudrate", "codes"), "names no rate"),
    (
        {"baudrate": {"register": 4, "codes": {9600: 1, 19200: 1}}},
        ("baudrate", "codes", 19200),
        "1 is the code of 9600 already",
    ),
    (
        {"baudrate": {"register": 4, "codes": {9601: 1}}},
        ("baudrate", "codes", 9601),
        "is no baud rate; write one of 1200 2400 4800 9600 19200 38400 57600 115200",
    ),
    ({"values": []}, ("values",), "names no value"),
    ({"values": [TWO_VALUES[0]] * 2}, ("values", 1, "name"), "'level' is the name of [0] already"),
    (TOO_SHORT, ("values", 1, "type"), "float32 needs 2 registers, one read of this device returns 1 at most"),
    (
        {"settings": [{"name": "a", "register": 1}, {"name": "a", "register": 2}]},
        ("settings", 1, "name"),
        "'a' is the name of [0] already",
    ),
    (
        {"settings": [{"name": "a", "register": 1}, {"name": "b", "register": 1}]},
        ("settings", 1, "register"),
        "is set by settings[0]; it is no setting of its own",
    ),
    (
        {"slave_id": {"register": 5}, "settings": [{"name": "a", "register": 5}]},
        ("settings", 0, "register"),
        "is set by slave_id; it is no setting of its own",
    ),
    (
        {"max_words": 2, "barrier": {"register": 1, "count": 3}},
        ("barrier", "count"),
        "one read of this device returns 2 registers at most",
    ),
    (
        {"barrier": {"register": 9, "count": 1}},
        ("barrier", "count"),
        "a poll reads as many registers: a late answer could be taken for the barrier's",
    ),
    ({"provenance": {"hair": "seen"}}, ("provenance", "hair"), "is no key of a profile"),
]


@pytest.mark.parametrize(("changed", "place", "message"), WRONG)
def test_what_cannot_be_is_refused_at_its_place(
    profile_of: Build, changed: dict[str, Any], place: tuple[int | str, ...], message: str
) -> None:
    assert problems(profile_of, **changed) == [(place, message)]


def test_a_barrier_of_the_other_function_has_a_shape_of_its_own(profile_of: Build) -> None:
    assert profile_of(barrier={"register": 9, "count": 1, "function": 4}).barrier is not None


@pytest.mark.parametrize("codes", [[9600], None, "9600"])
def test_codes_that_are_no_mapping_are_refused(profile_of: Build, codes: object) -> None:
    assert [place for place, _ in problems(profile_of, baudrate={"register": 4, "codes": codes})] == [
        ("baudrate", "codes")
    ]


def test_a_wrong_key_does_not_hide_the_problems_of_others(profile_of: Build) -> None:
    found = problems(
        profile_of,
        ids=[2, 1],
        max_words=0,
        factory={"id": 1, "baudrate": 9600},
        values=[{"name": "seq", "register": 1, "type": "uint16", "unit": "m"}],
        barrier={"register": 1, "count": 1},
        baudrate={"register": 4},
        settings=[{"name": "a", "register": 4}] * 2,
    )
    assert [place for place, _ in found] == [
        ("ids",),
        ("max_words",),
        ("baudrate", "codes"),
        ("values", 0, "name"),
        ("settings", 1, "name"),
        ("settings", 1, "register"),
    ]


@pytest.mark.parametrize(
    ("key", "wrong"),
    [
        ("name", "Tank"),
        ("title", "two\nlines"),
        ("ids", [0, 247]),
        ("ids", [1, 256]),
        ("ids", ["1", 2]),
        ("ids", [1]),
        ("broadcast", "yes"),
        ("framings", ["tcp"]),
        ("checksums", ["lrc"]),
        ("max_words", 126),
        ("max_words", True),
        ("ascii_max_data", 2),
        ("min_interval", "soon"),
        ("min_interval", -1),
        ("busy_exceptions", [0]),
        ("factory", {"id": 1, "baudrate": 9601}),
        ("slave_id", {}),
        ("values", "none"),
        ("barrier", {"register": 1, "count": 0}),
        ("barrier", {"register": 1, "count": 2, "function": 6}),
        ("notes", ["", "x"]),
        ("colour", "red"),
    ],
)
def test_a_key_of_another_kind_is_refused(profile_of: Build, key: str, wrong: object) -> None:
    assert {place[0] for place, _ in problems(profile_of, **{key: wrong})} == {key}


def test_a_duration_may_be_written_as_in_the_configuration(profile_of: Build) -> None:
    assert profile_of(min_interval="250ms").min_interval == 0.25


def test_what_sets_a_motor_going_is_no_setting(profile_of: Build) -> None:
    settings = [{"name": "ramp", "register": 0x2000, "range": [1, 9], "writable": True}]
    assert profile_of(settings=settings, run_commands=[0x1000]).run_commands == (0x1000,)
    assert problems(profile_of, settings=settings, run_commands=[0x1000, 0x2000]) == [
        (("run_commands", 1), "is the setting ramp already")
    ]


@pytest.mark.parametrize(
    ("limits", "most"),
    [
        ({}, 125),
        ({"max_words": 5}, 5),
        ({"framings": ["ascii"], "ascii_max_data": 16}, 7),
        ({"framings": ["rtu"], "ascii_max_data": 16}, 125),
        ({"framings": ["rtu", "ascii"], "max_words": 5, "ascii_max_data": 16}, 5),
    ],
)
def test_the_longest_read_fits_every_framing(profile_of: Build, limits: dict[str, Any], most: int) -> None:
    assert profile_of(**limits).most_words == most


def test_where_a_key_comes_from_is_kept(profile_of: Build) -> None:
    assert profile_of(provenance={"ids": "the manual, section 2"}).provenance == {"ids": "the manual, section 2"}


def test_a_calibrated_profile_reads_the_same_and_says_other_numbers(profile_of: Build) -> None:
    profile = profile_of(values=TWO_VALUES)
    calibrated = profile.calibrated({"level": (2, 3), "depth": (1, 1)})
    assert [(read.address, read.count) for read in calibrated.reads()] == [(1, 3)]
    (read,), (plain,) = calibrated.reads(), profile.reads()
    assert read.decode((7, 0, 0x3FC0)) == {"level": 17, "volume": 1.5}
    assert plain.decode((7, 0, 0x3FC0)) == {"level": 7, "volume": 1.5}


def test_a_calibrated_profile_knows_what_the_maker_says(profile_of: Build) -> None:
    profile = profile_of(values=TWO_VALUES)
    assert profile.calibrated({}) is profile
    assert profile.plain is profile
    calibrated = profile.calibrated({"level": (2, 3)})
    assert calibrated != profile
    assert calibrated.plain == profile
    assert calibrated.calibrated({"level": (1, 1)}).plain == profile


def test_a_register_that_looks_like_a_number_of_the_manual_is_doubted(profile_of: Build) -> None:
    value = {"type": "uint16", "unit": "m"}
    profile = profile_of(
        values=[{"name": "level", "register": 40001} | value, {"name": "flow", "register": 100} | value],
        slave_id={"register": 42001},
        settings=[{"name": "round", "register": 30000}],
        identify=[{"register": 30011, "holds": [1]}],
    )
    level, slave_id, identify = profile.doubts()
    assert level.startswith("level: register 40001 looks like a number of the manual, not an address")
    assert "so write 0; if it is the address, write it in hexadecimal: 0x9C41" in level
    assert "so write 2000;" in slave_id
    assert "so write 10 and function: 4;" in identify
    assert profile_of().doubts() == ()


def test_a_register_written_in_hexadecimal_is_an_address() -> None:
    """Some manuals print both: 30003 is 0x7533."""
    text = "name: a\ntitle: A\nvalues:\n  - {name: b, register: NUMBER, function: 4, type: uint16, unit: m}\n"
    assert parse_profile(text.replace("NUMBER", "0x7533"), "a.yaml").doubts() == ()
    assert len(parse_profile(text.replace("NUMBER", "30003"), "a.yaml").doubts()) == 1


@pytest.mark.parametrize("name", builtin_names())
def test_no_profile_that_is_shipped_is_doubted(name: str) -> None:
    """The fault register of the EH600 is 0x8000, which in decimal begins as a manual's numbers do."""
    assert load_profile(name, relative_to=Path()).doubts() == ()


def test_the_rates_of_a_device_are_the_factorys_first_and_those_that_can_be_set(profile_of: Build) -> None:
    codes = {"register": 4, "codes": {2400: 0, 4800: 1, 9600: 2}}
    assert profile_of(factory={"id": 1, "baudrate": 4800}, baudrate=codes).rates == (4800, 2400, 9600)
    assert profile_of().rates == ()
